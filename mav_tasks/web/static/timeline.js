// The time line of the chosen rover: past tasks, the present one, what comes. It follows the present until somebody
// moves it. A longer time needs more of the past than the list beside it has at first.

import { button, draw, h, make } from "./dom.js";
import { follow } from "./dragging.js";
import * as past from "./past.js";
import { chosenQueue, kept, onChange, serverNow, showTask } from "./store.js";
import { endedAt, taskName } from "./words.js";

const SPANS = { 600: "10 min", 3600: "1 h", 21600: "6 h", 86400: "24 h" }; // s
const LENGTHS = Object.keys(SPANS).map(Number);
const MANY = 500; // finished tasks for more than the shortest span
const FAR = 86400; // s from now to the middle, at most
const TICKS = [60, 120, 300, 600, 1800, 3600, 7200, 10800, 21600]; // s between two times; the first for which there is room
const ROOM = 58; // px for a time
const SHORTEST = 5; // s
const WHEEL = 60; // px of a wheel or touch pad for one step

const place = document.getElementById("timeline");
const strip = make(h("div", { class: "strip", role: "group", tabindex: 0 }));

let span = LENGTHS[0];
let middle = null; // seconds since 1970; null: now
let focused = 0; // the task whose bar the keyboard reaches

function take(seconds) {
  if (!LENGTHS.includes(seconds)) return;
  span = kept["mav-tasks time line"] = seconds;
  if (span > LENGTHS[0]) past.loadMore(MANY);
  drawAll();
}

/** Take the next longer (1) or shorter (-1) time. */
const zoom = (by) => take(LENGTHS[LENGTHS.indexOf(span) + by]);

const move = (quarters) => moveTo((middle ?? serverNow()) + (quarters * span) / 4);

function moveTo(at) {
  middle = at === null ? null : Math.min(Math.max(at, serverNow() - FAR), serverNow() + FAR);
  drawAll();
}

const KEYS = { "+": () => zoom(-1), "=": () => zoom(-1), "-": () => zoom(1), PageUp: () => move(-1), PageDown: () => move(1), Home: () => moveTo(null), ArrowLeft: () => step(-1), ArrowRight: () => step(1) };

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select") || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
}

// from bar to bar; from a button to the bar that the keyboard was on
function step(by) {
  const all = [...strip.querySelectorAll(".bar")];
  const at = all.indexOf(document.activeElement);
  (at < 0 ? all.find((bar) => bar.tabIndex === 0) : all[at + by])?.focus();
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
  const begins = middle ?? serverNow();
  if (event.button === 0) follow(strip, event, (later) => moveTo(begins - ((later.clientX - event.clientX) * span) / strip.clientWidth));
}

/** The tasks between two times, the earliest first. */
function shownBetween(first, last) {
  const queue = chosenQueue();
  if (!queue) return [];
  const { vehicle, current, waiting } = queue;
  const present = serverNow();
  const found = past.tasks.filter((task) => task.vehicle === vehicle && task.ended_at).map((task) => (
    { task, from: endedAt(task) - Math.max(task.execution_time ?? 0, SHORTEST), to: endedAt(task), kind: task.state }
  ));
  const free = present + (current ? current.time_to_finish ?? 60 : 0);
  if (current) found.push({ task: current, from: present - (current.execution_time ?? 0), to: free, kind: "now" });
  for (const task of waiting) {
    const { time_to_start: begin, time_to_finish: end } = task;
    if (begin === null && end === null) continue;
    const from = begin === null ? free : present + begin;
    found.push({ task, from, to: Math.max(end === null ? from + 30 : present + end, from + SHORTEST), kind: "waiting" });
  }
  return found.filter((bar) => bar.to >= first && bar.from <= last).sort((a, b) => a.from - b.from);
}

const timeOf = (at) => new Date(at * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });

function drawAll() {
  const present = serverNow();
  const first = (middle ?? present) - span / 2;
  const last = first + span;
  const x = (at) => (100 * (at - first)) / span;
  const pixels = strip.clientWidth / span; // of a second
  const shown = shownBetween(first, last);
  // one stop of the Tab key; arrow keys go on from there
  const reached = (shown.find(({ task }) => task.id === focused) ?? shown.at(-1))?.task.id;
  const known = past.knownSince();
  const bars = shown.map(({ task, from, to, kind }) => {
    const left = Math.max(0, x(from));
    const width = Math.min(100, x(to)) - left;
    const title = `${taskName(task)}: ${task.state}`;
    const own = { title, "aria-label": title, style: `left: ${left}%; width: ${Math.max(0.4, width)}%`, tabindex: task.id === reached ? 0 : -1 };
    const isRoom = (width * strip.clientWidth) / 100 > 8 * String(task.id).length + 8; // else it would lie on the next one's
    return h("button", { key: task.id, type: "button", class: `bar ${kind}`, onclick: () => showTask(task.id), onfocus: () => (focused = task.id), ...own }, isRoom && task.id);
  });
  strip.ariaLabel = `Tasks from ${timeOf(first)} to ${timeOf(last)}`;
  draw(strip,
    known > first && h("div", { class: "unknown", style: `width: ${Math.min(100, x(known))}%` }, "not loaded"),
    h("div", {}, bars),
    h("div", { "aria-hidden": "true" }, ticksBetween(first, last, pixels).map((at) => h("span", { key: at, class: "tick", style: `left: ${x(at)}%` }, timeOf(at)))),
    present >= first && present <= last && h("div", { class: "now-line", style: `left: ${x(present)}%` }));
  const small = (words, label, act, isPressed) => button(words, act, { "aria-label": label, title: label, "aria-pressed": isPressed });
  draw(place,
    h("div", { class: "timeline-head" },
      h("select", { "aria-label": "Length of the time line", onchange: (event) => take(Number(event.target.value)), value: span }, LENGTHS.map((seconds) => h("option", { value: seconds }, SPANS[seconds]))),
      small("◀", "Earlier", () => move(-1)), small("Now", "Follow the present", () => moveTo(null), String(middle === null)), small("▶", "Later", () => move(1)),
      h("span", { class: "why" }, `${timeOf(first)} – ${timeOf(last)}`)),
    strip);
}

/** The times to write below the line. */
function ticksBetween(first, last, pixels) {
  if (!pixels) return [];
  const tick = TICKS.find((each) => each * pixels >= ROOM) ?? TICKS.at(-1);
  const edge = ROOM / 2 / pixels;
  const shift = new Date(first * 1000).getTimezoneOffset() * 60; // whole hours of the clock on the wall
  const begins = Math.ceil((first + edge - shift) / tick) * tick + shift;
  const count = Math.floor((last - edge - begins) / tick) + 1;
  return Array.from({ length: Math.max(0, count) }, (_, n) => begins + n * tick);
}

place.addEventListener("keydown", onKey);
strip.addEventListener("wheel", onWheel, { passive: false });
strip.addEventListener("pointerdown", onPointer);
take(Number(kept["mav-tasks time line"]));
onChange(["queues", "chosen", "clock", "whole", "past"], drawAll);
