// The time line of the chosen rover: past tasks, the present one, what comes. It follows the present until somebody
// moves it. A longer time needs more of the past than the list beside it has at first.

import { h, reconcile, say, show } from "./dom.js";
import { keep, kept } from "./kept.js";
import * as past from "./past.js";
import { chosenQueue, onChange, serverNow } from "./store.js";
import { showTask } from "./routes.js";
import { taskName } from "./words.js";

const SPANS = [[600, "10 min"], [3600, "1 h"], [21600, "6 h"], [86400, "24 h"]]; // s
const MANY = 500; // finished tasks for more than the shortest span
const FAR = 86400; // s from now to the middle, at most
const TICKS = [60, 120, 300, 600, 1800, 3600, 7200, 10800, 21600]; // s between two times; the first for which there is room
const ROOM = 58; // px for a time
const SHORTEST = 5; // s
const WHEEL = 60; // px of a wheel or touch pad for one step
const FEW = 4; // px that a pointer moves before it drags

const place = document.getElementById("timeline");
const select = h("select", { "aria-label": "Length of the time line", onchange: () => take(Number(select.value)) }, ...SPANS.map(([seconds, words]) => h("option", { value: seconds }, words)));
const button = (words, label, act) => h("button", { class: "small", type: "button", "aria-label": label, title: label, onclick: act }, words);
const now = button("Now", "Follow the present", () => moveTo(null));
const range = h("span", { class: "why" });
const line = h("div", { class: "now-line" });
const bars = h("div", {});
const ticks = h("div", { "aria-hidden": "true" });
const unknown = h("div", { class: "unknown", hidden: true }, "not loaded");
const strip = h("div", { class: "strip", role: "group", tabIndex: 0 }, unknown, bars, ticks, line);

let span = SPANS[0][0];
let middle = null; // seconds since 1970; null: now
let focused = 0; // the task whose bar the keyboard reaches

export function begin() {
  place.append(h("div", { class: "timeline-head" }, select, button("◀", "Earlier", () => move(-1)), now, button("▶", "Later", () => move(1)), range), strip);
  place.addEventListener("keydown", onKey);
  strip.addEventListener("wheel", onWheel, { passive: false });
  strip.addEventListener("pointerdown", onPointer);
  const known = Number(kept("time line", ""));
  take(SPANS.some(([seconds]) => seconds === known) ? known : span);
  document.addEventListener("past", draw);
  onChange(["queues", "chosen", "clock", "whole"], draw);
}

function take(seconds) {
  span = seconds;
  select.value = String(seconds);
  keep("time line", select.value);
  if (span > SPANS[0][0]) past.loadMore(MANY);
  draw();
}

/** Take the next longer (1) or shorter (-1) time. */
function zoom(by) {
  const at = SPANS.findIndex(([seconds]) => seconds === span) + by;
  if (SPANS[at]) take(SPANS[at][0]);
}

const move = (quarters) => moveTo((middle ?? serverNow()) + (quarters * span) / 4);

function moveTo(at) {
  middle = at === null ? null : Math.min(Math.max(at, serverNow() - FAR), serverNow() + FAR);
  draw();
}

const KEYS = { "+": () => zoom(-1), "=": () => zoom(-1), "-": () => zoom(1), PageUp: () => move(-1), PageDown: () => move(1), Home: () => moveTo(null), ArrowLeft: () => step(-1), ArrowRight: () => step(1) };

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target === select || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
}

// from bar to bar; from a button to the bar that the keyboard was on
function step(by) {
  const all = [...bars.children];
  const at = all.indexOf(document.activeElement);
  const next = at < 0 ? all.find((bar) => bar.tabIndex === 0) : all[at + by];
  if (next) next.focus();
}

let turned = 0;

function onWheel(event) {
  if (event.ctrlKey) return; // the browser's own zoom
  event.preventDefault();
  const isAlong = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
  const pixels = (isAlong && event.deltaX ? event.deltaX : event.deltaY) * (event.deltaMode ? 20 : 1);
  if (isAlong) return moveTo((middle ?? serverNow()) + (pixels * span) / strip.clientWidth);
  turned += pixels;
  if (Math.abs(turned) < WHEEL) return;
  zoom(Math.sign(turned));
  turned = 0;
}

function onPointer(event) {
  if (event.button !== 0) return;
  const begins = middle ?? serverNow();
  let isDragged = false;
  const dragged = (later) => {
    if (later.pointerId !== event.pointerId || (!isDragged && Math.abs(later.clientX - event.clientX) < FEW)) return;
    if (!isDragged) strip.setPointerCapture(event.pointerId); // the bar below it is not clicked then
    isDragged = true;
    moveTo(begins - ((later.clientX - event.clientX) * span) / strip.clientWidth);
  };
  strip.addEventListener("pointermove", dragged);
  for (const end of ["pointerup", "pointercancel"]) strip.addEventListener(end, () => strip.removeEventListener("pointermove", dragged), { once: true });
}

/** The tasks between two times, the earliest first. */
function shownBetween(first, last) {
  const queue = chosenQueue();
  if (!queue) return [];
  const present = serverNow();
  const found = [];
  for (const task of past.tasks) {
    if (task.vehicle !== queue.vehicle || !task.endedAt) continue;
    found.push({ task, from: task.endedAt - Math.max(task.execution_time ?? 0, SHORTEST), to: task.endedAt, kind: task.state });
  }
  const { current, waiting } = queue;
  let from = present;
  if (current) {
    const end = present + (current.time_to_finish ?? 60);
    found.push({ task: current, from: present - (current.execution_time ?? 0), to: end, kind: "now" });
    from = end;
  }
  for (const task of waiting) {
    if (task.time_to_start === null && task.time_to_finish === null) continue;
    const begins = task.time_to_start === null ? from : present + task.time_to_start;
    const ends = task.time_to_finish === null ? begins + 30 : present + task.time_to_finish;
    found.push({ task, from: begins, to: Math.max(ends, begins + SHORTEST), kind: "waiting" });
  }
  return found.filter((bar) => bar.to >= first && bar.from <= last).sort((a, b) => a.from - b.from);
}

const timeOf = (at) => new Date(at * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });

function draw() {
  const present = serverNow();
  const first = (middle ?? present) - span / 2;
  const last = first + span;
  const x = (at) => (100 * (at - first)) / span;
  now.setAttribute("aria-pressed", String(middle === null));
  say(range, `${timeOf(first)} – ${timeOf(last)}`);
  const label = `Tasks from ${timeOf(first)} to ${timeOf(last)}`;
  if (strip.ariaLabel !== label) strip.ariaLabel = label;
  const shown = shownBetween(first, last).map((bar) => {
    const left = Math.max(0, x(bar.from));
    return { ...bar, left, width: Math.min(100, x(bar.to)) - left };
  });
  reconcile(bars, shown, ({ task }) => task.id, ({ task }) => {
    const element = h("button", { type: "button", class: "bar", tabIndex: -1, onclick: () => showTask(task.id), onfocus: () => (focused = task.id) });
    const update = (bar) => {
      element.style.left = `${bar.left}%`;
      element.style.width = `${Math.max(0.4, bar.width)}%`;
      const name = `bar ${bar.kind}`;
      if (element.className !== name) element.className = name;
      // a number that does not fit would lie on the next one's
      say(element, (bar.width * strip.clientWidth) / 100 > 8 * String(bar.task.id).length + 8 ? `${bar.task.id}` : "");
      element.title = `${taskName(bar.task)}: ${bar.task.state}`;
      element.setAttribute("aria-label", element.title);
    };
    return { element, update };
  });
  // one stop of the Tab key; arrow keys go on from there
  const reached = shown.some(({ task }) => task.id === focused) ? focused : shown.length ? shown[shown.length - 1].task.id : 0;
  for (const [id, row] of bars._rows) row.element.tabIndex = id === reached ? 0 : -1;
  line.style.left = `${x(present)}%`;
  show(line, present >= first && present <= last);
  const known = past.knownSince();
  show(unknown, known !== null && known > first);
  if (known !== null) unknown.style.width = `${Math.min(100, x(known))}%`;
  drawTicks(first, last, x, strip.clientWidth / span);
}

// "pixels" of a second
function drawTicks(first, last, x, pixels) {
  const tick = TICKS.find((each) => each * pixels >= ROOM) ?? TICKS[TICKS.length - 1];
  const edge = pixels ? ROOM / 2 / pixels : 0;
  const shift = new Date(first * 1000).getTimezoneOffset() * 60; // whole hours of the clock on the wall
  const begins = Math.ceil((first + edge - shift) / tick) * tick + shift;
  const count = pixels ? Math.floor((last - edge - begins) / tick) + 1 : 0;
  const marks = Array.from({ length: Math.max(0, count) }, (_, n) => begins + n * tick);
  reconcile(ticks, marks, (at) => at, (at) => ({ element: h("span", { class: "tick" }, timeOf(at)), update() {} }));
  for (const [at, row] of ticks._rows) row.element.style.left = `${x(at)}%`;
}
