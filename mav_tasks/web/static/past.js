// Finished tasks of the chosen rover; and one task, whatever its state, with its journal, track and set-point timing.

import { failureWords, get } from "./api.js";
import * as acts from "./acts.js";
import { failureLine, h, reconcile, say, show } from "./dom.js";
import { showTrack } from "./map.js";
import { onChange, serverNow, state } from "./store.js";
import { goTo, showTask } from "./routes.js";
import { openChangeForm } from "./task_form.js";
import { ACTIVE, OVER, WAITING, clock, duration, progressWords, quick, stateWords, taskName } from "./words.js";

const panel = document.getElementById("panel-past");
const list = h("ol", { "aria-label": "Finished tasks, the newest first" });
const none = h("p", { class: "empty" });
const detail = document.getElementById("panel-task");

export let tasks = [];
const LISTED = 100;
let wanted = LISTED;
let loadedFor = "";
let whole = { vehicle: 0, wanted: 0 }; // what "tasks" has

export function begin() {
  panel.append(list, none);
  onChange(["route"], open);
  onChange(["tasks"], () => state.tasks.has(state.task) && drawFacts(state.tasks.get(state.task)));
  onChange(["session"], () => task && task.id === state.task && drawFacts(task));
  onChange(["chosen", "tasks", "queues", "whole"], refresh);
}

/** Load more finished tasks than the list has at first. */
export function loadMore(count) {
  if (count <= wanted) return;
  wanted = count;
  loadedFor = "";
  refresh();
}

/** Since when all finished tasks are known, seconds since 1970; null: since the beginning. */
export const knownSince = () => (tasks.length < whole.wanted || !tasks.length ? null : tasks[tasks.length - 1].endedAt);

// The latest are fetched again when a task of the rover has ended; all of them, if older ones would be missing.
async function refresh() {
  const queue = state.queues.get(state.chosen);
  if (!queue) return;
  const over = ["completed", "failed", "cancelled", "killed", "expired"].map((name) => queue.counts[name] ?? 0);
  const mark = `${queue.vehicle} ${over.join(" ")}`;
  if (mark === loadedFor) return;
  const isWhole = whole.vehicle === queue.vehicle && whole.wanted === wanted;
  loadedFor = mark;
  try {
    let latest = await load(queue.vehicle, isWhole ? LISTED : wanted);
    let older = [];
    if (isWhole && latest.length === LISTED) { // else those are all
      const ids = new Set(latest.map((task) => task.id));
      older = tasks.filter((task) => !ids.has(task.id));
      if (older.length === tasks.length) [latest, older] = [await load(queue.vehicle, wanted), []];
    }
    if (mark !== loadedFor) return; // another rover was chosen meanwhile, or another task has ended
    tasks = [...latest, ...older].slice(0, wanted);
    whole = { vehicle: queue.vehicle, wanted };
    say(none, tasks.length ? "" : "No task has ended yet.");
  } catch (error) {
    if (mark !== loadedFor) return;
    loadedFor = "";
    say(none, failureWords(error));
  }
  reconcile(list, tasks, (task) => task.id, make);
  document.dispatchEvent(new CustomEvent("past"));
}

async function load(vehicle, count) {
  const { tasks: found } = await get(`/vehicles/${vehicle}/history?limit=${count}`);
  for (const task of found) task.endedAt = task.ended_ago === null ? null : serverNow() - task.ended_ago;
  return found;
}

function make(task) {
  const link = h("a", { href: `/tasks/${task.id}`, onclick: (event) => goTo(event, task.id) });
  const mark = h("span", { class: "state" });
  const info = h("p", { class: "why" });
  const element = h("li", { class: "task" }, h("div", { class: "line" }, h("span", { class: "title" }, link), mark), info);
  const update = (shown) => {
    say(link, taskName(shown));
    say(mark, stateWords(shown));
    const parts = [];
    if (shown.endedAt) parts.push(`ended ${clock(shown.endedAt)}`);
    if (shown.execution_time) parts.push(`driven ${duration(shown.execution_time)}`);
    if (shown.why && shown.why !== shown.state) parts.push(shown.why);
    say(info, parts.join(" · "));
  };
  return { element, update };
}

const facts = h("dl", { class: "facts-table" });
const title = h("h2", {});
let task = null; // the one that is shown; a snapshot of the stream may not have it
// made once: a button that is replaced between press and release is not clicked
const release = h("button", { class: "small main-word", type: "button", hidden: true, onclick: () => acts.release(task, state.queues.get(task.vehicle)?.halt_epoch ?? task.halt_epoch) }, "Release…");
const cancel = h("button", { class: "small", type: "button", hidden: true, onclick: () => acts.cancel(task) }, "Cancel…");
const modify = h("button", { class: "small", type: "button", hidden: true, onclick: () => openChangeForm(task) }, "Change…");
const buttons = h("div", { class: "row" }, release, modify, cancel);
const failure = failureLine();
const log = h("ol", { class: "log", "aria-label": "Journal of the task" });
const logNone = h("p", { class: "empty" });
detail.append(h("button", { class: "small", type: "button", onclick: () => showTask(null) }, "← Back to the list"), title, facts, failure.element, buttons, h("h3", {}, "What happened"), log, logNone);

async function open() {
  const id = state.task;
  show(detail, id !== null);
  detail.parentElement.classList.toggle("one", id !== null);
  if (id === null) return showTrack(null);
  say(title, `Task ${id}`);
  facts.replaceChildren();
  log.replaceChildren();
  for (const each of [release, modify, cancel]) show(each, false);
  say(logNone, "");
  let found;
  if (!(await failure.trying(async () => (found = await get(`/tasks/${id}`)))) || state.task !== id) return;
  drawFacts(found);
  // each as soon as it has come: a slow journal keeps nothing back
  const part = async (request, shown, failed = () => {}) => {
    try {
      const answer = await request;
      if (state.task === id) shown(answer);
    } catch (error) {
      if (state.task === id) failed(failureWords(error));
    }
  };
  part(get(`/tasks/${id}/track`), ({ points }) => showTrack({ id, points, vehicle: task.vehicle }));
  part(get(`/tasks/${id}/timing`), (timing) => {
    if (!timing || !timing.count) return;
    const { count, rate, p50, p99, max, late } = timing;
    addFact("Set-points", `${count} intervals at ${rate} Hz: median ${quick(p50)}, p99 ${quick(p99)}, longest ${quick(max)}, ${late} late`);
  }, (words) => addFact("Set-points", `unknown: ${words}`));
  if (!state.session.journal) return say(logNone, "The web process reads no journal of this server: start it on the same machine, with --store.");
  say(logNone, "Reading the journal…");
  part(get(`/tasks/${id}/journal`), ({ entries }) => {
    say(logNone, entries.length ? "" : "The journal has nothing of this task.");
    log.replaceChildren(...entries.map((entry) => h("li", { class: entry.level === "warning" ? "warn" : "" }, h("time", {}, clock(entry.at)), entry.message)));
  }, (words) => say(logNone, words));
}

function drawFacts(found) {
  task = found;
  say(title, taskName(task));
  const rows = [["State", stateWords(task)]];
  if (task.why) rows.push(["Why", task.why]);
  if (task.remedy) rows.push(["What helps", acts.forMe(task.remedy.words)]);
  rows.push(["Rover", String(task.vehicle)], ["Priority", String(task.priority)]);
  if (ACTIVE.has(task.state) && progressWords(task)) rows.push(["Progress", progressWords(task)]);
  if (task.after) rows.push(["After", `task ${task.after}`]);
  if (task.execution_time) rows.push(["Driven", duration(task.execution_time)]);
  if (task.ended_at) rows.push(["Ended", clock(Date.parse(task.ended_at) / 1000)]);
  rows.push(["Submitted by", task.submitted_by]);
  const kept = [...facts.children].filter((each) => each.dataset.kept);
  facts.replaceChildren(...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]), ...kept);
  show(release, task.state === "held" && acts.may("release"));
  show(modify, WAITING.has(task.state) && acts.may("modify"));
  say(cancel, task.state === "cancelling" ? "Kill…" : "Cancel…");
  show(cancel, !OVER.has(task.state) && acts.may("cancel"));
}

function addFact(name, value) {
  facts.append(h("dt", { "data-kept": "yes" }, name), h("dd", { "data-kept": "yes" }, value));
}
