// What a person can ask for, each with its consequence said before. Words that let a rover move carry the halt
// epoch of the queue that was shown: a page that is behind cannot release a newer STOP.

import { newKey, post } from "./api.js";
import { ask } from "./dialogs.js";
import { h } from "./dom.js";
import { state } from "./store.js";
import { ACTIVE, taskName } from "./words.js";

export const may = (what) => Boolean(state.session && state.session.may.includes(what));

/** What helps, in words for who may not resume a rover. */
export const forMe = (words) => (may("resume") ? words : words.replace("press Resume", "an operator must press Resume"));

export const pause = (vehicle) => post(`/vehicles/${vehicle}/pause`, {});

export function resume(queue) {
  const rover = state.vehicles.get(queue.vehicle);
  const words = [];
  if (queue.paused_words) words.push(`The queue is paused: ${queue.paused_words}.`);
  const current = queue.current;
  if (current && current.state === "held") words.push(`${taskName(current)} is held, and stays held until you release it.`);
  else if (current) words.push(`Rover ${queue.vehicle} will drive: ${taskName(current)} goes on.`);
  else if (queue.waiting.length) words.push(`Rover ${queue.vehicle} will drive: ${taskName(queue.waiting[0])} starts.`);
  else words.push("No task waits: the rover stands until you add one.");
  if (rover && rover.armed === false) words.push("The rover is disarmed; the server arms it if it may.");
  ask({ title: `Resume rover ${queue.vehicle}?`, words, word: "Resume", act: () => post(`/vehicles/${queue.vehicle}/resume`, { epoch: queue.halt_epoch }) });
}

export function clear(queue) {
  const count = queue.waiting_count;
  ask({
    title: `Cancel all waiting tasks of rover ${queue.vehicle}?`,
    words: [`${count} task${count === 1 ? "" : "s"} will be cancelled. They do not come back. The running task goes on.`],
    word: "Cancel them", act: () => post(`/vehicles/${queue.vehicle}/clear`, {}),
  });
}

const ENDS = {
  cancel: "The rover slows down and stops; the task ends once it stands. The next task of the queue then starts, unless the queue is paused.",
  kill: "The task ends at once, without waiting until the rover stands. The rover gets zero velocity and HOLD, unless somebody else has taken over. The queue is not paused: the next task starts once the rover stands. STOP keeps it from starting.",
};
const DEPENDS = "Tasks that run after it will fail.";

export function cancel(task) {
  const title = `Cancel task ${task.id}?`;
  const act = (body) => post(`/tasks/${task.id}/cancel`, body);
  if (!ACTIVE.has(task.state)) return ask({ title, words: [taskName(task), "It will not run.", DEPENDS], word: "Cancel the task", act: () => act({}) });
  // one that is being cancelled can only be ended sooner
  const isCancelling = task.state === "cancelling";
  const how = choice(isCancelling ? { kill: ENDS.kill } : ENDS, isCancelling ? "kill" : "cancel");
  const form = ask({
    title: isCancelling ? `End task ${task.id} at once?` : title, word: isCancelling ? "Kill the task" : "Cancel the task", words: [taskName(task)],
    fields: h("div", {}, how.label, how.consequence, h("p", {}, DEPENDS)), act: () => act({ kill: how.select.value === "kill" }),
  });
  how.select.addEventListener("change", () => (form.querySelector("[type=submit]").textContent = how.select.value === "kill" ? "Kill the task" : "Cancel the task"));
}

const RELEASES = {
  again: "From where the rover is now, the whole task is driven again.",
  remainder: "The rover drives what is left of the task.",
  skip: "The task ends as cancelled. The next task then starts.",
};

export function release(task, epoch, how = "remainder") {
  const { select, label, consequence } = choice(RELEASES, how);
  ask({
    title: `Release task ${task.id}?`, word: "Release",
    words: [taskName(task), `It is held: ${task.why ?? task.reason}.`],
    fields: h("div", {}, label, consequence),
    act: () => post(`/tasks/${task.id}/release`, { how: select.value, epoch }),
  });
}

/** A choice of ways, each with its consequence in words: the present one's is shown. */
function choice(ways, first) {
  const select = h("select", { name: "how" }, ...Object.keys(ways).map((each) => h("option", { value: each, selected: each === first }, each)));
  const consequence = h("p", { "aria-live": "polite" }, ways[first]);
  select.addEventListener("change", () => (consequence.textContent = ways[select.value]));
  return { select, consequence, label: h("label", { class: "whole" }, "How: ", select) };
}

/** Submit goals, and say before what will happen. */
export function confirmGoal(vehicle, goal, title) {
  const key = newKey();
  ask({ title, words: [consequenceOf(vehicle)], word: "Add the task", act: () => post(`/vehicles/${vehicle}/tasks`, { goals: [goal] }, { key }) });
}

/** What a new task of a rover will do, in words. */
export function consequenceOf(vehicle) {
  const queue = state.queues.get(vehicle);
  if (!queue) return "";
  if (queue.paused) return `The queue is paused (${queue.paused_words}): the task waits until you resume.`;
  const before = queue.waiting_count + (queue.current ? 1 : 0);
  if (before) return `It runs after ${before} other task${before > 1 ? "s" : ""}, unless its priority is higher.`;
  return `Rover ${vehicle} starts to drive at once.`;
}
