// The queue of the chosen rover: what runs, what waits and why, in order; and what a person can do about it.

import { request } from "./api.js";
import * as acts from "./acts.js";
import { makeDraggable } from "./dragging.js";
import { button, draw, failureLine, h, make } from "./dom.js";
import { openTaskForm } from "./task_form.js";
import { planDrop } from "./plans.js";
import { chosenQueue, onChange, state } from "./store.js";
import { duration, joined, progressWords, stateWords, taskLink, taskName } from "./words.js";

const panel = document.getElementById("panel-queue");
const RUNS = { starting: "starts", executing: "runs", paused: "is paused", cancelling: "is being cancelled", held: "is held" };
const SAID = 8000; // ms for which it stays what a move did

const failure = failureLine();
const drop = planDrop();
const list = make(h("ol", { "aria-label": "Waiting tasks, in the order in which they run" }));
let dragged = null; // the row that is dragged, and what it is over
let over = null;
let said = "";
let telling = 0;

onChange(["queues", "chosen", "tasks", "clock", "whole", "session"], drawAll);
makeDraggable(list, (row, target) => {
  [dragged, over] = [row && idOf(row), target && idOf(target)];
  if (!over) return drawAll();
  tell(`Task ${dragged} will run ${isUp() ? "before" : "after"} task ${over}.`);
}, (row, target) => move(idOf(row), placeOf(idOf(target))));

const idOf = (row) => Number(row.dataset.task);

/** The tasks that stand in line, in order; those behind them wait for something else. */
const line = () => chosenQueue().waiting.filter((task) => task.state === "queued");
const placeOf = (id) => line().findIndex((task) => task.id === id);
const isUp = () => placeOf(dragged) > placeOf(over);

function drawAll() {
  const queue = chosenQueue();
  const { waiting = [], waiting_count: count = 0, current = null, paused = null } = queue ?? {};
  const doesRun = current ? `task ${current.id} ${RUNS[current.state] ?? current.state}` : "no task runs";
  const what = queue ? `Rover ${queue.vehicle}: ${doesRun}, ${count} wait${count === 1 ? "s" : ""}` : state.vehicles.size ? "Loading the queue…" : "No rover yet.";
  const hint = acts.may("submit") ? "Nothing waits. Add a task, drop a plan file here, or click on the map." : "Nothing waits.";
  const ends = queue ? [line()[0]?.id, line().at(-1)?.id] : [];
  draw(list, waiting.map((task) => row(task, false, ends)));
  draw(panel,
    h("p", { class: "what" }, what),
    h("div", { class: "panel-head" },
      queue && acts.may("submit") && button("Add a task…", () => openTaskForm(state.chosen), { class: "small main-word" }),
      count > 0 && acts.may("clear") && button("Cancel all…", () => acts.clear(queue))),
    h("div", { class: "notice", role: "status", hidden: !paused },
      paused && h("div", {}, h("strong", {}, `No task runs: ${queue.paused_words}.`), " ", acts.forMe(queue.paused_remedy)),
      acts.resumeButton(queue)),
    failure.element,
    h("ol", { "aria-label": "The task that runs" }, current && row(current, true, ends)),
    list,
    h("p", { class: "empty" }, queue?.more ? `and ${queue.more} more` : queue && !count && !current && hint),
    (acts.may("submit") || acts.may("fence")) && drop,
    // at the end: it moves no row away below a finger
    h("p", { class: "said", "aria-live": "polite" }, said));
}

function row(task, isCurrent, [first, last]) {
  const { id } = task;
  const isMovable = task.state === "queued" && acts.may("modify");
  const end = task.state === "cancelling" ? "Kill" : "Cancel";
  const marks = {
    now: isCurrent, movable: isMovable, dragged: id === dragged, "over-above": id === over && isUp(), "over-below": id === over && !isUp(),
  };
  const named = (words, onclick, label, disabled) => button(words, onclick, { "aria-label": label, disabled });
  const says = task.why && `${isCurrent ? "Reason" : "Waits"}: ${task.why}${task.remedy ? `. ${acts.forMe(task.remedy.words)}` : ""}`;
  return h("li", { key: id, class: ["task", ...Object.keys(marks).filter((name) => marks[name])].join(" "), "data-task": id },
    h("div", { class: "line" },
      // ▲ and ▼ do the same for a keyboard and a screen reader
      isMovable && h("span", { class: "grip", "aria-hidden": "true", title: "Drag to another place" }, "⠿"),
      h("span", { class: "title" }, taskLink(id, taskName(task))),
      h("span", { class: "row" },
        task.remedy && acts.releaseButton(task, chosenQueue().halt_epoch),
        isCurrent && ["starting", "executing"].includes(task.state) && named("Pause", () => failure.trying(() => acts.pause(task.vehicle)), `Pause task ${id}`),
        isMovable && named("▲", () => move(id, placeOf(id) - 1), `Move task ${id} up`, id === first),
        isMovable && named("▼", () => move(id, placeOf(id) + 1), `Move task ${id} down`, id === last),
        acts.may("cancel") && named(`${end}…`, () => acts.cancel(task), `${end} task ${id}`))),
    isCurrent && task.progress !== null && h("progress", { max: 1, "aria-label": `Progress of task ${id}`, value: task.progress }),
    h("div", { class: "whys" },
      task.state !== "queued" && h("span", { class: "state" }, stateWords(task)), // "Waits" says it
      h("p", { class: "why" }, isCurrent ? progressWords(task) : waitWords(task)),
      h("p", { class: task.remedy ? "why warn" : "why" }, says)));
}

function waitWords({ priority, every, cron, time_to_start: begin, time_to_finish: end }) {
  return joined(
    `priority ${priority}`,
    every ? `repeats every ${duration(every)}` : cron && `repeats at ${cron}`,
    begin === null ? end !== null && `ends in ${duration(end)}` : end === null ? `starts in ${duration(begin)}` : `runs in ${duration(begin)} to ${duration(end)}`,
  );
}

function tell(words) {
  clearTimeout(telling);
  said = words;
  if (words) telling = setTimeout(tell, SAID, "");
  drawAll();
}

/** Move a task before the one at a place of the line; behind the last one that is here only if it is the last of all. */
function move(id, place) {
  return failure.trying(async () => {
    const follower = line().filter((task) => task.id !== id)[place];
    const before = follower?.id ?? (chosenQueue().more ? null : 0);
    await request("PATCH", `/tasks/${id}`, { before });
    tell(before ? `Task ${id} runs before task ${before} now.` : `Task ${id} runs last now.`);
  });
}
