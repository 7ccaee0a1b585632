// The event stream: the browser reconnects by itself, and resumes where it was.

import { get } from "./api.js";
import { change, now, state, takeClock, takeQueue, takeStop, takeTask, takeTexts, takeVehicles } from "./store.js";

const SILENT = 15; // s; the web process sends something every 10 s
const AGAIN = 3000; // ms

let source = null;
let timer = 0;

/** Open the stream. "onRefused" is called if the web process wants a token. */
export function open(onRefused) {
  clearTimeout(timer);
  if (source) source.close();
  source = new EventSource("/api/v1/events");
  const on = (kind, take) => source.addEventListener(kind, (event) => {
    heard(true);
    take(JSON.parse(event.data));
  });
  on("snapshot", (all) => {
    state.vehicles.clear();
    state.queues.clear();
    state.tasks.clear();
    state.texts.length = 0;
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
  on("queue", takeQueue);
  on("task", takeTask);
  on("text", (text) => takeTexts([text]));
  on("stop", takeStop);
  on("alive", () => {}); // nothing happened, but the stream is alive
  on("server", (server) => {
    state.server = server;
    change("server");
  });
  source.onopen = () => heard(true);
  source.onerror = () => {
    heard(false);
    if (source.readyState !== EventSource.CLOSED) return; // it tries again by itself
    get("/session").then(
      () => retry(onRefused),
      (problem) => (problem.status === 401 ? onRefused() : retry(onRefused)),
    );
  };
}

/** Look whether a stream that seems open still brings something. */
export function watch(onRefused) {
  setInterval(() => {
    if (state.stream.isOpen && now() - state.stream.heardAt > SILENT) {
      heard(false);
      open(onRefused);
    }
    change("clock");
  }, 1000);
}

function retry(onRefused) {
  clearTimeout(timer);
  timer = setTimeout(() => open(onRefused), AGAIN);
}

function heard(isOpen) {
  state.stream.heardAt = isOpen ? now() : state.stream.heardAt;
  if (state.stream.isOpen === isOpen) return;
  state.stream.isOpen = isOpen;
  change("server");
}
