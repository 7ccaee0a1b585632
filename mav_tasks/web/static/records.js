// Recorded runs: their ways on the map, and what happened, at any moment of the run.

import { get } from "./api.js";
import { failureLine, h, reconcile, say, show } from "./dom.js";
import { showRun } from "./map.js";
import { onChange, state } from "./store.js";
import { clock, duration } from "./words.js";

const tab = document.getElementById("tab-records");
const panel = document.getElementById("panel-records");
const STEPS = [1, 5, 20, 60]; // times real time
const EVENTS = 40; // lines before the moment

const list = h("ol", { class: "cards", "aria-label": "Recorded runs, the newest first" });
const none = h("p", { class: "empty" });
const failure = failureLine();
const title = h("h3", {});
const scrub = h("input", { type: "range", class: "scrub", min: 0, max: 1000, step: 1, value: 0, "aria-label": "Moment of the run" });
const moment = h("p", { class: "why" });
const play = h("button", { class: "small main-word", type: "button", onclick: () => toggle() }, "Play");
const speed = h("select", { "aria-label": "How fast" }, ...STEPS.map((step) => h("option", { value: step, selected: step === 5 }, `${step} ×`)));
const events = h("ol", { class: "log", "aria-label": "What had happened by then, the latest first" });
const one = h("section", { hidden: true }, h("button", { class: "small", type: "button", onclick: () => close() }, "← Back to the present"), title, scrub, moment, h("div", { class: "row" }, play, speed), events);
const all = h("div", {}, list, none);

let run = null;
let place = () => {};
let at = 0;
let timer = 0;

export function begin() {
  panel.append(failure.element, one, all);
  scrub.addEventListener("input", () => go(run.begins + (Number(scrub.value) / 1000) * (run.ends - run.begins)));
  onChange(["session"], () => {
    show(tab, Boolean(state.session && state.session.records));
    if (tab.hidden && tab.ariaSelected === "true") document.getElementById("tab-queue").click();
  });
}

/** The tab was opened: list the runs. */
export function shown() {
  if (run) return;
  failure.trying(async () => {
    const { records } = await get("/records");
    say(none, records.length ? "" : "No recording in this folder yet.");
    reconcile(list, records, (each) => each.name, make);
  });
}

/** Another tab was opened: the map shows the present again. */
export const left = () => run && close();

function make(record) {
  const info = h("p", { class: "why" });
  const element = h("li", { class: "card" }, h("button", { class: "pick", type: "button", onclick: () => open(record.name) }, record.name), info);
  const update = (each) => {
    const parts = each.files.length === 2 ? "packets and decisions" : each.files[0].endsWith(".tlog") ? "packets" : "decisions";
    say(info, `${clock(each.changed)} · ${(each.bytes / 1e6).toFixed(1)} MB · ${parts}`);
  };
  return { element, update };
}

async function open(name) {
  say(none, `Reading ${name}…`);
  const isRead = await failure.trying(async () => (run = await get(`/records/${encodeURIComponent(name)}`, { within: 130000 })));
  say(none, "");
  if (!isRead) return;
  say(title, `${name}, ${duration(run.ends - run.begins)}`);
  show(one, true);
  show(all, false);
  place = showRun(run);
  go(run.begins);
}

function close() {
  stop();
  run = null;
  showRun(null);
  show(one, false);
  show(all, true);
}

// show a moment: each rover at its last point before it
function go(wanted) {
  at = Math.min(Math.max(wanted, run.begins), run.ends);
  scrub.value = String(Math.round((1000 * (at - run.begins)) / Math.max(run.ends - run.begins, 0.001)));
  const parts = [clock(at)];
  for (const rover of run.vehicles) {
    const index = lastBefore(rover.points, at);
    if (!rover.points.length) continue;
    const [, , , heading, metres] = rover.points[Math.max(index, 0)];
    place(rover.vehicle, index, heading);
    if (index < 0) {
      parts.push(`rover ${rover.vehicle}: no position yet`);
      continue;
    }
    const mode = rover.modes[lastBefore(rover.modes, at)];
    parts.push(`rover ${rover.vehicle}: ${mode ? `${mode[1]}${mode[2] ? ", armed" : ""}, ` : ""}${(metres ?? 0).toFixed(1)} m/s`);
  }
  say(moment, parts.join(" · "));
  scrub.setAttribute("aria-valuetext", parts[0]);
  const end = lastBefore(run.events, at, (event) => event.at);
  const first = Math.max(0, end - EVENTS + 1);
  const lines = run.events.slice(first, end + 1).map((event, n) => ({ event, key: first + n })).reverse();
  reconcile(events, lines, (line) => line.key, ({ event }) => ({
    element: h("li", {}, h("time", {}, clock(event.at)), event.words), update() {},
  }));
}

function lastBefore(rows, wanted, timeOf = (row) => row[0]) {
  let low = 0;
  let high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (timeOf(rows[middle]) <= wanted) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function toggle() {
  if (timer) return stop();
  if (at >= run.ends) go(run.begins);
  say(play, "Pause");
  let before = performance.now();
  const step = (now) => {
    go(at + ((now - before) / 1000) * Number(speed.value));
    before = now;
    if (at >= run.ends) stop();
    else timer = requestAnimationFrame(step);
  };
  timer = requestAnimationFrame(step);
}

function stop() {
  cancelAnimationFrame(timer);
  timer = 0;
  say(play, "Play");
}
