// The event stream: the browser reconnects by itself, and resumes where it was.

import { get } from "./api.js";
import * as session from "./session.js";
import { change, now, state, takeClock, takeQueue, takeQueueChange, takeStop, takeTask, takeTexts, takeVehicles } from "./store.js";

const SILENT = 15; // s; the web process sends something every 10 s
const AGAIN = 3000; // ms

let source = null;
let timer = 0;
let triedAt = 0; // when the stream was opened
let isSessionOld = false; // the stream was lost: another web process may answer now

/** Open the stream. "onRefused" is called if the web process wants a token. */
export function open(onRefused) {
  clearTimeout(timer);
  if (source) source.close();
  triedAt = now();
  source = new EventSource("/api/v1/events");
  const on = (kind, take) => source.addEventListener(kind, (event) => {
    heard();
    take(JSON.parse(event.data));
  });
  on("snapshot", (all) => {
    state.vehicles.clear();
    state.queues.clear();
    state.tasks.clear();
    state.texts.length = 0;
    state.areTextsWhole = false;
    takeClock(all.now);
    state.stops = [];
    for (const stop of all.stops) takeStop(stop, all.now - stop.at);
    state.server = { reachable: all.reachable, detail: all.detail ?? null };
    takeVehicles(all.vehicles);
    all.queues.forEach(takeQueue);
    takeTexts(all.texts);
    change("stops", "server", "tasks", "whole");
  });
  on("vehicles", (news) => {
    takeClock(news.now);
    takeVehicles(news.vehicles);
  });
  on("queue", takeQueueChange);
  on("task", takeTask);
  on("text", (text) => takeTexts([text]));
  on("stop", takeStop);
  on("alive", () => {}); // nothing happened, but the stream is alive
  on("server", (server) => {
    state.server = server;
    change("server");
  });
  source.onopen = () => {
    heard();
    readSession(onRefused);
  };
  source.onerror = () => {
    lose();
    if (source.readyState !== EventSource.CLOSED) return; // it tries again by itself
    get("/session").then(
      () => retry(onRefused),
      (problem) => (problem.status === 401 ? onRefused() : retry(onRefused)),
    );
  };
}

/** Look whether the stream still brings something; one that never answers is opened again, too. */
export function watch(onRefused) {
  setInterval(() => {
    const isTrying = source.readyState !== EventSource.CLOSED; // else it waits for a token, or to try again
    if (isTrying && now() - Math.max(state.stream.heardAt, triedAt) > SILENT) {
      lose();
      open(onRefused);
    }
    if (state.stream.isOpen) readSession(onRefused); // if it could not be read before
    change("clock");
  }, 1000);
}

function retry(onRefused) {
  clearTimeout(timer);
  timer = setTimeout(() => open(onRefused), AGAIN);
}

async function readSession(onRefused) {
  if (!isSessionOld) return;
  isSessionOld = false;
  try {
    await session.read();
  } catch (problem) {
    isSessionOld = true;
    if (problem.status === 401) onRefused();
  }
}

function heard() {
  state.stream.heardAt = now();
  if (state.stream.isOpen) return;
  state.stream.isOpen = true;
  state.stream.isLost = false;
  change("server");
}

// a stream that is not open yet is not lost: the page does not begin with an alarm
function lose() {
  if (state.stream.isLost) return;
  state.stream.isOpen = false;
  state.stream.isLost = true;
  isSessionOld = true;
  change("server");
}
