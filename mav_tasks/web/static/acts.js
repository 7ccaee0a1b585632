// What a person can ask for, each with its consequence said before. Words that let a rover move carry the halt
// epoch of the queue that was shown: a page that is behind cannot release a newer STOP.

import { post } from "./api.js";
import { ask } from "./dialogs.js";
import { button, draw, h, make } from "./dom.js";
import { state } from "./store.js";
import { ACTIVE, counted, taskName } from "./words.js";

export const may = (what) => Boolean(state.session?.may.includes(what));

/** What helps, in words for who may not resume a rover. */
export const forMe = (words) => (may("resume") ? words : words.replace("press Resume", "an operator must press Resume"));

export const pause = (vehicle) => post(`/vehicles/${vehicle}/pause`, {});

const mainButton = (words, act) => button(words, act, { class: "small main-word" });

/** A button for a queue that is paused, for who may resume it. */
export const resumeButton = (queue) => queue?.paused && may("resume") && mainButton("Resume…", () => resume(queue));

function resume({ vehicle, current, waiting, paused_words: why, halt_epoch: epoch }) {
  const words = [`The queue is paused: ${why}.`];
  if (current?.state === "held") words.push(`${taskName(current)} is held, and stays held until you release it.`);
  else if (current) words.push(`Rover ${vehicle} will drive: ${taskName(current)} goes on.`);
  else if (waiting.length) words.push(`Rover ${vehicle} will drive: ${taskName(waiting[0])} starts.`);
  else words.push("No task waits: the rover stands until you add one.");
  if (state.vehicles.get(vehicle)?.armed === false) words.push("The rover is disarmed; the server arms it if it may.");
  ask({ title: `Resume rover ${vehicle}?`, words, word: "Resume", act: () => post(`/vehicles/${vehicle}/resume`, { epoch }) });
}

export function clear({ vehicle, waiting_count: count }) {
  ask({
    title: `Cancel all waiting tasks of rover ${vehicle}?`,
    words: [`${counted(count, "task")} will be cancelled. They do not come back. The running task goes on.`],
    word: "Cancel them", act: () => post(`/vehicles/${vehicle}/clear`, {}),
  });
}

const ENDS = {
  cancel: "The rover slows down and stops; the task ends once it stands. The next task of the queue then starts, unless the queue is paused.",
  kill: "The task ends at once, without waiting until the rover stands. The rover gets zero velocity and HOLD, unless somebody else has taken over. The queue is not paused: the next task starts once the rover stands. STOP keeps it from starting.",
};
const DEPENDS = "Tasks that run after it will fail.";

export function cancel(task) {
  const isActive = ACTIVE.includes(task.state);
  const isCancelling = task.state === "cancelling"; // it can only be ended sooner
  const form = ask({
    title: isCancelling ? `End task ${task.id} at once?` : `Cancel task ${task.id}?`, word: isCancelling ? "Kill the task" : "Cancel the task",
    words: [taskName(task), ...(isActive ? [] : ["It will not run."])],
    fields: [isActive && choice(isCancelling ? { kill: ENDS.kill } : ENDS, isCancelling ? "kill" : "cancel"), h("p", {}, DEPENDS)],
    act: () => post(`/tasks/${task.id}/cancel`, { kill: form.elements.how?.value === "kill" }),
  });
  form.onchange = () => draw(form.querySelector("[type=submit]"), form.elements.how.value === "kill" ? "Kill the task" : "Cancel the task");
}

const RELEASES = {
  again: "From where the rover is now, the whole task is driven again.",
  remainder: "The rover drives what is left of the task.",
  skip: "The task ends as cancelled. The next task then starts.",
};

/** A button for a task that is held, for who may release it. */
export const releaseButton = (task, epoch) => task.state === "held" && may("release") && mainButton("Release…", () => release(task, epoch));

function release(task, epoch) {
  ask({
    title: `Release task ${task.id}?`, word: "Release",
    words: [taskName(task), `It is held: ${task.why ?? task.reason}.`], fields: [choice(RELEASES, "remainder")],
    act: (form) => post(`/tasks/${task.id}/release`, { how: form.elements.how.value, epoch }),
  });
}

/** A choice of ways, each with its consequence in words: the present one's is shown. */
function choice(ways, first) {
  const consequence = make(h("p", { "aria-live": "polite" }, ways[first]));
  const onchange = (event) => draw(consequence, ways[event.target.value]);
  const options = Object.keys(ways).map((each) => h("option", { value: each }, each));
  return h("div", {}, h("label", {}, "How: ", h("select", { name: "how", onchange, value: first }, options)), consequence);
}

export function confirmGoal(vehicle, goal, title) {
  ask({ title, words: [consequenceOf(vehicle)], word: "Add the task", act: (_, key) => post(`/vehicles/${vehicle}/tasks`, { goals: [goal] }, { key }) });
}

/** What a new task of a rover will do, in words. */
export function consequenceOf(vehicle) {
  const queue = state.queues.get(vehicle);
  if (!queue) return "";
  if (queue.paused) return `The queue is paused (${queue.paused_words}): the task waits until you resume.`;
  const before = queue.waiting_count + (queue.current ? 1 : 0);
  return before ? `It runs after ${counted(before, "other task")}, unless its priority is higher.` : `Rover ${vehicle} starts to drive at once.`;
}
