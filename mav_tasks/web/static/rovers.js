// The cards of the rovers: state, who has control, how old the data are, in words when something is wrong.

import * as acts from "./acts.js";
import { button, draw, failureLine, h } from "./dom.js";
import { stopButton } from "./stop.js";
import { ageOf, choose, onChange, state } from "./store.js";
import { duration } from "./words.js";

const list = document.getElementById("rovers");
const OLD = 3; // s; data of a rover that is heard come several times a second
const LOW = 20; // percent
const MANY = 6; // rovers; beyond that only the chosen one shows all its facts
const failures = new Map();

onChange(["vehicles", "queues", "chosen", "clock", "server", "whole", "session"], drawAll);

function drawAll() {
  const rovers = [...state.vehicles.values()].sort((a, b) => a.vehicle - b.vehicle);
  const none = state.stream === "open" ? "No rover yet: the task server has not heard one. Is a rover on and connected?" : "Connecting…";
  draw(document.getElementById("no-rovers"), !rovers.length && none);
  list.classList.toggle("many", rovers.length > MANY);
  draw(list, rovers.map(card));
}

function card(rover) {
  const { vehicle: id, control } = rover;
  const queue = state.queues.get(id);
  const isChosen = state.chosen === id;
  const isWaiting = control !== "tasks" || queue?.current?.state === "held";
  const mood = isCutOff() ? "" : ["silent", "stopped"].includes(control) ? "bad" : isWaiting ? "warn" : "";
  const checks = !rover.prearm.length && rover.ready === false && !rover.armed ? ["Its checks before arming fail."] : rover.prearm;
  const failure = failures.get(id) ?? failures.set(id, failureLine()).get(id);
  const place = control === "silent" ? "silent" : control === "tasks" && rover.ready !== false ? "" : "trouble";
  return h("li", { key: id, class: `card ${place}${isChosen ? " chosen" : ""}${isCutOff() || !rover.heard ? " old" : ""}` },
    h("div", { class: "head" },
      h("button", { class: "pick", type: "button", "aria-pressed": String(isChosen), onclick: () => choose(id) }, `Rover ${id}`),
      acts.resumeButton(queue),
      queue && !queue.paused && button("Pause", () => failure.trying(() => acts.pause(id))),
      stopButton(id)),
    h("p", { class: "facts facts-more" }, partsOf(factsOf(rover))),
    h("p", { class: "facts facts-more" }, partsOf(agesOf(rover, queue))),
    h("p", { class: `says ${mood}` }, acts.forMe(isCutOff() ? lastWords(rover, queue) : doesWords(rover, queue))),
    checks.length > 0 && h("ul", { class: "says warn" }, checks.map((words) => h("li", { key: words }, words))),
    failure.element);
}

/** Parts that follow each other, each of which stays on one line. */
const partsOf = (parts) => parts.filter(Boolean).map((part) => h("span", { class: "part" }, part));

// nothing newer comes: what a card says may have changed
const isCutOff = () => state.stream !== "open" || !state.server.reachable;

// a rover that seems silent may be so only because the connection is lost
function lastWords(rover, queue) {
  if (rover.control === "silent") return "What it does now is not known: the connection is lost.";
  return `Before the connection was lost: ${doesWords(rover, queue)}`;
}

function factsOf({ kind, mode, armed, speed, battery }) {
  const { percent, voltage } = battery ?? { percent: null, voltage: null };
  return [
    kind, mode, armed === null ? "arming unknown" : armed ? "armed" : "disarmed",
    speed !== null && `${speed.toFixed(1)} m/s`,
    percent !== null ? `battery ${percent} %${percent < LOW ? ", low" : ""}` : voltage !== null && `battery ${voltage.toFixed(1)} V`,
  ];
}

function agesOf(rover, queue) {
  const [link, data] = [ageOf(rover, "heartbeat_age"), ageOf(rover, "data_age")];
  return [
    isCutOff() ? "link unknown" : link === null ? "not heard since the server started" : link < OLD ? "link good" : `not heard for ${duration(link)}`,
    data === null ? "no position" : data < OLD ? `position ${data < 1 ? "< 1" : Math.round(data)} s old` : `position is ${duration(data)} old`,
    queue?.gateway && `gateway ${queue.gateway}`,
  ];
}

function doesWords(rover, queue) {
  const current = queue?.current;
  if (rover.control !== "tasks" || !queue || current?.state === "held") return rover.control_words;
  if (!current) return queue.waiting_count ? rover.control_words : "Stands ready; no task waits.";
  return `${current.state}: ${current.label ? `“${current.label}”, ` : ""}${current.what}`;
}
