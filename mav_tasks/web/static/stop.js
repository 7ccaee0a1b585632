// STOP: always in reach, at once, without a question, also while the event stream is down.

import { Problem, post } from "./api.js";
import { h, say, show } from "./dom.js";
import { onChange, state } from "./store.js";
import { quick } from "./words.js";

const all = document.getElementById("stop-all");
const one = document.getElementById("stop-one");
const outcome = document.getElementById("stop-outcome");
const SHOWN = 30; // s

let failure = "";

export function begin() {
  press(all, () => null);
  press(one, () => state.chosen);
  document.addEventListener("keydown", (event) => {
    const isTyping = event.target instanceof HTMLElement && event.target.closest("input, textarea, select");
    if (event.key === "S" && event.shiftKey && !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping) {
      event.preventDefault();
      stop(null);
    }
  });
  onChange((names) => {
    if (names.has("chosen") || names.has("vehicles")) drawOne();
    if (names.has("stops") || names.has("clock")) draw();
  });
}

/** A button that stops a rover, for its card. */
export function stopButton(vehicle) {
  const button = h("button", { class: "small stop-small", type: "button", "aria-label": `STOP rover ${vehicle}` }, "STOP");
  press(button, () => vehicle);
  return button;
}

/** Stop a rover, null: all. */
export async function stop(vehicle) {
  failure = "";
  say(outcome, "STOP sent…");
  for (;;) {
    try {
      await post("/stop", { vehicle }, { within: 6000 });
      return;
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      const isGone = error.status === 0;
      failure = `STOP not acknowledged: ${error.message}.${isGone ? " Trying again. Use the rover's own switch." : ""}`;
      draw();
      if (!isGone) return;
      await new Promise((resolve) => setTimeout(resolve, 500));
    }
  }
}

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
  const last = state.stops[state.stops.length - 1];
  if (failure) return say(outcome, failure);
  if (!last || Date.now() / 1000 - last.at > SHOWN) return say(outcome, "");
  say(outcome, outcomeWords(last));
}

/** "STOP: acknowledged 34 ms · standing 0.8 s" */
export function outcomeWords(stop) {
  const who = stop.vehicle === null ? "STOP" : `STOP ${stop.vehicle}`;
  if (stop.phase === "refused" || stop.phase === "unanswered") return `${who} ${stop.phase}: ${stop.detail}`;
  const parts = [];
  if (stop.acknowledged_after === null) parts.push("sent…");
  else parts.push(`acknowledged ${quick(stop.acknowledged_after)}`);
  if (stop.standing_after !== null) parts.push(`standing ${quick(stop.standing_after)}`);
  else if (stop.detail) parts.push(stop.detail);
  if (stop.tasks.length) parts.push(`ended task${stop.tasks.length > 1 ? "s" : ""} ${stop.tasks.join(", ")}`);
  return `${who}: ${parts.join(" · ")}`;
}
