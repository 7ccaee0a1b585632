// A form for a new task, made from what the API says of goals and their limits.

import { get, newKey, post, request } from "./api.js";
import { consequenceOf } from "./acts.js";
import { ask } from "./dialogs.js";
import { h } from "./dom.js";
import { change, choose, state } from "./store.js";
import { taskName } from "./words.js";

const ANY = "any"; // as the API calls it
const ANY_WORDS = "The server chooses the rover that would begin it first, and chooses again if that one is lost before the task begins. The page then shows that rover's queue.";

/** Open the form for a rover, with the parts of a goal filled in; where there are several, any of them can be chosen. */
export function openTaskForm(vehicle, goal = {}) {
  const kinds = state.session.goals;
  const select = h("select", { name: "kind" }, ...kinds.map((kind) => h("option", { value: kind.kind, selected: kind.kind === goal.kind }, kind.title)));
  const meaning = h("small");
  const numbers = h("div", { class: "fields" });
  let defaults = {};
  const kindOf = () => kinds.find((each) => each.kind === select.value);
  const fill = () => {
    for (const { name, unit } of kindOf().numbers) if (name in defaults) numbers.querySelector(`[name=${name}]`).placeholder = `${defaults[name]} ${unit} by default`;
  };
  const draw = () => {
    const kind = kindOf();
    meaning.textContent = kind.meaning;
    numbers.replaceChildren(...kind.numbers.map((number) => field(number, goal[number.name])));
    fill();
  };
  select.addEventListener("change", draw);
  draw();
  get(`/vehicles/${vehicle}/defaults`).then((found) => { defaults = found; fill(); }, () => {}); // the form works without them
  const consequence = h("p", { class: "empty", "aria-live": "polite" }, consequenceOf(vehicle));
  const who = h("select", { name: "rover" }, h("option", { value: vehicle }, `Rover ${vehicle}`), h("option", { value: ANY }, "Any rover"));
  const isAny = () => who.value === ANY;
  who.addEventListener("change", () => (consequence.textContent = isAny() ? ANY_WORDS : consequenceOf(vehicle)));
  const isOne = state.vehicles.size < 2;
  const keys = { [vehicle]: newKey(), [ANY]: newKey() }; // each for one place, however often it is tried
  ask({
    title: isOne ? `Add a task for rover ${vehicle}` : "Add a task",
    words: [...(isOne ? [] : [h("label", { class: "fields" }, "Who ", who)]), h("label", { class: "fields" }, "What ", select), meaning],
    fields: h("div", {}, numbers, termFields({}), consequence),
    word: "Add the task",
    act: async (form) => {
      const body = bodyOf(form, kindOf());
      const task = await post(`/vehicles/${who.value}/tasks`, body, { key: keys[who.value] });
      if (isAny()) choose(task.vehicle);
    },
  });
}

/** Open the form that changes the terms of a task that waits. */
export function openChangeForm(task) {
  ask({
    title: `Change task ${task.id}?`, words: [taskName(task)], fields: termFields(task), word: "Change it",
    act: async (form) => {
      const terms = termsOf(form);
      if (!terms.cron && terms.every === null) terms.every = task.every || task.cron ? 0 : null;
      const after = terms.after ?? 0;
      await request("PATCH", `/tasks/${task.id}`, { ...terms, after: after === (task.after ?? 0) ? null : after });
      change("route"); // its journal has grown
    },
  });
}

/** Fields for when and how often a task runs, with what a task has. */
function termFields(task) {
  const { label_bytes: bytes, priority: { least, most, default: usual } } = state.session;
  const number = (name, words, hint, value = null, limits = {}) => labelled(words, h("input", { name, type: "number", min: 0, step: 1, value: value ?? "", ...limits }), hint);
  const isNew = !task.id;
  return h("div", { class: "fields" },
    labelled("Name of the task", h("input", { name: "label", maxLength: bytes, autocomplete: "off", value: task.label ?? "" }), `at most ${bytes} bytes`),
    number("priority", "Priority", `${least} to ${most}; ${most} runs first`, task.priority ?? usual, { min: least, max: most }),
    labelled("Start at", h("input", { name: "at", type: "datetime-local", step: 1 }), isNew ? "your local time; empty: when it is its turn" : "your local time; empty: as it is"),
    number("delay", "Start in (s)", isNew ? "empty: when it is its turn" : "empty: as it is; 0: when it is its turn", null, { step: "any" }),
    number("deadline", "Must start within (s)", isNew ? "or it expires; empty: it may wait for ever" : "or it expires; empty: as it is; 0: it may wait for ever", null, { step: "any" }),
    number("after", "After task", "runs once that is completed; empty: after no other", task.after, { min: 1 }),
    number("every", "Repeat every (s)", "empty: once", task.every, { min: 10 }),
    labelled("Repeat at", h("input", { name: "cron", placeholder: "30 7 * * 1-5 Europe/Berlin", autocomplete: "off", value: task.cron ?? "" }), "minute, hour, day, month, weekday, zone (else UTC)"));
}

const numberOf = (data, name) => (String(data.get(name) ?? "").trim() === "" ? null : Number(data.get(name)));

function termsOf(form) {
  const data = new FormData(form);
  const terms = { label: String(data.get("label")), cron: String(data.get("cron")).trim() || null };
  for (const name of ["priority", "delay", "deadline", "after", "every"]) terms[name] = numberOf(data, name);
  return { ...terms, at: data.get("at") ? new Date(String(data.get("at"))).toISOString() : null };
}

function bodyOf(form, kind) {
  const data = new FormData(form);
  const goal = { kind: kind.kind };
  for (const { name } of kind.numbers) {
    const text = String(data.get(name) ?? "").trim();
    if (text !== "") goal[name] = Number.isNaN(Number(text)) ? text : Number(text); // the server says which words there are
  }
  return { goals: [goal], ...termsOf(form) };
}

function field(number, value) {
  const hint = [number.meaning];
  if (number.least !== null) hint.push(`at least ${number.least}`);
  if (number.most !== null) hint.push(`at most ${number.most}`);
  const list = `words-of-${number.name}`;
  const kind = number.words.length ? { list, autocomplete: "off" } : { type: "number", step: "any", min: number.least ?? undefined, max: number.most ?? undefined };
  const input = h("input", { name: number.name, required: number.required, value: value ?? "", ...kind });
  const words = h("datalist", { id: list }, ...number.words.map((word) => h("option", { value: word })));
  return labelled(`${number.name.charAt(0).toUpperCase()}${number.name.slice(1).replace("_", " ")}${number.unit ? ` (${number.unit})` : ""}`, number.words.length ? h("span", {}, input, words) : input, hint.join("; "));
}

function labelled(name, input, hint) {
  return h("label", {}, name, input, hint ? h("small", {}, hint) : null);
}
