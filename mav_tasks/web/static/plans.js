// Plan files: dropped or chosen, shown on the map, and only then queued.

import { failureWords, newKey, post, request } from "./api.js";
import { consequenceOf, may } from "./acts.js";
import { ask } from "./dialogs.js";
import { failureLine, h } from "./dom.js";
import { loadGround, preview } from "./map.js";
import { fieldsOf, filledIn } from "./parts.js";
import { state } from "./store.js";

const LARGEST = 10_000_000; // characters; the server's own limit

/** A place to drop a plan file on, or to choose one by keyboard. */
export function planDrop() {
  const failure = failureLine();
  const input = h("input", { type: "file", id: "plan-file", class: "quiet", accept: ".plan,.waypoints,.txt" });
  const choose = h("button", { class: "small", type: "button", onclick: () => input.click() }, "choose a plan file…");
  const area = h("div", { class: "drop" }, "Drop a .plan or waypoints file here, or ", choose, h("label", { class: "quiet", htmlFor: "plan-file" }, "Plan file"), input, failure.element);
  const take = (file) => failure.trying(() => open(file), (error) => `${file.name}: ${error instanceof RangeError ? error.message : failureWords(error)}`);
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
  const bytes = new Uint8Array(await file.arrayBuffer());
  const wide = { "255,254": "utf-16le", "254,255": "utf-16be" }[bytes.slice(0, 2)]; // Windows' editors
  const text = new TextDecoder(wide ?? "utf-8").decode(bytes);
  const plan = await post("/plans", { name: file.name, text });
  const vehicle = state.chosen;
  const key = newKey();
  const length = plan.length === null ? "" : `, ${plan.length >= 1000 ? `${(plan.length / 1000).toFixed(2)} km` : `${Math.round(plan.length)} m`} between its places`;
  const drives = `${file.name}: ${counted(plan.items, "item")}, ${counted(plan.path.length, "place")}${length}. The map shows its path.`;
  const words = [plan.items ? drives : `${file.name} has no mission. The map shows what else it has.`, ...(plan.warnings ?? [])];
  if (plan.items) words.push(consequenceOf(vehicle));
  const parts = [];
  const extra = (name, what, count, consequence) => {
    if (count) parts.push(h("label", { class: "check" }, h("input", { type: "checkbox", name, disabled: !may("fence"), checked: !plan.items && may("fence") }), `${plan.items ? "First set" : "Set"} ${what}. ${may("fence") ? consequence : "Your role may not."}`));
  };
  extra("fence", `its fence (${counted(plan.fence.length, "shape")})`, plan.fence.length, "It replaces the present fence; a driving rover stops at it.");
  extra("rally", `its rally points (${plan.rally.length})`, plan.rally.length, "They replace the present ones.");
  const terms = ["label", "priority"].map(termOf);
  const fields = fieldsOf(terms, { label: shortened(file.name) });
  const form = ask({
    title: plan.items ? `Queue this plan for rover ${vehicle}?` : `Set this for rover ${vehicle}?`, words, word: plan.items ? "Queue the plan" : "Set it", isBeside: true,
    fields: h("div", {}, ...parts, plan.items ? fields : null),
    act: async (filled) => {
      const data = new FormData(filled);
      const body = { name: file.name, text };
      for (const part of ["fence", "rally"]) if (data.get(part)) await request("PUT", `/vehicles/${vehicle}/${part}`, body);
      if (plan.items) await post(`/vehicles/${vehicle}/missions`, { ...body, ...filledIn(fields, terms) }, { key });
      loadGround();
    },
    onClose: () => preview(null),
  });
  document.querySelector("[data-show=map]").click(); // on a phone the map is a view of its own
  preview(plan, form);
  if (!may(plan.items ? "submit" : "fence")) form.querySelector(".main-word").disabled = true;
}

const counted = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

const termOf = (name) => state.session.terms.find((term) => term.name === name);

// a label has few bytes of UTF-8
function shortened(name) {
  let text = name.replace(/\.[^.]*$/, "");
  while (new TextEncoder().encode(text).length > termOf("label").most) text = [...text].slice(0, -1).join("");
  return text;
}
