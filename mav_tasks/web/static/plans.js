// Plan files: dropped or chosen, shown on the map, and only then queued.

import { failureWords, post, request } from "./api.js";
import { consequenceOf, may } from "./acts.js";
import { ask } from "./dialogs.js";
import { button, failureLine, h, make } from "./dom.js";
import { loadGround, preview } from "./map.js";
import { fieldsOf, filledIn } from "./task_form.js";
import { state } from "./store.js";
import { counted } from "./words.js";

const LARGEST = 10_000_000; // characters; the server's own limit

/** A place to drop a plan file on, or to choose one by keyboard. */
export function planDrop() {
  const failure = failureLine();
  const take = (file) => failure.trying(() => open(file), (error) => `${file.name}: ${error instanceof RangeError ? error.message : failureWords(error)}`);
  const input = make(h("input", { type: "file", id: "plan-file", class: "quiet", accept: ".plan,.waypoints,.txt", "aria-label": "Plan file" }));
  input.onchange = () => {
    if (input.files[0]) take(input.files[0]);
    input.value = "";
  };
  const area = make(h("div", { class: "drop" }, "Drop a .plan or waypoints file here, or ", button("choose a plan file…", () => input.click()), input, failure.element));
  for (const kind of ["dragenter", "dragover", "dragleave", "drop"]) {
    addEventListener(kind, (event) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault(); // a file that misses the area must not replace the page
      const isOver = area.contains(event.target);
      area.classList.toggle("over", isOver && kind === "dragover");
      if (isOver && kind === "drop" && event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
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
  const length = plan.length === null ? "" : `, ${plan.length >= 1000 ? `${(plan.length / 1000).toFixed(2)} km` : `${Math.round(plan.length)} m`} between its places`;
  const drives = `${file.name}: ${counted(plan.items, "item")}, ${counted(plan.path.length, "place")}${length}. The map shows its path.`;
  const words = [plan.items ? drives : `${file.name} has no mission. The map shows what else it has.`, ...(plan.warnings ?? [])];
  if (plan.items) words.push(consequenceOf(vehicle));
  const extra = (name, what, consequence) => plan[name].length > 0 && h("label", { class: "check" },
    h("input", { type: "checkbox", name, disabled: !may("fence"), checked: !plan.items && may("fence") }),
    `${plan.items ? "First set" : "Set"} ${what}. ${may("fence") ? consequence : "Your role may not."}`);
  const terms = ["label", "priority"].map((name) => state.session.terms.find((term) => term.name === name));
  const form = ask({
    title: plan.items ? `Queue this plan for rover ${vehicle}?` : `Set this for rover ${vehicle}?`, words, word: plan.items ? "Queue the plan" : "Set it", isBeside: true,
    fields: [
      extra("fence", `its fence (${counted(plan.fence.length, "shape")})`, "It replaces the present fence; a driving rover stops at it."),
      extra("rally", `its rally points (${plan.rally.length})`, "They replace the present ones."),
      plan.items > 0 && fieldsOf(terms, { label: shortened(file.name) }),
    ],
    act: async (filled, key) => {
      const body = { name: file.name, text };
      for (const part of ["fence", "rally"]) if (filled.elements[part]?.checked) await request("PUT", `/vehicles/${vehicle}/${part}`, body);
      if (plan.items) await post(`/vehicles/${vehicle}/missions`, { ...body, ...filledIn(filled, terms) }, { key });
      loadGround();
    },
    onClose: () => preview(null),
  });
  document.querySelector("[data-show=map]").click(); // on a phone the map is a view of its own
  preview(plan, form);
  if (!may(plan.items ? "submit" : "fence")) form.querySelector(".main-word").disabled = true;
}

// a label has few bytes of UTF-8
function shortened(name) {
  let text = name.replace(/\.[^.]*$/, "");
  while (new TextEncoder().encode(text).length > state.session.label_bytes) text = [...text].slice(0, -1).join("");
  return text;
}
