// Dialogues: below the bar with STOP, which stays in reach. Escape closes; the focus comes back.

import { failureLine, focusNear, h } from "./dom.js";

const place = () => document.getElementById("dialogs");

// what is below a dialogue: neither the keyboard nor a screen reader reaches it
const below = () => [document.getElementById("main"), document.querySelector(".views")];

/**
 * Open a dialogue. "act" does what it is for, and may throw a Problem; then it stays open and says why.
 * "isBeside": it leaves the map in sight. "isNeeded": there is no way around it. "onClose" is called once it is gone, whatever was chosen.
 * @param {{title: string, words?: (string|Node)[], word: string, act: (form: any) => Promise<any>, fields?: Node, isBeside?: boolean, onClose?: () => void, isNeeded?: boolean}} what
 */
export function ask({ title, words = [], word, act, fields, isBeside = false, isNeeded = false, onClose = () => {} }) {
  close();
  const before = document.activeElement;
  const failure = failureLine();
  const go = h("button", { class: "small main-word", type: "submit" }, word);
  const form = h("form", { class: "box", role: "dialog", "aria-labelledby": "dialog-title", tabIndex: -1, noValidate: true },
    h("h2", { id: "dialog-title" }, title),
    ...words.map((each) => (each instanceof Node ? each : h("p", {}, each))),
    fields,
    failure.element,
    h("div", { class: "row" }, !isNeeded && h("button", { class: "small", type: "button", onclick: () => close() }, "Back"), go));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (go.disabled) return;
    const wrong = form.querySelector("input:invalid");
    if (wrong) {
      failure.tell(`${wrong.labels[0].firstChild.textContent}: ${wrong.validationMessage}`);
      return wrong.focus();
    }
    go.disabled = true;
    if (await failure.trying(() => act(form))) close();
    else go.disabled = false;
  });
  const cover = h("div", { class: isBeside ? "cover beside" : "cover" }, form);
  document.addEventListener("keydown", onKey);
  cover.addEventListener("pointerdown", (event) => event.target === cover && !isNeeded && close());
  cover._before = before;
  cover._isNeeded = isNeeded;
  cover._onClose = onClose;
  place().append(cover);
  for (const each of below()) each.inert = true;
  (form.querySelector("input:not(.quiet), select, textarea") ?? go).focus();
  return form;
}

function onKey(event) {
  const form = place().querySelector("form");
  if (event.key === "Escape" && form && !form.parentElement._isNeeded) close();
  if (event.key === "Tab" && form) keepFocus(event, form);
}

/** Close the open dialogue. */
export function close() {
  document.removeEventListener("keydown", onKey);
  const cover = place().firstElementChild;
  if (!cover) return;
  cover.remove();
  for (const each of below()) each.inert = false;
  const before = cover._before && cover._before.isConnected ? cover._before : null;
  if (before && before.checkVisibility()) before.focus();
  else focusNear(before && before.parentElement);
  cover._onClose();
}

// STOP is part of the round, though it is not in the dialogue
function keepFocus(event, form) {
  const stops = [...document.querySelectorAll(".stop:not([hidden])")];
  const all = [...form.querySelectorAll("button, input, select, textarea, a[href]"), ...stops].filter((each) => !each.disabled);
  const at = all.indexOf(document.activeElement);
  const next = all[(at + (event.shiftKey ? all.length - 1 : 1)) % all.length];
  event.preventDefault();
  next.focus();
}
