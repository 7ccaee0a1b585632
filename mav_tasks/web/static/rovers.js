// The cards of the rovers: state, who has control, how old the data are, in words when something is wrong.

import * as acts from "./acts.js";
import { failureLine, h, reconcile, say, sayParts, show } from "./dom.js";
import { stopButton } from "./stop.js";
import { choose, dataAge, linkAge, onChange, state } from "./store.js";
import { duration } from "./words.js";

const list = document.getElementById("rovers");
const none = document.getElementById("no-rovers");
const OLD = 3; // s; data of a rover that is heard come several times a second
const LOW = 20; // percent
const MANY = 6; // rovers; beyond that only the chosen one shows all its facts

export function begin() {
  onChange(["vehicles", "queues", "chosen", "clock", "server", "whole", "session"], draw);
}

function draw() {
  const rovers = [...state.vehicles.values()].sort((a, b) => a.vehicle - b.vehicle);
  show(none, rovers.length === 0);
  if (!rovers.length) say(none, state.stream.isOpen ? "No rover yet: the task server has not heard one. Is a rover on and connected?" : "Connecting…");
  // ages change by themselves: each card is looked at again, and changes only what differs
  list.classList.toggle("many", rovers.length > MANY);
  reconcile(list, rovers.map((rover) => ({ rover })), ({ rover }) => rover.vehicle, make);
}

function make({ rover }) {
  const id = rover.vehicle;
  const pick = h("button", { class: "pick", type: "button", onclick: () => choose(id) }, `Rover ${id}`);
  const facts = h("p", { class: "facts facts-more" });
  const ages = h("p", { class: "facts facts-more" });
  const says = h("p", { class: "says" });
  const prearm = h("ul", { class: "says warn" });
  const failure = failureLine();
  const go = h("button", { class: "small main-word", type: "button", onclick: () => acts.resume(state.queues.get(id)) }, "Resume…");
  const pause = h("button", { class: "small", type: "button", onclick: () => failure.trying(() => acts.pause(id)) }, "Pause");
  const element = h("li", { class: "card" },
    h("div", { class: "head" }, pick, go, pause, stopButton(id)), facts, ages, says, prearm, failure.element);
  const update = ({ rover: shown }) => {
    const queue = state.queues.get(id);
    const isChosen = state.chosen === id;
    const trouble = shown.control === "silent" ? " silent" : shown.control === "tasks" && shown.ready !== false ? "" : " trouble";
    const name = `card${isChosen ? " chosen" : ""}${trouble}${isCutOff() || !shown.heard ? " old" : ""}`;
    if (element.className !== name) element.className = name;
    if (pick.getAttribute("aria-pressed") !== String(isChosen)) pick.setAttribute("aria-pressed", String(isChosen));
    sayParts(facts, factsOf(shown));
    sayParts(ages, agesOf(shown, queue));
    const isTrouble = shown.control !== "tasks" || (queue && queue.current && queue.current.state === "held");
    const mood = isCutOff() ? "says" : shown.control === "silent" || shown.control === "stopped" ? "says bad" : isTrouble ? "says warn" : "says";
    if (says.className !== mood) says.className = mood;
    say(says, acts.forMe(isCutOff() ? lastWords(shown, queue) : doesWords(shown, queue)));
    const checks = shown.prearm.length ? shown.prearm : shown.ready === false && !shown.armed ? ["Its checks before arming fail."] : [];
    reconcile(prearm, checks, (text) => text, (text) => ({ element: h("li", {}, text), update() {} }));
    show(prearm, checks.length > 0);
    show(go, Boolean(queue && queue.paused) && acts.may("resume"));
    show(pause, Boolean(queue && !queue.paused));
  };
  return { element, update };
}

// nothing newer comes: what a card says may have changed
const isCutOff = () => !state.stream.isOpen || !state.server.reachable;

// a rover that seems silent may be so only because the connection is lost
function lastWords(rover, queue) {
  if (rover.control === "silent") return "What it does now is not known: the connection is lost.";
  return `Before the connection was lost: ${doesWords(rover, queue)}`;
}

function factsOf(rover) {
  const parts = [rover.kind, rover.mode, rover.armed === null ? "arming unknown" : rover.armed ? "armed" : "disarmed"];
  if (rover.speed !== null) parts.push(`${rover.speed.toFixed(1)} m/s`);
  if (rover.battery) {
    const { percent, voltage } = rover.battery;
    if (percent !== null) parts.push(`battery ${percent} %${percent < LOW ? ", low" : ""}`);
    else if (voltage !== null) parts.push(`battery ${voltage.toFixed(1)} V`);
  }
  return parts;
}

function agesOf(rover, queue) {
  const link = linkAge(rover);
  const data = dataAge(rover);
  const parts = [isCutOff() ? "link unknown" : link === null ? "not heard since the server started" : link < OLD ? "link good" : `not heard for ${duration(link)}`];
  if (data === null) parts.push("no position");
  else parts.push(data < OLD ? `position ${data < 1 ? "< 1" : Math.round(data)} s old` : `position is ${duration(data)} old`);
  if (queue && queue.gateway) parts.push(`gateway ${queue.gateway}`);
  return parts;
}

function doesWords(rover, queue) {
  const current = queue && queue.current;
  if (rover.control !== "tasks" || !queue) return rover.control_words;
  if (!current) return queue.waiting_count ? rover.control_words : "Stands ready; no task waits.";
  if (current.state === "held") return rover.control_words;
  return `${current.state}: ${current.label ? `“${current.label}”, ` : ""}${current.what}`;
}
