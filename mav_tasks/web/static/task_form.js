// A form for a new task, made from what the API says of goals and their limits.

import { newKey, post } from "./api.js";
import { consequenceOf } from "./acts.js";
import { ask } from "./dialogs.js";
import { h } from "./dom.js";
import { choose, state } from "./store.js";

const NAMES = {
  move: "Move straight", rotate: "Turn by an angle", drive: "Drive at a velocity", goto: "Go to (metres)",
  goto_global: "Go to (latitude, longitude)", face: "Face a heading", wait: "Wait", home: "Return home",
};

const ANY = "any"; // as the API calls it
const ANY_WORDS = "The server chooses the rover that would begin it first, and chooses again if that one is lost before the task begins. The page then shows that rover's queue.";

/** Open the form for a rover, with the parts of a goal filled in; where there are several, any of them can be chosen. */
export function openTaskForm(vehicle, goal = {}) {
  const kinds = state.session.goals;
  const select = h("select", { name: "kind" }, ...kinds.map((kind) => h("option", { value: kind.kind, selected: kind.kind === goal.kind }, NAMES[kind.kind] ?? kind.kind)));
  const meaning = h("small");
  const numbers = h("div", { class: "fields" });
  const draw = () => {
    const kind = kinds.find((each) => each.kind === select.value);
    meaning.textContent = kind.meaning;
    numbers.replaceChildren(...kind.numbers.map((number) => field(number, goal[number.name])));
  };
  select.addEventListener("change", draw);
  draw();
  const { least, most, default: usual } = state.session.priority;
  const terms = h("div", { class: "fields" },
    labelled("Name of the task", h("input", { name: "label", maxLength: state.session.label_bytes, autocomplete: "off" }), `at most ${state.session.label_bytes} bytes`),
    labelled("Priority", h("input", { name: "priority", type: "number", min: least, max: most, step: 1, value: usual }), `${most} runs first`),
    labelled("Start in (s)", h("input", { name: "delay", type: "number", min: 0, step: "any" }), "empty: when it is its turn"),
    labelled("Repeat every (s)", h("input", { name: "every", type: "number", min: 10, step: 1 }), "empty: once"),
    labelled("After task", h("input", { name: "after", type: "number", min: 1, step: 1 }), "empty: none"));
  const consequence = h("p", { class: "empty", "aria-live": "polite" }, consequenceOf(vehicle));
  const who = h("select", { name: "rover" }, h("option", { value: vehicle }, `Rover ${vehicle}`), h("option", { value: ANY }, "Any rover"));
  const isAny = () => who.value === ANY;
  who.addEventListener("change", () => (consequence.textContent = isAny() ? ANY_WORDS : consequenceOf(vehicle)));
  const isOne = state.vehicles.size < 2;
  const keys = { [vehicle]: newKey(), [ANY]: newKey() }; // each for one place, however often it is tried
  ask({
    title: isOne ? `Add a task for rover ${vehicle}` : "Add a task",
    words: [...(isOne ? [] : [h("label", { class: "fields" }, "Who ", who)]), h("label", { class: "fields" }, "What ", select), meaning],
    fields: h("div", {}, numbers, terms, consequence),
    word: "Add the task",
    act: async (form) => {
      const body = bodyOf(form, kinds.find((each) => each.kind === select.value));
      const task = await post(`/vehicles/${who.value}/tasks`, body, { key: keys[who.value] });
      if (isAny()) choose(task.vehicle);
    },
  });
}

function bodyOf(form, kind) {
  const data = new FormData(form);
  const number = (name) => {
    const text = String(data.get(name) ?? "").trim();
    return text === "" ? null : Number(text);
  };
  const goal = { kind: kind.kind };
  for (const each of kind.numbers) if (number(each.name) !== null) goal[each.name] = number(each.name);
  return { goals: [goal], label: String(data.get("label") ?? ""), priority: number("priority"), delay: number("delay"), every: number("every"), after: number("after") };
}

function field(number, value) {
  const hint = [number.meaning];
  if (number.least !== null) hint.push(`at least ${number.least}`);
  if (number.most !== null) hint.push(`at most ${number.most}`);
  const input = h("input", {
    name: number.name, type: "number", step: "any", required: number.required, value: value ?? "",
    min: number.least ?? undefined, max: number.most ?? undefined,
  });
  return labelled(`${number.name.replace("_", " ")}${number.unit ? ` (${number.unit})` : ""}${number.required ? "" : ", optional"}`, input, hint.join("; "));
}

function labelled(name, input, hint) {
  return h("label", {}, name, input, hint ? h("small", {}, hint) : null);
}
