// Finished tasks of the chosen rover; and one task, whatever its state, with its journal, track and set-point timing.

import { failureWords, get } from "./api.js";
import * as acts from "./acts.js";
import { button, draw, failureLine, h } from "./dom.js";
import { showTrack } from "./map.js";
import { change, onChange, showTask, state } from "./store.js";
import { openChangeForm } from "./task_form.js";
import { ACTIVE, OVER, WAITING, clock, duration, endedAt, joined, progressWords, quick, stateWords, taskLink, taskName } from "./words.js";

const detail = document.getElementById("panel-task");
const LISTED = 100;

export let tasks = [];
let wanted = LISTED;
let loadedFor = "";
let whole = { vehicle: 0, wanted: 0 }; // what "tasks" has

onChange(["route"], open);
onChange(["one", "session", "queues"], drawOne); // a release carries the halt epoch of the queue
onChange(["chosen", "tasks", "queues", "whole"], refresh);

/** Load more finished tasks than the list has at first. */
export function loadMore(count) {
  if (count <= wanted) return;
  wanted = count;
  loadedFor = "";
  refresh();
}

/** Since when all finished tasks are known, seconds since 1970; null: since the beginning. */
export const knownSince = () => (tasks.length < whole.wanted || !tasks.length ? null : endedAt(tasks.at(-1)));

// The latest are fetched again when a task of the rover has ended; all of them, if older ones would be missing.
async function refresh() {
  const queue = state.queues.get(state.chosen);
  if (!queue) return;
  const mark = [queue.vehicle, ...OVER.map((name) => queue.counts[name] ?? 0)].join(" ");
  if (mark === loadedFor) return;
  const isWhole = whole.vehicle === queue.vehicle && whole.wanted === wanted;
  loadedFor = mark;
  let none = "No task has ended yet.";
  try {
    const load = async (count) => (await get(`/vehicles/${queue.vehicle}/history?limit=${count}`)).tasks;
    let latest = await load(isWhole ? LISTED : wanted);
    let older = [];
    if (isWhole && latest.length === LISTED) { // else those are all
      const ids = new Set(latest.map((task) => task.id));
      older = tasks.filter((task) => !ids.has(task.id));
      if (older.length === tasks.length) [latest, older] = [await load(wanted), []];
    }
    if (mark !== loadedFor) return; // another rover was chosen meanwhile, or another task has ended
    tasks = [...latest, ...older].slice(0, wanted);
    whole = { vehicle: queue.vehicle, wanted };
  } catch (error) {
    if (mark !== loadedFor) return;
    loadedFor = "";
    none = failureWords(error);
  }
  draw(document.getElementById("panel-past"), h("ol", { "aria-label": "Finished tasks, the newest first" }, tasks.map(row)), h("p", { class: "empty" }, (!tasks.length || !loadedFor) && none));
  change("past");
}

const row = (task) => h("li", { key: task.id, class: "task" },
  h("div", { class: "line" }, h("span", { class: "title" }, taskLink(task.id, taskName(task))), h("span", { class: "state" }, stateWords(task))),
  h("p", { class: "why" }, joined(
    task.ended_at && `ended ${clock(endedAt(task))}`,
    task.execution_time && `driven ${duration(task.execution_time)}`,
    task.why,
  )));

const failure = failureLine();
let timing = ""; // of the task that is shown, in words
let entries = []; // of its journal
let none = ""; // why there are no entries

async function open() {
  const id = state.task;
  [timing, entries, none] = ["", [], ""];
  failure.tell("");
  detail.hidden = id === null;
  detail.parentElement.classList.toggle("one", id !== null);
  drawOne();
  if (id === null) return showTrack(null);
  // each as soon as it has come: a slow journal keeps nothing back
  const part = async (name, take, failed = () => {}) => {
    try {
      const answer = await get(`/tasks/${id}${name}`);
      if (state.task === id) take(answer);
    } catch (error) {
      if (state.task === id) failed(failureWords(error));
    }
    drawOne();
  };
  await part("", (found) => (state.one = found), failure.tell);
  if (state.one?.id !== id) return;
  part("/track", ({ points }) => showTrack({ id, points, vehicle: state.one.vehicle }));
  part("/timing", (found) => {
    if (!found?.count) return;
    const { count, rate, p50, p99, max, late } = found;
    timing = `${count} intervals at ${rate} Hz: median ${quick(p50)}, p99 ${quick(p99)}, longest ${quick(max)}, ${late} late`;
  }, (words) => (timing = `unknown: ${words}`));
  none = state.session.journal ? "Reading the journal…" : "The web process reads no journal of this server: start it on the same machine, with --store.";
  if (state.session.journal) {
    part("/journal", (found) => {
      entries = found.entries;
      none = "The journal has nothing of this task.";
    }, (words) => (none = words));
  }
  drawOne();
}

function drawOne() {
  const { task: id, one: task } = state;
  draw(detail,
    button("← Back to the list", () => showTask(null)),
    h("h2", {}, task ? taskName(task) : `Task ${id}`),
    h("dl", { class: "facts-table" }, task && factsOf(task).filter(([, value]) => value).flatMap(([name, value]) => [h("dt", { key: name }, name), h("dd", { key: `${name} is` }, value)])),
    failure.element,
    h("div", { class: "row" }, ...(task ? buttonsOf(task) : [])),
    h("h3", {}, "What happened"),
    h("ol", { class: "log", "aria-label": "Journal of the task" }, entries.map((entry) => (
      h("li", { class: entry.level === "warning" && "warn" }, h("time", {}, clock(entry.at)), entry.message)))),
    h("p", { class: "empty" }, !entries.length && none));
}

const factsOf = (task) => [
  ["State", stateWords(task)],
  ["Why", task.why],
  ["What helps", task.remedy && acts.forMe(task.remedy.words)],
  ["Rover", task.vehicle],
  ["Priority", String(task.priority)],
  ["Progress", ACTIVE.includes(task.state) && progressWords(task)],
  ["After", task.after && `task ${task.after}`],
  ["Driven", task.execution_time && duration(task.execution_time)],
  ["Ended", task.ended_at && clock(endedAt(task))],
  ["Submitted by", task.submitted_by],
  ["Set-points", timing],
];

const buttonsOf = (task) => [
  acts.releaseButton(task, state.queues.get(task.vehicle)?.halt_epoch ?? task.halt_epoch),
  WAITING.includes(task.state) && acts.may("modify") && button("Change…", () => openChangeForm(task)),
  !OVER.includes(task.state) && acts.may("cancel") && button(task.state === "cancelling" ? "Kill…" : "Cancel…", () => acts.cancel(task)),
];
