// Forms of tasks, made from what the API says of the parts of a request: a new task, and a change.

import { get, post, request, sentence } from "./api.js";
import { consequenceOf } from "./acts.js";
import { ask } from "./dialogs.js";
import { draw, h, make } from "./dom.js";
import { change, choose, state } from "./store.js";
import { taskName } from "./words.js";

const WIDE = 1e6; // a bound beyond this tells nothing
const NUMBERS = ["number", "integer"];
const ANY = "any"; // as the API calls it
const ANY_WORDS = "The server chooses the rover that would begin it first, and chooses again if that one is lost before the task begins. The page then shows that rover's queue.";

/** Open the form for a rover; where there are several, any of them can be chosen. */
export function openTaskForm(vehicle) {
  const { goals: kinds, terms } = state.session;
  const isOne = state.vehicles.size < 2;
  const fields = make(h("div"));
  let [kind, who, defaults] = [kinds[0], vehicle, {}];
  const choice = (name, title, options) => h("label", { class: "fields" }, title, h("select", { name }, options.map(([value, words]) => h("option", { value }, words))));
  const drawFields = () => draw(fields,
    !isOne && choice("rover", "Who ", [[vehicle, `Rover ${vehicle}`], [ANY, "Any rover"]]),
    choice("kind", "What ", kinds.map((each) => [each.kind, each.title])),
    h("small", {}, kind.meaning),
    h("div", { key: kind.kind }, fieldsOf(kind.numbers, {}, defaults)),
    fieldsOf(terms),
    h("p", { class: "empty", "aria-live": "polite" }, who === ANY ? ANY_WORDS : consequenceOf(vehicle)));
  fields.onchange = ({ target }) => {
    if (target.name === "rover") who = target.value;
    if (target.name === "kind") kind = kinds[target.selectedIndex];
    drawFields();
  };
  drawFields();
  get(`/vehicles/${vehicle}/defaults`).then((found) => {
    defaults = found;
    drawFields();
  }, () => {}); // the form works without them
  ask({
    title: isOne ? `Add a task for rover ${vehicle}` : "Add a task", fields: [fields], word: "Add the task",
    act: async (form, key) => {
      const goals = [{ kind: kind.kind, ...filledIn(form, kind.numbers) }];
      const task = await post(`/vehicles/${who}/tasks`, { goals, ...filledIn(form, terms) }, { key: `${key} ${who}` });
      if (who === ANY) choose(task.vehicle);
    },
  });
}

export function openChangeForm(task) {
  const { changes } = state.session;
  ask({
    title: `Change task ${task.id}?`, words: [taskName(task), "A field that you leave as it is changes nothing."],
    fields: [fieldsOf(changes, task)], word: "Change it",
    act: async (form) => {
      await request("PATCH", `/tasks/${task.id}`, filledIn(form, changes, task));
      change("route"); // its journal has grown
    },
  });
}

/** Fields for parts, filled with what each is now, and with what it is by default beside it. */
export const fieldsOf = (parts, was = {}, defaults = {}) => h("div", { class: "fields" }, parts.map((part) => field(part, was[part.name] ?? "", defaults[part.name])));

/** Return the parts that were filled in, or changed from what each was; a number that was emptied is 0. */
export function filledIn(form, parts, was = {}) {
  const values = {};
  for (const { name, type } of parts) {
    const text = form.querySelector(`[name=${name}]`).value.trim();
    if (text !== String(was[name] ?? "").trim()) values[name] = valueOf(name, type, text);
  }
  return values;
}

function valueOf(name, type, text) {
  if (name === "at") return new Date(text).toISOString();
  if (type === "boolean") return text === "yes";
  if (NUMBERS.includes(type)) return Number(text);
  return type === "any" && !Number.isNaN(Number(text)) ? Number(text) : text; // the server says which words there are
}

function field({ name, type, unit, meaning, required, least, most, words }, value, standard) {
  const isKept = name === "priority" && value !== ""; // emptied, it would be 0, which is one of its values
  const own = { name, required: required || isKept, autocomplete: "off", placeholder: standard && `${standard} ${unit} by default` };
  const hints = [name === "at" ? "start time, as your clock shows it" : meaning];
  const inputs = [];
  if (name === "at") inputs.push(h("input", { ...own, type: "datetime-local", step: 1, value }));
  else if (type === "boolean") inputs.push(h("select", { name }, ["", "yes", "no"].map((word) => h("option", {}, word))));
  else if (NUMBERS.includes(type)) {
    inputs.push(h("input", { ...own, type: "number", step: type === "integer" ? 1 : "any", min: least, max: most, value }));
    if (least && least > -WIDE) hints.push(`at least ${least}`);
    if (most !== null && most < WIDE) hints.push(`at most ${most}`);
  } else {
    inputs.push(h("input", { ...own, maxlength: most, list: `words-of-${name}`, value }));
    inputs.push(h("datalist", { id: `words-of-${name}` }, words.map((word) => h("option", { value: word }))));
  }
  return h("label", {}, `${sentence(name).replace("_", " ")}${unit ? ` (${unit})` : ""}`, ...inputs, h("small", {}, hints.join("; ")));
}
