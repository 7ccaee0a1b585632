// Dialogues: below the bar with STOP, which stays in reach. Escape closes; the focus comes back.

import { newKey } from "./api.js";
import { button, failureLine, focusNear, h, make } from "./dom.js";

let open = null;

document.addEventListener("keydown", (event) => event.key === "Escape" && !open?.isNeeded && close());

/**
 * Open a dialogue. "act" does what it is for, and may throw a Problem; then it stays open and says why. The key is one
 * for what is asked, however often it is tried. "isBeside": it leaves the map in sight. "isNeeded": there is no way
 * around it. "onClose" is called once it is gone, whatever was chosen.
 * @param {{title: string, words?: string[], word: string, act: (form: any, key: string) => Promise<any>, fields?: any[], isBeside?: boolean, onClose?: () => void, isNeeded?: boolean}} what
 */
export function ask({ title, words = [], word, act, fields = [], isBeside = false, isNeeded = false, onClose = () => {} }) {
  close();
  const before = document.activeElement;
  const key = newKey();
  const failure = failureLine();
  const go = make(h("button", { class: "small main-word", type: "submit" }, word));
  const form = make(h("form", { class: "box", role: "dialog", "aria-labelledby": "dialog-title", tabindex: -1 },
    h("h2", { id: "dialog-title" }, title),
    h("div", {}, words.map((each) => h("p", {}, each))),
    ...fields,
    failure.element,
    h("div", { class: "row" }, !isNeeded && button("Back", close), go)));
  form.onsubmit = async (event) => {
    event.preventDefault();
    go.disabled = true;
    const isDone = await failure.trying(() => act(form, key));
    go.disabled = false;
    if (isDone) close();
  };
  const cover = make(h("div", { class: isBeside ? "cover beside" : "cover" }, form));
  cover.onpointerdown = (event) => event.target === cover && !isNeeded && close();
  open = { cover, before, around: before.closest("section"), isNeeded, onClose };
  document.getElementById("dialogs").append(cover);
  setInert(true);
  (form.querySelector("input:not(.quiet), select, textarea") ?? go).focus();
  return form;
}

export function close() {
  if (!open) return;
  const { cover, before, around, onClose } = open;
  open = null;
  cover.remove();
  setInert(false);
  if (before.checkVisibility()) before.focus();
  else focusNear(around);
  onClose();
}

// what is below a dialogue: neither the keyboard nor a screen reader reaches it
function setInert(isInert) {
  for (const each of document.querySelectorAll(".skip, .main, .views")) each.inert = isInert;
}
