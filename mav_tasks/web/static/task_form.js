// A form for a new task, made from what the API says of goals and their limits.

import { get, post, request } from "./api.js";
import { consequenceOf } from "./acts.js";
import { ask } from "./dialogs.js";
import { draw, h, make } from "./dom.js";
import { fieldsOf, filledIn } from "./parts.js";
import { change, choose, state } from "./store.js";
import { taskName } from "./words.js";

const ANY = "any"; // as the API calls it
const ANY_WORDS = "The server chooses the rover that would begin it first, and chooses again if that one is lost before the task begins. The page then shows that rover's queue.";

/** Open the form for a rover; where there are several, any of them can be chosen. */
export function openTaskForm(vehicle) {
  const { goals: kinds, terms } = state.session;
  const isOne = state.vehicles.size < 2;
  const fields = make(h("div"));
  let [kind, who, defaults] = [kinds[0], vehicle, {}];
  const choice = (name, title, options, onchange) => h("label", { class: "fields" }, title, h("select", { name, onchange }, options.map(([value, words]) => h("option", { value }, words))));
  const drawFields = () => draw(fields,
    !isOne && choice("rover", "Who ", [[vehicle, `Rover ${vehicle}`], [ANY, "Any rover"]], (event) => {
      who = event.target.value;
      drawFields();
    }),
    choice("kind", "What ", kinds.map((each) => [each.kind, each.title]), (event) => {
      kind = kinds[event.target.selectedIndex];
      drawFields();
    }),
    h("small", {}, kind.meaning),
    h("div", { key: kind.kind }, fieldsOf(kind.numbers, {}, defaults)),
    fieldsOf(terms),
    h("p", { class: "empty", "aria-live": "polite" }, who === ANY ? ANY_WORDS : consequenceOf(vehicle)));
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

/** Open the form that changes the terms of a task that waits. */
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
