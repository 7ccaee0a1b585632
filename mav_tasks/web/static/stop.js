// STOP: always in reach, at once, without a question, also while the event stream is down.

import { Problem, post } from "./api.js";
import { button, draw, h } from "./dom.js";
import { now, onChange, state, takeStop } from "./store.js";
import { joined, quick } from "./words.js";

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
let pressed = null; // the button below a finger

Object.assign(document.getElementById("stop-all"), pressing(() => null));
Object.assign(document.getElementById("stop-one"), pressing(() => state.chosen));
document.addEventListener("keydown", (event) => {
  const isTyping = event.target instanceof HTMLElement && event.target.matches(WITH_LETTERS);
  // with Caps Lock, Shift makes it small
  if (event.key.toUpperCase() === "S" && event.shiftKey && !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping) {
    event.preventDefault();
    if (!event.repeat) stop(null);
  }
});
onChange(["stops", "clock", "queues", "vehicles", "chosen"], drawAll);

/** A button that stops a rover, for its card. */
export const stopButton = (vehicle) => button("STOP", undefined, { class: "small stop-small", "aria-label": `STOP rover ${vehicle}`, ...pressing(() => vehicle) });

/** Stop a rover, null: all. */
async function stop(vehicle) {
  const mine = { words: `${nameOf(vehicle)}: sent…`, isFailure: false };
  tries.set(vehicle, mine); // a second press takes over from the first
  drawAll();
  for (let count = 1; tries.get(vehicle) === mine; count += 1) {
    try {
      const done = await post("/stop", { vehicle }, { within: 6000 });
      if (tries.get(vehicle) === mine) tries.delete(vehicle);
      takeStop(done); // the event stream may be down
      return drawAll();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      const isFinal = FINAL.has(error.status);
      const next = isFinal ? "" : "Trying again. Use the rover's own switch.";
      mine.words = `${nameOf(vehicle)} not acknowledged: ${error.message.replace(/^STOP: /, "").replace(/\.$/, "")}. ${next}`;
      mine.isFailure = true;
      drawAll();
      if (isFinal) return;
      await new Promise((resolve) => setTimeout(resolve, count < SOON ? AGAIN : LATER));
    }
  }
}

const nameOf = (vehicle) => (vehicle === null ? "STOP" : `STOP ${vehicle}`);

// on pressing, not on letting go; a click without a press comes from a keyboard or a screen reader
function pressing(whom) {
  const lift = () => (pressed = null);
  return {
    onpointerdown: (event) => {
      if (event.button !== 0) return;
      pressed = event.currentTarget;
      stop(whom());
    },
    onclick: (event) => {
      if (pressed !== event.currentTarget) stop(whom());
      pressed = null;
    },
    onpointercancel: lift,
    onpointerleave: lift,
  };
}

function drawAll() {
  const one = document.getElementById("stop-one");
  one.hidden = state.chosen === null || state.vehicles.size < 2;
  draw(one, `STOP ${state.chosen}`);
  for (const [vehicle, each] of tries) if (each.isFailure && wasStoppedSince(vehicle, each)) tries.delete(vehicle);
  const lines = [...tries].map(([vehicle, each]) => ({ key: `of ${vehicle}`, ...each }));
  // what this page tries is told above, until it is acknowledged
  const recent = state.stops.filter((each) => now() - each.takenAt < SHOWN && holds(each) && (each.acknowledged_after !== null || !tries.has(each.vehicle)));
  for (const each of recent.slice(-LINES)) lines.push({ key: each.number, words: outcomeWords(each), isFailure: isLost(each) });
  draw(document.getElementById("stop-outcome"), lines.slice(-LINES - 1).map(({ key, words, isFailure }) => h("span", { key, class: isFailure && "bad" }, words)));
}

const isLost = ({ phase }) => ["refused", "unanswered"].includes(phase);

// a result is told as long as it is true: not after a resume, nor is a rover known to stand that is lost
function holds(stop) {
  if (isLost(stop) || now() - stop.takenAt < FRESH) return true;
  return [...state.vehicles.values()].some((each) => [null, each.vehicle].includes(stop.vehicle) && (each.heard || stop.standing_after === null)
    && state.queues.get(each.vehicle)?.paused === "stopped");
}

// a later STOP that was acknowledged, of this page or another one, makes a failure history
function wasStoppedSince(vehicle, tried) {
  tried.at ??= now();
  return state.stops.some((each) => each.acknowledged_after !== null && each.takenAt > tried.at && (each.vehicle === null || each.vehicle === vehicle));
}

/** "STOP: acknowledged 34 ms · standing 0.8 s" */
function outcomeWords(stop) {
  const { acknowledged_after: acknowledged, standing_after: standing, detail, tasks } = stop;
  const isMine = !state.session || stop.by === state.session.name;
  const who = `${nameOf(stop.vehicle)}${isMine ? "" : ` by ${stop.by}`}`;
  if (isLost(stop)) return `${who} ${stop.phase}: ${detail}`;
  return `${who}: ${joined(
    acknowledged === null ? "sent…" : `acknowledged ${quick(acknowledged)}`,
    standing === null ? detail : `standing ${standing.toFixed(1)} s`,
    tasks.length > 0 && `ended task${tasks.length > 1 ? "s" : ""} ${tasks.join(", ")}`,
  )}`;
}
