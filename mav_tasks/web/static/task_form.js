// A form for a new task, made from what the API says of goals and their limits.

import { get, newKey, post, request } from "./api.js";
import { consequenceOf } from "./acts.js";
import { ask } from "./dialogs.js";
import { h } from "./dom.js";
import { fieldsOf, filledIn } from "./parts.js";
import { change, choose, state } from "./store.js";
import { taskName } from "./words.js";

const ANY = "any"; // as the API calls it
const ANY_WORDS = "The server chooses the rover that would begin it first, and chooses again if that one is lost before the task begins. The page then shows that rover's queue.";

/** Open the form for a rover, with the parts of a goal filled in; where there are several, any of them can be chosen. */
export function openTaskForm(vehicle, goal = {}) {
  const kinds = state.session.goals;
  const select = h("select", { name: "kind" }, ...kinds.map((kind) => h("option", { value: kind.kind, selected: kind.kind === goal.kind }, kind.title)));
  const meaning = h("small");
  const numbers = h("div"), terms = fieldsOf(state.session.terms);
  let defaults = {};
  const kindOf = () => kinds.find((each) => each.kind === select.value);
  const fill = () => {
    for (const { name, unit } of kindOf().numbers) if (name in defaults) numbers.querySelector(`[name=${name}]`).placeholder = `${defaults[name]} ${unit} by default`;
  };
  const draw = () => {
    const kind = kindOf();
    meaning.textContent = kind.meaning;
    numbers.replaceChildren(fieldsOf(kind.numbers, goal));
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
    fields: h("div", {}, numbers, terms, consequence),
    word: "Add the task",
    act: async () => {
      const goals = [{ kind: kindOf().kind, ...filledIn(numbers, kindOf().numbers) }];
      const task = await post(`/vehicles/${who.value}/tasks`, { goals, ...filledIn(terms, state.session.terms) }, { key: keys[who.value] });
      if (isAny()) choose(task.vehicle);
    },
  });
}

/** Open the form that changes the terms of a task that waits. */
export function openChangeForm(task) {
  const { changes } = state.session;
  const fields = fieldsOf(changes, task);
  ask({
    title: `Change task ${task.id}?`, words: [taskName(task), "A field that you leave as it is changes nothing."],
    fields, word: "Change it",
    act: async () => {
      await request("PATCH", `/tasks/${task.id}`, filledIn(fields, changes, task));
      change("route"); // its journal has grown
    },
  });
}
