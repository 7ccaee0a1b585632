// Begins everything, STOP first: whatever fails after it, it works. Tabs, views and permalinks.

import "./stop.js";
import "./rovers.js";
import "./queue.js";
import "./past.js";
import "./records.js";
import "./texts.js";
import "./timeline.js";
import "./connection.js";
import { draw, h } from "./dom.js";
import { change, onChange, showPath, showTask, state } from "./store.js";

const TABS = { queue: "Queue", past: "Past", records: "Recorded", texts: "Texts" };
const VIEWS = { rovers: "Rovers", map: "Map", side: "Tasks" }; // on a phone, one at a time
onChange(["session"], drawTabs);
drawTabs();
drawViews();
addEventListener("popstate", showPath);

function drawViews() {
  draw(document.querySelector(".views"), Object.entries(VIEWS).map(([name, words]) => h("button", {
    key: name, type: "button", "data-show": name, "aria-pressed": String(name === document.body.dataset.view), onclick: () => {
      document.body.dataset.view = name;
      drawViews();
    },
  }, words)));
}

function drawTabs() {
  const all = Object.keys(TABS).filter((name) => name !== "records" || state.session?.records);
  if (!all.includes(state.tab)) return choose("queue");
  const onkeydown = ({ key }) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[key];
    if (!by) return;
    choose(all.at((all.indexOf(state.tab) + by) % all.length));
    document.getElementById(`tab-${state.tab}`).focus();
  };
  draw(document.getElementById("tabs"), all.map((name) => h("button", {
    key: name, id: `tab-${name}`, type: "button", role: "tab", "aria-controls": `panel-${name}`, onclick: () => choose(name), onkeydown,
    "aria-selected": String(name === state.tab), tabindex: name === state.tab ? 0 : -1,
  }, TABS[name])));
  for (const name of Object.keys(TABS)) document.getElementById(`panel-${name}`).hidden = name !== state.tab;
}

function choose(tab) {
  showTask(null);
  state.tab = tab;
  change("tab");
  drawTabs();
}
