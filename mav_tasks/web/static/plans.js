// Plan files: dropped or chosen, shown on the map, and only then queued.

import { failureWords, newKey, post } from "./api.js";
import { consequenceOf, may } from "./acts.js";
import { ask } from "./dialogs.js";
import { h, say, show } from "./dom.js";
import { preview } from "./map.js";
import { state } from "./store.js";

const LARGEST = 10_000_000; // characters; the server's own limit

/** A place to drop a plan file on, or to choose one by keyboard. */
export function planDrop() {
  const failure = h("p", { class: "failure", role: "alert", hidden: true });
  const input = h("input", { type: "file", id: "plan-file", class: "quiet", accept: ".plan,.waypoints,.txt" });
  const choose = h("button", { class: "small", type: "button", onclick: () => input.click() }, "choose a plan file…");
  const area = h("div", { class: "drop" }, "Drop a .plan or waypoints file here, or ", choose, h("label", { class: "quiet", htmlFor: "plan-file" }, "Plan file"), input, failure);
  const take = async (file) => {
    show(failure, false);
    try {
      await open(file);
    } catch (error) {
      say(failure, `${file.name}: ${error instanceof RangeError ? error.message : failureWords(error)}`);
      show(failure, true);
    }
  };
  input.addEventListener("change", () => {
    if (input.files[0]) take(input.files[0]);
    input.value = "";
  });
  for (const kind of ["dragover", "dragenter"]) {
    area.addEventListener(kind, (event) => {
      if (![...event.dataTransfer.types].includes("Files")) return;
      event.preventDefault();
      area.classList.add("over");
    });
  }
  area.addEventListener("dragleave", () => area.classList.remove("over"));
  area.addEventListener("drop", (event) => {
    area.classList.remove("over");
    if (!event.dataTransfer.files.length) return;
    event.preventDefault();
    take(event.dataTransfer.files[0]);
  });
  // a file that misses the area must not replace the page
  for (const kind of ["dragover", "drop"]) {
    addEventListener(kind, (event) => {
      if (event.dataTransfer && [...event.dataTransfer.types].includes("Files")) event.preventDefault();
    });
  }
  return area;
}

async function open(file) {
  if (file.size > LARGEST) throw new RangeError("it is larger than 10 MB");
  const text = await file.text();
  const plan = await post("/plans", { name: file.name, text });
  const vehicle = state.chosen;
  preview(plan);
  const key = newKey();
  const length = plan.length === null ? "" : `, ${plan.length >= 1000 ? `${(plan.length / 1000).toFixed(2)} km` : `${Math.round(plan.length)} m`} between its places`;
  const words = [`${file.name}: ${plan.items} item${plan.items === 1 ? "" : "s"}, ${plan.path.length} place${plan.path.length === 1 ? "" : "s"}${length}. The map shows its path.`];
  if (plan.items) words.push(consequenceOf(vehicle));
  if (plan.fence.length || plan.rally.length) words.push(`It also has ${plan.fence.length} fence shape(s) and ${plan.rally.length} rally point(s); they are not sent.`);
  const form = ask({
    title: `Queue this plan for rover ${vehicle}?`, words, word: "Queue the plan",
    fields: h("div", { class: "fields" }, h("label", {}, "Name of the task", h("input", { name: "label", maxLength: state.session.label_bytes, value: shortened(file.name) })),
      h("label", {}, "Priority", h("input", { name: "priority", type: "number", min: 0, max: 10, value: state.session.priority.default }))),
    act: async (filled) => {
      const data = new FormData(filled);
      await post(`/vehicles/${vehicle}/missions`, { name: file.name, text, label: String(data.get("label")), priority: Number(data.get("priority")) }, { key });
      preview(null);
    },
  });
  if (!may("mission")) form.querySelector(".main-word").disabled = true;
}

// a label has at most 24 bytes of UTF-8
function shortened(name) {
  let text = name.replace(/\.[^.]*$/, "");
  while (new TextEncoder().encode(text).length > state.session.label_bytes) text = [...text].slice(0, -1).join("");
  return text;
}
