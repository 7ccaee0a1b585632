// The page of the API: each operation of its OpenAPI document, with a form that sends it.

import { draw, h, make } from "./dom.js";

const found = await fetch("/api/v1/openapi.json");
const { info, servers, paths } = found.ok ? await found.json() : { servers: [{}], paths: {} };
const root = servers[0].url;
const code = (words) => h("code", {}, words);

draw(document.getElementById("main"), h("h1", {}, "The HTTP API"),
  ...(found.ok ? [
    h("p", {}, info.description),
    h("p", {}, "Send does it: what a request moves is the real rover. From a program of yours, send the token as ", code("Authorization: Bearer TOKEN"), ". ", h("a", { href: `${root}/openapi.json` }, "The OpenAPI document")),
  ] : [h("p", {}, h("a", { href: "/" }, "Log in"), " first, then load this page again.")]),
  ...Object.entries(paths).flatMap(([path, methods]) => Object.entries(methods).map(([method, operation]) => about(method.toUpperCase(), path, operation))));

function about(method, path, { summary, description, parameters, requestBody, responses }) {
  const schema = requestBody?.content["application/json"].schema;
  const example = schema && Object.fromEntries(schema.required.map((name) => [name, sample(schema.properties[name])]));
  const isStream = "text/event-stream" in (responses[200]?.content ?? {});
  const answer = make(h("pre", { "aria-live": "polite" }));
  const onsubmit = async (event) => {
    event.preventDefault();
    draw(answer, "sent…");
    const { elements } = event.target;
    const of = (where) => parameters.filter((each) => each.in === where && elements[each.name].value).map(({ name }) => [name, elements[name].value]);
    const filled = path.replace(/{(\w+)}/g, (_, name) => encodeURIComponent(elements[name].value));
    const headers = { ...Object.fromEntries(of("header")), ...(schema && { "content-type": "application/json" }) };
    try {
      const got = await fetch(`${root}${filled}?${new URLSearchParams(of("query"))}`, { method, body: elements.body?.value, headers });
      const text = await got.text();
      draw(answer, `${got.status} ${text && JSON.stringify(JSON.parse(text), null, 2)}`);
    } catch (error) {
      draw(answer, String(error));
    }
  };
  return h("details", {}, h("summary", {}, code(`${method} ${path}`), ` ${summary}`), h("form", { onsubmit },
    description && h("p", {}, description),
    ...parameters.map(({ name, in: where, description: words, required }) => h("label", {}, `${name} (${where}) `, h("input", { name, required }), h("small", {}, words))),
    schema && h("label", {}, "Body, JSON ", h("textarea", { name: "body", rows: 4, cols: 70, spellcheck: "false" }, JSON.stringify(example))),
    schema && table(schema), !isStream && h("button", { class: "small main-word", type: "submit" }, "Send"), answer));
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
