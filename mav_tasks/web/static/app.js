// Begins everything: who am I, then the stream; tabs and views.

import { failureWords } from "./api.js";
import { say, show } from "./dom.js";
import { logIn } from "./login.js";
import * as map from "./map.js";
import * as past from "./past.js";
import * as queue from "./queue.js";
import * as records from "./records.js";
import * as routes from "./routes.js";
import * as rovers from "./rovers.js";
import * as session from "./session.js";
import * as stop from "./stop.js";
import { change, now, onChange, state } from "./store.js";
import * as stream from "./stream.js";
import * as texts from "./texts.js";
import * as timeline from "./timeline.js";
import { duration } from "./words.js";

const link = document.getElementById("link");
const banner = document.getElementById("banner");
const [bannerWords, bannerAge] = banner.children;
const AGAIN = 3000; // ms
let isBegun = false;

stop.begin();
rovers.begin();
tabs();
views();
drawLink();
onChange(["server", "clock", "session", "whole"], drawLink);
start();

async function start() {
  try {
    await session.read();
  } catch (error) {
    if (error.status === 401) return logIn(start);
    say(link, failureWords(error));
    link.className = "link bad";
    setTimeout(start, AGAIN);
    return;
  }
  if (!isBegun) {
    isBegun = true;
    await leaflet();
    map.begin();
    queue.begin();
    past.begin();
    records.begin();
    texts.begin();
    timeline.begin();
    routes.begin();
    stream.watch(refused);
  }
  change("session", "whole", "vehicles", "queues", "chosen", "texts");
  stream.open(refused);
}

const refused = () => logIn(start);

// the page shows rovers and STOP before the map's library has come
function leaflet() {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/static/leaflet/leaflet.js";
    script.onload = resolve;
    script.onerror = () => reject(new Error("leaflet.js did not load"));
    document.head.append(script);
  });
}

function drawLink() {
  let trouble = "";
  let age = "";
  if (state.session && state.stream.isLost) {
    if (state.stream.heardAt) age = `What you see is ${duration(now() - state.stream.heardAt)} old.`;
    trouble = "The connection to the web process is lost; trying again. STOP is still sent when you press it.";
  } else if (!state.server.reachable) {
    trouble = `${sentence(state.server.detail ?? "the task server does not answer")} What you see may be old.`;
  }
  say(bannerWords, trouble);
  say(bannerAge, age);
  show(banner, Boolean(trouble));
  if (!state.session) return;
  const who = [state.session.name, state.session.role].filter(Boolean).join(", ");
  say(link, trouble ? "no connection" : state.stream.isOpen ? `connected · you: ${who}` : "connecting…");
  link.className = trouble ? "link bad" : "link";
}

const sentence = (words) => `${words.charAt(0).toUpperCase()}${words.slice(1)}${/[.?!]$/.test(words) ? "" : "."}`;

function tabs() {
  const all = [...document.querySelectorAll("[role=tab]")];
  const choose = (tab) => {
    for (const each of all) {
      const isChosen = each === tab;
      each.setAttribute("aria-selected", String(isChosen));
      each.tabIndex = isChosen ? 0 : -1;
      document.getElementById(each.getAttribute("aria-controls")).hidden = !isChosen;
    }
    if (!isBegun) return;
    if (state.task !== null) routes.showTask(null);
    if (tab.id === "tab-texts") texts.shown();
    if (tab.id === "tab-records") records.shown();
    else records.left();
  };
  for (const [at, tab] of all.entries()) {
    tab.addEventListener("click", () => choose(tab));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: all.length - 1 }[event.key];
      if (!step) return;
      let next = all[(at + step) % all.length];
      if (next.hidden) next = all[(at + 2 * step) % all.length];
      choose(next);
      next.focus();
    });
  }
}

function views() {
  const buttons = [...document.querySelectorAll("[data-show]")];
  for (const button of buttons) {
    button.addEventListener("click", () => {
      document.body.dataset.view = button.dataset.show;
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === button));
    });
  }
  addEventListener("popstate", () => change("route"));
}
