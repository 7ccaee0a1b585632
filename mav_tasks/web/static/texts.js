// Texts of rovers and the server, and the journal, filtered.

import { failureWords, get } from "./api.js";
import { h, reconcile, say, show } from "./dom.js";
import { onChange, state } from "./store.js";
import { goTo } from "./routes.js";
import { clock } from "./words.js";

const panel = document.getElementById("panel-texts");
const SHOWN = 300;
const LEVELS = { 7: "all", 6: "information and worse", 4: "warnings and worse", 3: "errors and worse" };

const source = h("select", {}, h("option", { value: "texts" }, "Texts"), h("option", { value: "journal" }, "Journal"));
const rover = h("select", {}, h("option", { value: "" }, "all rovers"), h("option", { value: "chosen" }, "the chosen rover"));
const level = h("select", {}, ...Object.entries(LEVELS).map(([value, words]) => h("option", { value, selected: value === "6" }, words)));
const search = h("input", { type: "search", placeholder: "words or task number", "aria-label": "Show only lines with these words" });
const list = h("ol", { class: "log", "aria-label": "Texts, the newest first" });
const none = h("p", { class: "empty" });
let journal = [];

export function begin() {
  panel.append(h("div", { class: "filters" }, h("label", {}, "From", source), h("label", {}, "Rover", rover), h("label", {}, "Level", level), h("label", {}, "Search", search)), list, none);
  for (const each of [rover, level, source]) each.addEventListener("change", () => (source.value === "journal" ? load() : draw()));
  search.addEventListener("input", draw);
  onChange((names) => {
    if (names.has("route") || names.has("session")) source.options[1].disabled = !(state.session && state.session.journal);
    if (names.has("texts") || names.has("chosen") || names.has("whole")) draw();
  });
}

async function load() {
  try {
    const vehicle = rover.value && state.chosen !== null ? `&vehicle=${state.chosen}` : "";
    journal = (await get(`/journal?limit=1000${vehicle}`)).entries;
    draw();
  } catch (error) {
    journal = [];
    draw();
    say(none, failureWords(error));
    show(none, true);
  }
}

function draw() {
  if (panel.hidden) return;
  const lines = source.value === "journal" ? journal.map(fromJournal) : state.texts;
  const words = search.value.trim().toLowerCase();
  const shown = lines.filter((line) => (source.value === "journal" || line.severity <= Number(level.value))
    && (!rover.value || line.vehicle === state.chosen || line.vehicle === null)
    && (!words || line.words.toLowerCase().includes(words))).slice(-SHOWN).reverse();
  reconcile(list, shown, (line) => `${source.value} ${line.number}`, make);
  show(none, !shown.length);
  if (!shown.length) say(none, lines.length ? "No line fits these filters." : "Nothing yet.");
}

/** The panel was hidden, and is shown now. */
export const shown = draw;

function fromJournal(entry) {
  return { number: entry.number, at: entry.at, vehicle: entry.vehicle ?? null, severity: entry.level === "warning" ? 4 : 6, words: entry.message, task: entry.task ?? null };
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
