// The page of the API: each operation of its OpenAPI document, with a form that sends it.

import { h } from "./dom.js";

const place = document.getElementById("main");
const found = await fetch("/api/v1/openapi.json");
if (!found.ok) place.append(h("p", {}, h("a", { href: "/" }, "Log in"), " first, then load this page again."));
const document_ = await (found.ok ? found.json() : { servers: [{}], info: {}, paths: {} });
const root = document_.servers[0].url;

if (found.ok) place.append(h("p", {}, document_.info.description), h("p", {}, "Send does it: what a request moves is the real rover. From a program of yours, send the token as ", h("code", {}, "Authorization: Bearer TOKEN"), ". ", h("a", { href: `${root}/openapi.json` }, "The OpenAPI document")));
for (const [path, methods] of Object.entries(document_.paths)) {
  for (const [method, operation] of Object.entries(methods)) place.append(shown(method.toUpperCase(), path, operation));
}

function shown(method, path, { summary, description, parameters, requestBody, responses }) {
  const fields = parameters.map((each) => ({ ...each, input: h("input", { required: each.required }) }));
  const schema = requestBody?.content["application/json"].schema;
  const body = schema && h("textarea", { rows: 4, cols: 70, spellcheck: false }, JSON.stringify(Object.fromEntries(schema.required.map((name) => [name, sample(schema.properties[name])]))));
  const answer = h("pre", { "aria-live": "polite" });
  const isStream = "text/event-stream" in (responses[200]?.content ?? {});
  const form = h("form", {},
    description && h("p", {}, description),
    ...fields.map(({ name, in: where, description: words, input }) => h("label", {}, `${name} (${where}) `, input, h("small", {}, words))),
    body && h("label", {}, "Body, JSON ", body), schema && table(schema), !isStream && h("button", { class: "small main-word", type: "submit" }, "Send"), answer);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    answer.textContent = "sent…";
    const of = (where) => fields.filter((each) => each.in === where && each.input.value).map((each) => [each.name, each.input.value]);
    const filled = path.replace(/{(\w+)}/g, (_, name) => encodeURIComponent(Object.fromEntries(of("path"))[name]));
    const query = new URLSearchParams(of("query")).toString();
    try {
      const got = await fetch(`${root}${filled}${query && `?${query}`}`, { method, body: body?.value, headers: { ...Object.fromEntries(of("header")), ...(body && { "content-type": "application/json" }) } });
      const text = await got.text();
      answer.textContent = `${got.status} ${text && JSON.stringify(JSON.parse(text), null, 2)}`;
    } catch (error) {
      answer.textContent = String(error);
    }
  });
  return h("details", {}, h("summary", {}, h("code", {}, `${method} ${path}`), ` ${summary}`), form);
}

function sample({ type, items, anyOf, oneOf, properties, required = [], minimum = 0, enum: choices, const: only }) {
  if (anyOf ?? oneOf) return sample((anyOf ?? oneOf)[0]);
  if (only ?? choices) return only ?? choices[0];
  if (type === "object") return Object.fromEntries(required.map((name) => [name, sample(properties[name])]));
  return { array: items ? [sample(items)] : [], integer: minimum, number: minimum, boolean: false }[type] ?? "";
}

function table({ properties, required }) {
  return h("dl", { class: "facts-table" }, ...Object.entries(properties).flatMap(([name, { type, description }]) => [
    h("dt", {}, `${name}${required.includes(name) ? "" : ", optional"}`), h("dd", {}, `${[type].flat()[0]}: ${description}`)]));
}
