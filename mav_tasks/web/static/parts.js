// Fields for the parts of a request, made from what the API says of them, and what was filled in.

import { sentence } from "./api.js";
import { h } from "./dom.js";

const WIDE = 1e6; // a bound beyond this tells nothing
const NUMBERS = ["number", "integer"];

/** Fields for parts, filled with what each is now, and with what it is by default beside it. */
export const fieldsOf = (parts, was = {}, defaults = {}) => h("div", { class: "fields" }, parts.map((part) => field(part, was[part.name] ?? "", defaults[part.name])));

/** Return the parts that were filled in, or changed from what each was; a number that was emptied is 0. */
export function filledIn(form, parts, was = {}) {
  const values = {};
  for (const { name, type } of parts) {
    const text = form.elements[name].value.trim();
    if (text !== String(was[name] ?? "").trim()) values[name] = valueOf(name, type, text);
  }
  return values;
}

function valueOf(name, type, text) {
  if (name === "at") return new Date(text).toISOString();
  if (type === "boolean") return text === "yes";
  if (NUMBERS.includes(type)) return Number(text);
  return type === "any" && !Number.isNaN(Number(text)) ? Number(text) : text; // the server says which words there are
}

function field({ name, type, unit, meaning, required, least, most, words }, value, standard) {
  const isKept = name === "priority" && value !== ""; // emptied, it would be 0, which is one of its values
  const own = { name, required: required || isKept, autocomplete: "off", placeholder: standard && `${standard} ${unit} by default` };
  const hints = [name === "at" ? "start time, as your clock shows it" : meaning];
  const inputs = [];
  if (name === "at") inputs.push(h("input", { ...own, type: "datetime-local", step: 1, value }));
  else if (type === "boolean") inputs.push(h("select", { name }, ["", "yes", "no"].map((word) => h("option", {}, word))));
  else if (NUMBERS.includes(type)) {
    inputs.push(h("input", { ...own, type: "number", step: type === "integer" ? 1 : "any", min: least, max: most, value }));
    if (least && least > -WIDE) hints.push(`at least ${least}`);
    if (most !== null && most < WIDE) hints.push(`at most ${most}`);
  } else {
    inputs.push(h("input", { ...own, maxlength: most, list: `words-of-${name}`, value }));
    inputs.push(h("datalist", { id: `words-of-${name}` }, words.map((word) => h("option", { value: word }))));
  }
  return h("label", {}, `${sentence(name).replace("_", " ")}${unit ? ` (${unit})` : ""}`, ...inputs, h("small", {}, hints.join("; ")));
}
