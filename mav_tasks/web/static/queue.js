// The queue of the chosen rover: what runs, what waits and why, in order; and what a person can do about it.

import { request } from "./api.js";
import * as acts from "./acts.js";
import { makeDraggable } from "./dragging.js";
import { failureLine, h, reconcile, renew, say, show } from "./dom.js";
import { openTaskForm } from "./task_form.js";
import { planDrop } from "./plans.js";
import { chosenQueue, onChange, state } from "./store.js";
import { goTo } from "./routes.js";
import { duration, progressWords, stateWords, taskName } from "./words.js";

const panel = document.getElementById("panel-queue");
const MOST = 200; // rows
const RUNS = { starting: "starts", executing: "runs", paused: "is paused", cancelling: "is being cancelled", held: "is held" };

const what = h("p", { class: "what" });
const add = h("button", { class: "small main-word", type: "button", onclick: () => openTaskForm(state.chosen) }, "Add a task…");
const clear = h("button", { class: "small", type: "button", onclick: () => acts.clear(chosenQueue()) }, "Cancel all…");
const why = h("strong");
const remedy = h("span");
const go = h("button", { class: "small main-word", type: "button", onclick: () => acts.resume(chosenQueue()) }, "Resume…");
const notice = h("div", { class: "notice", role: "status", hidden: true }, h("div", {}, why, " ", remedy), go);
const failure = failureLine();
// at the end: it moves no row away below a finger
const said = h("p", { class: "said", "aria-live": "polite" });
const SAID = 8000; // ms for which it stays
const current = h("ol", { "aria-label": "The task that runs" });
const list = h("ol", { "aria-label": "Waiting tasks, in the order in which they run" });
const more = h("p", { class: "empty" });
const drop = planDrop();

export function begin() {
  panel.append(what, h("div", { class: "panel-head" }, add, clear), notice, failure.element, current, list, more, drop, said);
  onChange(["session"], () => [current, list].forEach(renew));
  onChange(["queues", "chosen", "tasks", "clock", "whole", "session"], draw);
}

function draw() {
  const queue = chosenQueue();
  show(add, Boolean(queue) && acts.may("submit"));
  show(drop, acts.may("submit") || acts.may("fence"));
  show(clear, Boolean(queue && queue.waiting_count) && acts.may("clear"));
  if (!queue) {
    say(what, state.vehicles.size ? "Loading the queue…" : "No rover yet.");
    for (const each of [current, list]) reconcile(each, [], () => 0, () => null);
    show(notice, false);
    say(more, "");
    return;
  }
  const count = queue.waiting_count;
  say(what, `Rover ${queue.vehicle}: ${queue.current ? `task ${queue.current.id} ${RUNS[queue.current.state] ?? queue.current.state}` : "no task runs"}, ${count} wait${count === 1 ? "s" : ""}`);
  show(notice, Boolean(queue.paused));
  if (queue.paused) {
    say(why, `No task runs: ${queue.paused_words}.`);
    say(remedy, acts.forMe(queue.paused_remedy));
    show(go, acts.may("resume"));
  }
  reconcile(current, queue.current ? [queue.current] : [], (task) => task.id, (task) => make(task, true));
  reconcile(list, queue.waiting.slice(0, MOST), (task) => task.id, (task) => make(task, false));
  const hidden = queue.more + Math.max(0, queue.waiting.length - MOST);
  say(more, hidden ? `and ${hidden} more` : count || queue.current ? "" : acts.may("submit") ? "Nothing waits. Add a task, drop a plan file here, or click on the map." : "Nothing waits.");
}

function make(task, isCurrent) {
  const id = task.id;
  const link = h("a", { href: `/tasks/${id}`, onclick: (event) => goTo(event, id) });
  const mark = h("span", { class: "state" });
  const bar = h("progress", { max: 1, "aria-label": `Progress of task ${id}` });
  const info = h("p", { class: "why" });
  const reason = h("p", { class: "why" });
  const button = (words, act, label) => h("button", { class: "small", type: "button", "aria-label": label, onclick: act }, words);
  const now = () => find(id);
  const earlier = button("▲", () => step(id, -1), `Move task ${id} up`);
  const later = button("▼", () => step(id, +1), `Move task ${id} down`);
  const release = h("button", { class: "small main-word", type: "button", onclick: () => acts.release(now(), chosenQueue().halt_epoch) }, "Release…");
  const cancel = button("Cancel…", () => acts.cancel(now()), `Cancel task ${id}`);
  const pause = button("Pause", () => failure.trying(() => acts.pause(now().vehicle)), `Pause task ${id}`);
  // ▲ and ▼ do the same for a keyboard and a screen reader
  const grip = h("span", { class: "grip", "aria-hidden": "true", title: "Drag to another place" }, "⠿");
  const element = h("li", { class: isCurrent ? "task now" : "task", "data-task": String(id) },
    h("div", { class: "line" }, grip, h("span", { class: "title" }, link), h("span", { class: "row" }, release, pause, earlier, later, cancel)),
    bar, h("div", { class: "whys" }, mark, info, reason));
  if (!isCurrent) makeMovable(element, grip, id);
  const update = (shown) => {
    say(link, taskName(shown));
    say(mark, stateWords(shown));
    show(mark, shown.state !== "queued"); // "Waits" says it
    show(bar, isCurrent && shown.progress !== null);
    if (shown.progress !== null) bar.value = shown.progress;
    say(info, isCurrent ? progressWords(shown) : waitWords(shown));
    say(reason, shown.why ? `${isCurrent ? "Reason" : "Waits"}: ${shown.why}${shown.remedy ? `. ${acts.forMe(shown.remedy.words)}` : ""}` : "");
    const mood = shown.remedy ? "why warn" : "why";
    if (reason.className !== mood) reason.className = mood;
    show(release, shown.state === "held" && Boolean(shown.remedy) && acts.may("release"));
    show(pause, isCurrent && ["starting", "executing"].includes(shown.state));
    const isCancelling = shown.state === "cancelling";
    say(cancel, isCancelling ? "Kill…" : "Cancel…");
    cancel.setAttribute("aria-label", `${isCancelling ? "Kill" : "Cancel"} task ${id}`);
    show(cancel, acts.may("cancel"));
    const isMovable = shown.state === "queued" && acts.may("modify");
    for (const each of [grip, earlier, later]) show(each, isMovable);
    const ids = isMovable ? line().map((task) => task.id) : [];
    earlier.disabled = ids[0] === id;
    later.disabled = ids.at(-1) === id;
    element.classList.toggle("movable", isMovable);
  };
  return { element, update };
}

function find(id) {
  const queue = chosenQueue();
  return [queue.current, ...queue.waiting].find((task) => task && task.id === id) ?? state.tasks.get(id);
}

function waitWords(task) {
  const parts = [`priority ${task.priority}`];
  if (task.every || task.cron) parts.push(`repeats ${task.every ? `every ${duration(task.every)}` : `at ${task.cron}`}`);
  const [begin, end] = [task.time_to_start, task.time_to_finish];
  if (begin !== null && end !== null) parts.push(`runs in ${duration(begin)} to ${duration(end)}`);
  else if (begin !== null) parts.push(`starts in ${duration(begin)}`);
  else if (end !== null) parts.push(`ends in ${duration(end)}`);
  return parts.join(" · ");
}

let telling = 0;

function tell(words) {
  clearTimeout(telling);
  say(said, words);
  if (words) telling = setTimeout(() => say(said, ""), SAID);
}

/** The tasks that stand in line, in order; those behind them wait for something else. */
const line = () => chosenQueue().waiting.filter((task) => task.state === "queued");

/** The task before which one runs that is moved to a place; 0: it is the last; null: what follows is not here. */
function follower(id, place) {
  const others = line().filter((task) => task.id !== id);
  return others[place]?.id ?? (chosenQueue().more ? null : 0);
}

function move(id, place) {
  return failure.trying(async () => {
    const before = follower(id, place);
    await request("PATCH", `/tasks/${id}`, { before });
    tell(before ? `Task ${id} runs before task ${before} now.` : `Task ${id} runs last now.`);
  });
}

const step = (id, by) => move(id, line().findIndex((task) => task.id === id) + by);

function makeMovable(element, grip, id) {
  let place = 0;
  const mark = () => {
    for (const each of list.querySelectorAll(".over-above, .over-below")) each.classList.remove("over-above", "over-below");
  };
  makeDraggable(element, {
    grip,
    may: () => element.classList.contains("movable"),
    rowAt: (below) => {
      const row = below.closest("li.movable");
      return row && list.contains(row) ? row : null;
    },
    over: (row) => {
      mark();
      if (!row) return;
      const ids = line().map((task) => task.id);
      const other = Number(row.dataset.task);
      place = ids.indexOf(other);
      const isUp = ids.indexOf(id) > place;
      row.classList.add(isUp ? "over-above" : "over-below");
      tell(`Task ${id} will run ${isUp ? "before" : "after"} task ${other}.`);
    },
    drop: () => move(id, place),
  });
}
