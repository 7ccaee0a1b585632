// STOP: always in reach, at once, without a question, also while the event stream is down.

import { Problem, post } from "./api.js";
import { h, reconcile, say, show } from "./dom.js";
import { now, onChange, state, takeStop } from "./store.js";
import { quick } from "./words.js";

const all = document.getElementById("stop-all");
const one = document.getElementById("stop-one");
const outcome = document.getElementById("stop-outcome");
const SHOWN = 30; // s
const FRESH = 3; // s until the queues show a STOP

// the same request would get the same answer; but a rover that is silent or unknown may soon be heard
const FINAL = new Set([400, 401, 403, 415, 422]);
const AGAIN = 500; // ms
const LATER = 3000; // ms, after SOON tries
const SOON = 20;
// where an S is a letter of a word; not in a field for a number or in a list
const WITH_LETTERS = "textarea, input[type=search], input[type=password], input[type=text], input:not([type])";
const LINES = 2; // outcomes shown at once

/** What was pressed and is not acknowledged yet, in words; by rover, null: all. @type {Map<number|null, {words: string, isFailure: boolean}>} */
const tries = new Map();

export function begin() {
  press(all, () => null);
  press(one, () => state.chosen);
  document.addEventListener("keydown", (event) => {
    const isTyping = event.target instanceof HTMLElement && event.target.matches(WITH_LETTERS);
    // with Caps Lock, Shift makes it small
    if (event.key.toUpperCase() === "S" && event.shiftKey && !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping) {
      event.preventDefault();
      if (!event.repeat) stop(null);
    }
  });
  onChange(["chosen", "vehicles"], drawOne);
  onChange(["stops", "clock", "queues", "vehicles"], draw);
}

/** A button that stops a rover, for its card. */
export function stopButton(vehicle) {
  const button = h("button", { class: "small stop-small", type: "button", "aria-label": `STOP rover ${vehicle}` }, "STOP");
  press(button, () => vehicle);
  return button;
}

/** Stop a rover, null: all. */
export async function stop(vehicle) {
  const mine = { words: `${nameOf(vehicle)}: sent…`, isFailure: false };
  tries.set(vehicle, mine); // a second press takes over from the first
  draw();
  for (let count = 1; tries.get(vehicle) === mine; count += 1) {
    try {
      const done = await post("/stop", { vehicle }, { within: 6000 });
      if (tries.get(vehicle) === mine) tries.delete(vehicle);
      takeStop(done); // the event stream may be down
      return draw();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      const isFinal = FINAL.has(error.status);
      const next = isFinal ? "" : "Trying again. Use the rover's own switch.";
      mine.words = `${nameOf(vehicle)} not acknowledged: ${error.message.replace(/^STOP: /, "").replace(/\.$/, "")}. ${next}`;
      mine.isFailure = true;
      draw();
      if (isFinal) return;
      await new Promise((resolve) => setTimeout(resolve, count < SOON ? AGAIN : LATER));
    }
  }
}

const nameOf = (vehicle) => (vehicle === null ? "STOP" : `STOP ${vehicle}`);

// on pressing, not on letting go; a click without a press comes from a keyboard or a screen reader
function press(button, whom) {
  let isPressed = false;
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    isPressed = true;
    stop(whom());
  });
  button.addEventListener("click", () => {
    if (!isPressed) stop(whom());
    isPressed = false;
  });
  for (const end of ["pointercancel", "pointerleave"]) button.addEventListener(end, () => (isPressed = false));
}

function drawOne() {
  const isShown = state.chosen !== null && state.vehicles.size > 1;
  show(one, isShown);
  if (isShown) say(one, `STOP ${state.chosen}`);
}

function draw() {
  for (const [vehicle, each] of tries) if (each.isFailure && wasStoppedSince(vehicle, each)) tries.delete(vehicle);
  const lines = [...tries].map(([vehicle, each]) => ({ key: `of ${vehicle}`, words: each.words, isFailure: each.isFailure }));
  // what this page tries is told above, until it is acknowledged
  const recent = state.stops.filter((each) => now() - each.takenAt < SHOWN && holds(each) && (each.acknowledged_after !== null || !tries.has(each.vehicle)));
  for (const each of recent.slice(-LINES)) lines.push({ key: each.number, words: outcomeWords(each), isFailure: ["refused", "unanswered"].includes(each.phase) });
  reconcile(outcome, lines.slice(-LINES - 1), (line) => line.key, () => {
    const element = h("span", {});
    const update = (line) => {
      say(element, line.words);
      element.className = line.isFailure ? "bad" : "";
    };
    return { element, update };
  });
}

// a result is told as long as it is true: not after a resume, nor is a rover known to stand that is lost
function holds(stop) {
  if (["refused", "unanswered"].includes(stop.phase) || now() - stop.takenAt < FRESH) return true;
  return [...state.vehicles.values()].some((each) => [null, each.vehicle].includes(stop.vehicle) && (each.heard || stop.standing_after === null)
    && state.queues.get(each.vehicle)?.paused === "stopped");
}

// a later STOP that was acknowledged, of this page or another one, makes a failure history
function wasStoppedSince(vehicle, tried) {
  tried.at ??= now();
  return state.stops.some((each) => each.acknowledged_after !== null && each.takenAt > tried.at && (each.vehicle === null || each.vehicle === vehicle));
}

/** "STOP: acknowledged 34 ms · standing 0.8 s" */
export function outcomeWords(stop) {
  const isMine = !state.session || stop.by === state.session.name;
  const who = `${nameOf(stop.vehicle)}${isMine ? "" : ` by ${stop.by}`}`;
  if (stop.phase === "refused" || stop.phase === "unanswered") return `${who} ${stop.phase}: ${stop.detail}`;
  const parts = [];
  if (stop.acknowledged_after === null) parts.push("sent…");
  else parts.push(`acknowledged ${quick(stop.acknowledged_after)}`);
  if (stop.standing_after !== null) parts.push(`standing ${stop.standing_after.toFixed(1)} s`);
  else if (stop.detail) parts.push(stop.detail);
  if (stop.tasks.length) parts.push(`ended task${stop.tasks.length > 1 ? "s" : ""} ${stop.tasks.join(", ")}`);
  return `${who}: ${parts.join(" · ")}`;
}
