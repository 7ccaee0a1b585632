// Texts of rovers and the server, and the journal, filtered.

import { get } from "./api.js";
import { button, draw, failureLine, h } from "./dom.js";
import { onChange, state } from "./store.js";
import { clock, counted, taskLink } from "./words.js";

const panel = document.getElementById("panel-texts");
const SHOWN = 300; // lines at first
const MORE = 200; // lines, and the least that is requested at a time
const KEPT = 2000; // texts that the web process has, and journal entries that it returns
const FILTERS = {
  From: { texts: "Texts", journal: "Journal" },
  Rover: { "": "all rovers", chosen: "the chosen rover" },
  Level: { 3: "errors and worse", 4: "warnings and worse", 6: "information and worse", 7: "all" },
};

const failure = failureLine();
const filters = { From: "texts", Rover: "", Level: "6", words: "" };
let journal = [];
let journalOf = null; // what it was requested for
let most = SHOWN;
let isAsking = false;
let said = "";

onChange(["texts", "chosen", "whole", "session", "tab"], drawAll);

const isJournal = () => filters.From === "journal";

function filter(name, value) {
  filters[name] = value;
  [most, said] = [SHOWN, ""];
  failure.tell("");
  if (name === "From") journalOf = null; // it is read again
  drawAll();
}

function loadJournal(wanted) {
  [journal, journalOf] = [[], wanted];
  failure.trying(async () => {
    const { entries } = await get(`/journal?limit=${KEPT}${wanted}`);
    if (journalOf !== wanted) return; // another rover was chosen meanwhile
    journal = entries.map(({ level, message, ...entry }) => ({ vehicle: null, ...entry, severity: { warning: 4, error: 3 }[level] ?? 6, words: message }));
    drawAll();
  });
}

/** The lines that the filters let pass, the oldest first. */
function matching() {
  const words = filters.words.trim().toLowerCase();
  return (isJournal() ? journal : state.texts).filter((line) => line.severity <= Number(filters.Level)
    && (!filters.Rover || line.vehicle === state.chosen || line.vehicle === null)
    && line.words.toLowerCase().includes(words));
}

// the filters hold for older lines, too: it asks on until some of them pass
async function showOlder() {
  if (isAsking) return;
  const before = matching().length;
  isAsking = true; // the button is not disabled: the keyboard stays on it
  drawAll();
  await failure.trying(async () => {
    while (!isJournal() && !state.areTextsWhole && matching().length < Math.min(most, before) + MORE) {
      const first = state.texts[0];
      const { texts } = await get(`/texts?before=${first.number}&limit=${MORE}`);
      if (state.texts[0] !== first) break; // the web process was started again meanwhile
      state.texts = [...texts, ...state.texts];
      state.areTextsWhole = texts.length < MORE || state.texts.length >= KEPT;
    }
    const added = Math.min(matching().length, most + MORE) - Math.min(before, most);
    most += MORE;
    said = added > 0 ? `${counted(added, "older line")} shown.` : "No older line fits these filters.";
  });
  isAsking = false;
  drawAll();
}

function drawAll() {
  if (panel.hidden) return;
  const hasJournal = state.session?.journal;
  if (!hasJournal) filters.From = "texts";
  const wanted = filters.Rover && state.chosen !== null ? `&vehicle=${state.chosen}` : "";
  if (isJournal() && journalOf !== wanted) loadJournal(wanted);
  const all = matching();
  const lines = all.slice(-most).reverse();
  const hasOlder = all.length > most || (!isJournal() && state.texts.length > 0 && !state.areTextsWhole);
  const none = hasOlder ? "No line of the latest ones fits these filters." : (isJournal() ? journal : state.texts).length ? "No line fits these filters." : "Nothing yet.";
  draw(panel,
    h("div", { class: "filters" },
      Object.entries(FILTERS).map(([name, choices]) => h("label", { key: name }, name, h("select", { onchange: (event) => filter(name, event.target.value), value: filters[name] },
        Object.entries(choices).map(([value, words]) => h("option", { key: value, value, disabled: value === "journal" && !hasJournal }, words))))),
      h("label", { key: "search" }, "Search", h("input", {
        type: "search", placeholder: "words or task number", "aria-label": "Show only lines with these words", oninput: (event) => filter("words", event.target.value),
      }))),
    h("ol", { class: "log", "aria-label": "Texts, the newest first", "aria-busy": String(isAsking) }, lines.map(row)),
    !lines.length && h("p", { class: "empty" }, none),
    h("p", { class: "said", role: "status" }, said),
    failure.element,
    hasOlder && button("Older", showOlder));
}

function row({ number, at, vehicle, severity, words }) {
  const mood = severity <= 3 ? "bad" : severity === 4 ? "warn" : "";
  const sender = vehicle === null || isJournal() ? "" : `rover ${vehicle}: `;
  return h("li", { key: `${filters.From} ${number}`, class: mood }, h("time", {}, clock(at)), sender, ...linked(words));
}

// "Task 12 …" becomes a link to the task
const linked = (words) => words.split(/\b(task \d{1,10})\b/i).map((part, at) => (at % 2 ? taskLink(Number(part.slice(5)), part) : part));
