// Begins everything: the rovers and STOP at once, the rest once it is known who I am; tabs and views.

import { connect } from "./connection.js";
import * as map from "./map.js";
import * as past from "./past.js";
import * as queue from "./queue.js";
import * as records from "./records.js";
import * as routes from "./routes.js";
import * as rovers from "./rovers.js";
import * as stop from "./stop.js";
import { change, state } from "./store.js";
import * as texts from "./texts.js";
import * as timeline from "./timeline.js";

stop.begin();
rovers.begin();
tabs();
views();
connect(async () => {
  await leaflet();
  for (const part of [map, queue, past, records, texts, timeline, routes]) part.begin();
});

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

function tabs() {
  const all = [...document.querySelectorAll("[role=tab]")];
  const choose = (tab) => {
    for (const each of all) {
      const isChosen = each === tab;
      each.ariaSelected = String(isChosen);
      each.tabIndex = isChosen ? 0 : -1;
      document.getElementById(each.getAttribute("aria-controls")).hidden = !isChosen;
    }
    routes.showTask(null);
    state.tab = tab.id;
    change("tab");
  };
  for (const tab of all) {
    tab.onclick = () => choose(tab);
    tab.onkeydown = ({ key }) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
      if (!step) return;
      const there = all.filter((each) => !each.hidden);
      const next = there.at((there.indexOf(tab) + step) % there.length);
      choose(next);
      next.focus();
    };
  }
}

function views() {
  const all = document.querySelectorAll("[data-show]");
  for (const button of all) {
    button.onclick = () => {
      document.body.dataset.view = button.dataset.show;
      for (const each of all) each.ariaPressed = String(each === button);
    };
  }
}
