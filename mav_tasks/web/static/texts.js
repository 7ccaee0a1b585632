// Texts of rovers and the server, and the journal, filtered.

import { get } from "./api.js";
import { failureLine, h, reconcile, say, show } from "./dom.js";
import { onChange, state, takeOlderTexts } from "./store.js";
import { goTo } from "./routes.js";
import { clock } from "./words.js";

const panel = document.getElementById("panel-texts");
const SHOWN = 300; // lines at first
const MORE = 200; // lines, and the least that is requested at a time
const KEPT = 2000; // texts that the web process has, and journal entries that it returns
const LEVELS = { 7: "all", 6: "information and worse", 4: "warnings and worse", 3: "errors and worse" };

const source = h("select", {}, h("option", { value: "texts" }, "Texts"), h("option", { value: "journal" }, "Journal"));
const rover = h("select", {}, h("option", { value: "" }, "all rovers"), h("option", { value: "chosen" }, "the chosen rover"));
const level = h("select", {}, ...Object.entries(LEVELS).map(([value, words]) => h("option", { value, selected: value === "6" }, words)));
const search = h("input", { type: "search", placeholder: "words or task number", "aria-label": "Show only lines with these words" });
const list = h("ol", { class: "log", "aria-label": "Texts, the newest first" });
const none = h("p", { class: "empty" });
const said = h("p", { class: "said", role: "status" });
const older = h("button", { class: "small", type: "button", hidden: true, onclick: () => showOlder() }, "Older");
const failure = failureLine();
let journal = [];
let journalOf = ""; // the rover that it was requested for
let most = SHOWN;
let isAsking = false;

export function begin() {
  panel.append(h("div", { class: "filters" }, h("label", {}, "From", source), h("label", {}, "Rover", rover), h("label", {}, "Level", level), h("label", {}, "Search", search)),
    list, none, said, failure.element, older);
  for (const each of [rover, level, source]) each.addEventListener("change", filtered);
  search.addEventListener("input", filtered);
  onChange(["route", "session"], () => {
    source.options[1].disabled = !(state.session && state.session.journal);
    if (source.options[1].disabled) source.value = "texts";
  });
  onChange(["chosen"], () => isJournal() && journalOf !== wantedOf() && loadJournal());
  onChange(["texts", "chosen", "whole", "session"], draw);
}

const isJournal = () => source.value === "journal";
const wantedOf = () => (rover.value && state.chosen !== null ? `&vehicle=${state.chosen}` : "");

function filtered(event) {
  most = SHOWN;
  say(said, "");
  failure.tell("");
  if (isJournal() && (event.target === source || journalOf !== wantedOf())) loadJournal();
  draw();
}

function loadJournal() {
  const vehicle = wantedOf();
  journalOf = vehicle;
  journal = [];
  return failure.trying(async () => {
    const { entries } = await get(`/journal?limit=${KEPT}${vehicle}`);
    if (journalOf !== vehicle) return; // another rover was chosen meanwhile
    journal = entries;
    draw();
  });
}

/** The lines that the filters let pass, the oldest first. */
function matching() {
  const words = search.value.trim().toLowerCase();
  const lines = isJournal() ? journal.map(fromJournal) : state.texts;
  return lines.filter((line) => line.severity <= Number(level.value)
    && (!rover.value || line.vehicle === state.chosen || line.vehicle === null)
    && (!words || line.words.toLowerCase().includes(words)));
}

// the filters hold for older lines, too: it asks on until some of them pass
async function showOlder() {
  if (isAsking) return;
  const before = matching().length;
  isAsking = true; // the button is not disabled: the keyboard stays on it
  list.ariaBusy = "true";
  await failure.trying(async () => {
    let found = before;
    while (!isJournal() && !state.areTextsWhole && found < Math.min(most, before) + MORE) {
      const first = state.texts[0];
      const { texts } = await get(`/texts?before=${first.number}&limit=${MORE}`);
      if (state.texts[0] !== first) break; // the web process was started again meanwhile
      takeOlderTexts(texts, texts.length < MORE);
      found = matching().length;
    }
    const added = Math.min(found, most + MORE) - Math.min(before, most);
    most += MORE;
    say(said, added > 0 ? `${added} older line${added === 1 ? "" : "s"} shown.` : "No older line fits these filters.");
  });
  isAsking = false;
  list.ariaBusy = "false";
  draw();
}

function draw() {
  if (panel.hidden) return;
  const all = matching();
  const lines = all.slice(-most).reverse();
  reconcile(list, lines, (line) => `${source.value} ${line.number}`, make);
  const hasOlder = all.length > most || (!isJournal() && state.texts.length > 0 && !state.areTextsWhole);
  show(none, !lines.length);
  if (!lines.length) say(none, hasOlder ? "No line of the latest ones fits these filters." : (isJournal() ? journal : state.texts).length ? "No line fits these filters." : "Nothing yet.");
  show(older, hasOlder);
}

/** The panel was hidden, and is shown now. */
export const shown = draw;

function fromJournal(entry) {
  return { number: entry.number, at: entry.at, vehicle: entry.vehicle ?? null, severity: { warning: 4, error: 3 }[entry.level] ?? 6, words: entry.message, task: entry.task ?? null };
}

function make(line) {
  const mood = line.severity <= 3 ? "bad" : line.severity === 4 ? "warn" : "";
  const sender = line.vehicle === null || source.value === "journal" ? "" : `rover ${line.vehicle}: `;
  return { element: h("li", { class: mood }, h("time", {}, clock(line.at)), sender, ...linked(line.words)), update() {} };
}

// "Task 12 …" becomes a link to the task
function linked(words) {
  const found = words.match(/^(.*?)\b([Tt]ask )(\d{1,10})\b(.*)$/s);
  if (!found) return [words];
  const [, before, name, id, after] = found;
  return [before, h("a", { href: `/tasks/${id}`, onclick: (event) => goTo(event, Number(id)) }, name + id), after];
}
