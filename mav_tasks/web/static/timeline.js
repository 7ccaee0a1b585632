// The time line of the chosen rover: past tasks, the present one, what comes.

import { h, reconcile, say } from "./dom.js";
import { tasks as pastTasks } from "./past.js";
import { chosenQueue, onChange, serverNow } from "./store.js";
import { showTask } from "./routes.js";
import { taskName } from "./words.js";

const place = document.getElementById("timeline");
const line = h("div", { class: "now-line" });
const bars = h("div", {});
const ticks = h("div", { "aria-hidden": "true" });
const BEFORE = 300; // s
const AHEAD = 300;
const TICKS = [60, 120, 300]; // s between two times; the first for which there is room
const ROOM = 58; // px for a time
const SHORTEST = 5; // s

export function begin() {
  place.append(bars, ticks, line);
  document.addEventListener("past", draw);
  onChange((names) => {
    if (["queues", "chosen", "clock", "whole"].some((name) => names.has(name))) draw();
  });
}

function draw() {
  const now = serverNow();
  const queue = chosenQueue();
  const shown = [];
  for (const task of queue ? pastTasks : []) {
    if (task.vehicle !== queue.vehicle || !task.endedAt || now - task.endedAt > BEFORE) continue;
    shown.push({ task, from: task.endedAt - Math.max(task.execution_time ?? 0, SHORTEST), to: task.endedAt, kind: task.state });
  }
  if (queue) {
    let from = now;
    const { current, waiting } = queue;
    if (current) {
      const end = now + (current.time_to_finish ?? 60);
      shown.push({ task: current, from: now - (current.execution_time ?? 0), to: end, kind: "now" });
      from = end;
    }
    for (const task of waiting) {
      if (task.time_to_start === null && task.time_to_finish === null) continue;
      const begins = task.time_to_start === null ? from : now + task.time_to_start;
      const ends = task.time_to_finish === null ? begins + 30 : now + task.time_to_finish;
      if (begins - now > AHEAD) continue;
      shown.push({ task, from: begins, to: Math.max(ends, begins + SHORTEST), kind: "waiting" });
    }
  }
  const x = (at) => (100 * (at - now + BEFORE)) / (BEFORE + AHEAD);
  reconcile(bars, shown, ({ task }) => task.id, ({ task }) => {
    const element = h("button", { type: "button", class: "bar", onclick: () => showTask(task.id) });
    return {
      element,
      update: (bar) => {
        const left = Math.max(0, x(bar.from));
        element.style.left = `${left}%`;
        element.style.width = `${Math.max(0.4, Math.min(100, x(bar.to)) - left)}%`;
        const name = `bar ${bar.kind}`;
        if (element.className !== name) element.className = name;
        // a number that does not fit would lie on the next one's
        const width = (x(bar.to) - left) * place.clientWidth / 100;
        say(element, width > 8 * String(bar.task.id).length + 8 ? `${bar.task.id}` : "");
        element.title = `${taskName(bar.task)}: ${bar.task.state}`;
        element.setAttribute("aria-label", element.title);
      },
    };
  });
  line.style.left = `${x(now)}%`;
  const pixels = place.clientWidth / (BEFORE + AHEAD); // of a second
  const tick = TICKS.find((each) => each * pixels >= ROOM) ?? TICKS[TICKS.length - 1];
  const edge = ROOM / 2 / pixels;
  const first = Math.ceil((now - BEFORE + edge) / tick) * tick;
  const count = pixels ? Math.floor((now + AHEAD - edge - first) / tick) + 1 : 0;
  const marks = Array.from({ length: Math.max(0, count) }, (_, n) => first + n * tick);
  reconcile(ticks, marks, (at) => at, (at) => ({
    element: h("span", { class: "tick" }, new Date(at * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" })),
    update() {},
  }));
  for (const [at, row] of ticks._rows) row.element.style.left = `${x(at)}%`;
}
