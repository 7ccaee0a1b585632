// Small helpers for the DOM. Data become text nodes only: nothing that others sent is read as HTML.

import { failureWords } from "./api.js";

/**
 * Make an element. A property "on…" is a listener, "class" the class, "data-…"/"aria-…" an attribute.
 * @param {string} tag
 * @param {Record<string, any>} [properties]
 * @param {...(Node|string|number|null|undefined|false)} children
 * @returns {any}
 */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && !name.includes("-") && name !== "list") element[name] = value;
    else element.setAttribute(name === "class" ? "class" : name, value === true ? "" : String(value));
  }
  if (properties.class) element.className = properties.class;
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false).map((c) => (c instanceof Node ? c : String(c))));
  return element;
}

/** Set a text only if it has changed, so that a screen reader does not read it again. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Set texts that follow each other, each of which stays on one line. */
export function sayParts(element, parts) {
  while (element.childElementCount > parts.length) element.lastElementChild.remove();
  while (element.childElementCount < parts.length) element.append(h("span", { class: "part" }));
  for (const [at, part] of parts.entries()) say(element.children[at], at < parts.length - 1 ? `${part} ·` : part);
}

/** Show or hide. */
export function show(element, isShown) {
  if (element.hidden !== isShown) return;
  const hadFocus = !isShown && element.contains(document.activeElement);
  element.hidden = !isShown;
  if (hadFocus) focusNear(element.parentElement);
}

/** A line that tells what failed. "trying" does something, and returns whether it did not fail. */
export function failureLine() {
  const element = h("p", { class: "failure", role: "alert", hidden: true });
  const tell = (words) => {
    say(element, words);
    show(element, Boolean(words));
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
export function focusNear(element) {
  let place = element;
  while (place && (place.hidden || !place.hasAttribute("tabindex"))) place = place.parentElement;
  (place ?? document.getElementById("main")).focus({ preventScroll: true });
}

/** Let the next "reconcile" update all elements of a list: something else that they show has changed. */
export function renew(list) {
  for (const row of list._rows?.values() ?? []) row.item = undefined;
}

/**
 * Make a list show items: elements of unchanged items stay as they are, with their focus.
 * @param {HTMLElement} list
 * @param {any[]} items
 * @param {(item: any) => string|number} keyOf
 * @param {(item: any) => {element: HTMLElement, update: (item: any) => void}} make
 */
export function reconcile(list, items, keyOf, make) {
  const known = list._rows ?? (list._rows = new Map());
  const focused = list.contains(document.activeElement) ? document.activeElement : null;
  const wanted = new Set(items.map(keyOf));
  // first, so that what follows a row that is gone is not moved: an element that is moved loses its focus
  for (const [key, row] of known) {
    if (wanted.has(key)) continue;
    row.element.remove();
    known.delete(key);
  }
  let before = null;
  for (const item of items) {
    const key = keyOf(item);
    let row = known.get(key);
    if (!row) {
      row = make(item);
      known.set(key, row);
    }
    if (row.item !== item) {
      row.update(item);
      row.item = item;
    }
    const place = before ? before.nextSibling : list.firstChild;
    if (place !== row.element) list.insertBefore(row.element, place);
    before = row.element;
  }
  if (!focused || focused === document.activeElement) return;
  if (!list.contains(focused)) focusNear(list);
  else if (focused.checkVisibility()) focused.focus({ preventScroll: true });
}
