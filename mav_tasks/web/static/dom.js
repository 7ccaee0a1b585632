// What the page shows, as a description of what is known: "draw" changes what differs, and nothing else. Data become
// text nodes and attributes only: nothing that others sent is read as HTML.

import { failureWords } from "./api.js";

/**
 * Describe an element. A property "on…" is a listener, "value" what a field has; others are attributes. "key" tells the
 * rows of a list from each other; else the place among the children does, which a child that is false keeps free: no
 * button becomes its neighbour between press and release.
 */
export const h = (tag, { key, ...properties } = {}, ...children) => ({ tag, key, properties, children });

/** A button that is not the main one of its place. */
export const button = (words, onclick, properties) => h("button", { class: "small", type: "button", onclick, ...properties }, words);

export const make = (child) => shown(undefined, child);

/** Let an element show texts, descriptions and other elements: what stays keeps its focus, and what was typed into it. */
export function draw(element, ...children) {
  const focused = element.contains(document.activeElement) ? document.activeElement : null;
  fill(element, children);
  if (focused && !(element.contains(focused) && focused.checkVisibility())) focusNear(element);
  else if (focused !== document.activeElement) focused?.focus({ preventScroll: true });
}

function fill(element, children) {
  if (!element._nodes) element.replaceChildren();
  const before = element._nodes ?? new Map();
  const after = new Map();
  for (const [at, child] of children.flat().entries()) {
    if (child) after.set(child.key ?? `at ${at}`, child);
  }
  // first, so that what follows one that is gone is not moved: an element that is moved loses its focus
  for (const [key, node] of before) {
    if (isLike(node, after.get(key))) continue;
    node.remove();
    before.delete(key);
  }
  let place = element.firstChild;
  for (const [key, child] of after) {
    const node = shown(before.get(key), child);
    if (node === place) place = place.nextSibling;
    else element.insertBefore(node, place);
    after.set(key, node);
  }
  element._nodes = after;
}

const isLike = (node, child) => node === child || (child?.tag ? child.tag === node._tag : child !== undefined && !(child instanceof Node) && node instanceof Text);

function shown(node, child) {
  if (child instanceof Node) return child;
  if (!child.tag) {
    const text = node ?? new Text();
    if (text.data !== String(child)) text.data = child;
    return text;
  }
  const element = node ?? Object.assign(document.createElement(child.tag), { _tag: child.tag });
  fill(element, child.children); // first: a select can have the value of one of its options only
  const before = element._properties ?? {};
  for (const name of Object.keys({ ...before, ...child.properties })) {
    const value = child.properties[name];
    if (value !== before[name]) set(element, name, value);
  }
  element._properties = child.properties;
  return element;
}

function set(element, name, value) {
  if (name.startsWith("on") || name === "value") element[name] = value ?? null;
  else if (name === "style") element.style.cssText = value; // the attribute is none of those that the page may set
  else if (value === undefined || value === null || value === false) element.removeAttribute(name);
  else element.setAttribute(name, value === true ? "" : value);
}

/** A line that tells what failed. "trying" does something, and returns whether it did not fail. */
export function failureLine() {
  const element = make(h("p", { class: "failure", role: "alert", hidden: true }));
  const tell = (words) => {
    draw(element, words);
    element.hidden = !words;
  };
  const trying = async (act, wordsOf = failureWords) => {
    tell("");
    try {
      await act();
      return true;
    } catch (error) {
      tell(wordsOf(error));
      return false;
    }
  };
  return { element, tell, trying };
}

/** Focus what is around a place whose focused element is gone: a keyboard does not begin at the top again. */
export const focusNear = (element) => (element?.closest("[tabindex]:not([hidden])") ?? document.getElementById("main")).focus({ preventScroll: true });
