// The connection to the web process: the session (who I am, what is offered), then the event stream, which the browser
// opens again by itself and resumes where it was. After a loss another process may answer: the session is read again.

import { failureWords, get, post, sentence } from "./api.js";
import { ask } from "./dialogs.js";
import { button, draw, h } from "./dom.js";
import { begin as beginMap } from "./map.js";
import { change, now, onChange, showPath, state, takeQueue, takeQueueChange, takeStop, takeTask, takeTexts, takeVehicles } from "./store.js";
import { duration } from "./words.js";

const SILENT = 15; // s; the web process sends something every 10 s
const AGAIN = 3000; // ms

const link = document.getElementById("link");
let source = null;
let triedAt = 0; // when the stream was opened
let first = null; // session of the process that this page came from

async function start() {
  try {
    await readSession();
  } catch (problem) {
    if (problem.status === 401) return logIn();
    if (!state.session) draw(link, h("span", { class: "bad" }, failureWords(problem)));
    setTimeout(start, AGAIN);
    return;
  }
  if (!source) {
    await import("/static/leaflet/leaflet.js"); // not before the page shows rovers and STOP
    beginMap();
    showPath();
    onChange(["server", "clock", "session", "whole"], drawLink);
    setInterval(watch, 1000);
  }
  change("session", "whole", "vehicles", "queues", "chosen", "texts");
  open();
}

function logIn() {
  ask({
    title: "Log in", word: "Log in", isNeeded: true,
    words: ["This page needs a token. An administrator makes one with: mav-tasks keys add NAME --role operator"],
    fields: [
      h("input", { class: "quiet", type: "text", name: "username", autocomplete: "username", tabindex: -1, "aria-hidden": "true" }),
      h("label", { class: "fields" }, "Token", h("input", { name: "token", type: "password", autocomplete: "current-password", required: true })),
    ],
    act: async (form) => {
      await post("/session", { token: form.elements.token.value.trim() });
      setTimeout(start);
    },
  });
}

async function readSession() {
  const session = await get("/session");
  first ??= session;
  if (JSON.stringify(session) === JSON.stringify(state.session)) return;
  state.session = session;
  change("session");
}

function open() {
  source?.close();
  triedAt = now();
  source = new EventSource("/api/v1/events");
  for (const [kind, take] of Object.entries(TAKES)) {
    source.addEventListener(kind, (event) => {
      heard();
      take(JSON.parse(event.data));
    });
  }
  source.onopen = heard;
  source.onerror = () => {
    lose();
    if (source.readyState === EventSource.CLOSED) setTimeout(start, AGAIN); // else it tries again by itself
  };
}

const TAKES = {
  snapshot: (all) => {
    for (const known of [state.vehicles, state.queues]) known.clear();
    Object.assign(state, { texts: [], areTextsWhole: false, stops: [], server: { reachable: all.reachable, detail: all.detail } });
    if (state.one) state.one.version = 0; // another server may count from the beginning
    for (const stop of all.stops) takeStop(stop, all.now - stop.at);
    takeVehicles(all);
    all.queues.forEach(takeQueue);
    takeTexts(all.texts);
    change("stops", "server", "tasks", "whole");
  },
  vehicles: takeVehicles,
  queue: takeQueueChange,
  task: takeTask,
  text: (text) => takeTexts([text]),
  stop: takeStop,
  alive: () => {}, // nothing happened, but the stream is alive
  server: (server) => {
    state.server = server;
    change("server");
  },
};

// does the stream still bring something? One that never answers is opened again, too
function watch() {
  const isTrying = source.readyState !== EventSource.CLOSED; // else it waits for a token, or to try again
  if (isTrying && now() - Math.max(state.heardAt, triedAt) > SILENT) {
    lose();
    open();
  }
  change("clock");
}

// another web process may answer now
const renewSession = () => readSession().catch((problem) => (problem.status === 401 ? logIn() : setTimeout(renewSession, AGAIN)));

function heard() {
  state.heardAt = now();
  if (state.stream === "open") return;
  if (state.stream === "lost") renewSession();
  state.stream = "open";
  change("server");
}

// a page begins without an alarm: what is not open yet is not lost
function lose() {
  if (state.stream === "lost") return;
  state.stream = "lost";
  change("server");
}

function drawLink() {
  const { session, server, stream, heardAt } = state;
  let trouble = "";
  if (stream === "lost") trouble = "The connection to the web process is lost; trying again. STOP is still sent when you press it.";
  else if (!server.reachable) trouble = `${sentence(server.detail)}${/[.?!]$/.test(server.detail) ? "" : "."} What you see may be old.`;
  const age = stream === "lost" && heardAt ? `What you see is ${duration(now() - heardAt)} old.` : "";
  draw(document.getElementById("banner"), trouble && [h("span", { role: "alert" }, trouble), " ", h("span", {}, age)]);
  const who = [session.name, session.role].filter(Boolean).join(", ");
  draw(link, trouble ? h("span", { class: "bad" }, "no connection") : stream === "open" ? `connected · you: ${who}` : "connecting…");
  drawNews(session);
}

// what this page cannot take over: its files are those of the first process, and so are the hosts that it may ask
function drawNews({ version, tiles }) {
  const news = [
    version !== first.version && `The web process has version ${version} now, this page has version ${first.version}.`,
    JSON.stringify(tiles) !== JSON.stringify(first.tiles) && "The web process has other map tiles now.",
  ].filter(Boolean);
  if (news.length) news.push("To use what is new, load this page again; what you have typed into it is lost.");
  draw(document.getElementById("news"), h("span", { role: "status" }, news.join(" ")), news.length > 0 && button("Load again", () => location.reload()));
}

start();
