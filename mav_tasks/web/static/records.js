// Recorded runs: their ways on the map, and what happened, at any moment of the run.

import { get } from "./api.js";
import { button, draw, failureLine, h } from "./dom.js";
import { showRun } from "./map.js";
import { onChange } from "./store.js";
import { clock, duration, joined } from "./words.js";

const panel = document.getElementById("panel-records");
const STEPS = [1, 5, 20, 60]; // times real time
const EVENTS = 40; // lines before the moment
const SCRUB = 1000; // places of the slider

const failure = failureLine();
let records = null;
let name = ""; // of the run that is read or shown
let run = null; // the one that is shown
let place = () => {};
let at = 0;
let speed = 5;
let timer = 0;

onChange(["tab"], () => {
  if (panel.hidden) return run && close();
  if (!run) failure.trying(async () => ({ records } = await get("/records"))).then(drawAll);
});

async function open(chosen) {
  name = chosen;
  drawAll();
  const isRead = await failure.trying(async () => (run = await get(`/records/${encodeURIComponent(chosen)}`, { within: 130000 })));
  if (!isRead) return close();
  place = showRun(run);
  go(run.begins);
}

function close() {
  stop();
  name = "";
  run = null;
  showRun(null);
  drawAll();
}

// show a moment: each rover at its last point before it
function go(wanted) {
  at = Math.min(Math.max(wanted, run.begins), run.ends);
  for (const { vehicle, points } of run.vehicles) {
    const index = lastBefore(points);
    if (points.length) place(vehicle, index, points[Math.max(index, 0)][3]);
  }
  drawAll();
}

const drawAll = () => draw(panel, failure.element, ...(run ? drawRun() : drawList()));

const drawList = () => [
  h("ol", { key: "runs", class: "cards", "aria-label": "Recorded runs, the newest first" }, (records ?? []).map((each) => (
    h("li", { key: each.name, class: "card" },
      h("button", { class: "pick", type: "button", onclick: () => open(each.name) }, each.name),
      h("p", { class: "why" }, joined(
        clock(each.changed), `${(each.bytes / 1e6).toFixed(1)} MB`,
        each.files.length === 2 ? "packets and decisions" : each.files[0].endsWith(".tlog") ? "packets" : "decisions",
      )))))),
  h("p", { key: "none", class: "empty" }, name ? `Reading ${name}…` : records?.length === 0 && "No recording in this folder yet."),
];

function drawRun() {
  const length = run.ends - run.begins;
  const end = lastBefore(run.events) + 1;
  const first = Math.max(0, end - EVENTS);
  return [h("section", { key: "run" },
    button("← Back to the present", close),
    h("h3", {}, `${name}, ${duration(length)}`),
    h("input", {
      type: "range", class: "scrub", min: 0, max: SCRUB, step: 1, "aria-label": "Moment of the run", "aria-valuetext": clock(at),
      oninput: (event) => go(run.begins + (event.target.value / SCRUB) * length), value: String(Math.round((SCRUB * (at - run.begins)) / Math.max(length, 0.001))),
    }),
    h("p", { class: "why" }, joined(clock(at), ...run.vehicles.filter(({ points }) => points.length).map(roverWords))),
    h("div", { class: "row" },
      button(timer ? "Pause" : "Play", toggle, { class: "small main-word" }),
      h("select", { "aria-label": "How fast", onchange: (event) => (speed = Number(event.target.value)), value: speed }, STEPS.map((step) => h("option", { value: step }, `${step} ×`)))),
    h("ol", { class: "log", "aria-label": "What had happened by then, the latest first" },
      run.events.slice(first, end).map((event, n) => h("li", { key: first + n }, h("time", {}, clock(event.at)), event.words)).reverse()))];
}

function roverWords({ vehicle, points, modes }) {
  const index = lastBefore(points);
  if (index < 0) return `rover ${vehicle}: no position yet`;
  const [, mode, isArmed] = modes[lastBefore(modes)] ?? [];
  return `rover ${vehicle}: ${mode ? `${mode}${isArmed ? ", armed" : ""}, ` : ""}${(points[index][4] ?? 0).toFixed(1)} m/s`;
}

/** The place of the last row whose time, its first value or "at", is not after the moment; -1: there is none. */
const lastBefore = (rows) => rows.findLastIndex((row) => (row[0] ?? row.at) <= at);

function toggle() {
  if (timer) return stop();
  if (at >= run.ends) at = run.begins;
  let before = performance.now();
  const step = (now) => {
    timer = requestAnimationFrame(step);
    go(at + ((now - before) / 1000) * speed);
    before = now;
    if (at >= run.ends) stop();
  };
  step(before);
}

function stop() {
  cancelAnimationFrame(timer);
  timer = 0;
  if (run) drawAll();
}
