// Fields for the parts of a request, made from what the API says of them, and what was filled in.

import { h } from "./dom.js";

const WIDE = 1e6; // a bound beyond this tells nothing
const NUMBERS = ["number", "integer"];

/** Return an element with a field for each part, filled with what each is now. */
export function fieldsOf(parts, was = {}) {
  return h("div", { class: "fields" }, ...parts.map((part) => field(part, was[part.name] ?? "")));
}

/** Return the parts that were filled in, or changed from what each was; a number that was emptied is 0. */
export function filledIn(fields, parts, was = {}) {
  const values = {};
  for (const { name, type } of parts) {
    const text = fields.querySelector(`[name=${name}]`).value.trim();
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

function field({ name, type, unit, meaning, required, least, most, words }, value) {
  const title = `${name.charAt(0).toUpperCase()}${name.slice(1).replace("_", " ")}${unit ? ` (${unit})` : ""}`;
  const label = (input, ...hint) => h("label", {}, title, input, h("small", {}, hint.join("; ")));
  const isKept = name === "priority" && value !== ""; // emptied, it would be 0, which is one of its values
  const own = { name, required: required || isKept, value, autocomplete: "off" };
  if (name === "at") return label(h("input", { ...own, type: "datetime-local", step: 1 }), "start time, as your clock shows it");
  if (type === "boolean") return label(h("select", { name }, ...["", "yes", "no"].map((word) => h("option", {}, word))), meaning);
  if (NUMBERS.includes(type)) {
    const bounds = [];
    if (least && least > -WIDE) bounds.push(`at least ${least}`);
    if (most !== null && most < WIDE) bounds.push(`at most ${most}`);
    return label(h("input", { ...own, type: "number", step: type === "integer" ? 1 : "any", min: least ?? undefined, max: most ?? undefined }), meaning, ...bounds);
  }
  if (!words.length) return label(h("input", { ...own, maxLength: most ?? undefined }), meaning);
  const list = `words-of-${name}`;
  return label(h("span", {}, h("input", { ...own, list }), h("datalist", { id: list }, ...words.map((word) => h("option", { value: word })))), meaning);
}
