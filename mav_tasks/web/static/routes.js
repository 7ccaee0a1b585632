// Permalinks: /tasks/12 shows a task.

import { h } from "./dom.js";
import { change, state } from "./store.js";

/** Show a task; null: none. */
export function showTask(id) {
  const path = id === null ? "/" : `/tasks/${id}`;
  if (location.pathname !== path) history.pushState(null, "", path);
  if (state.task === id) return;
  Object.assign(state, { task: id, one: null });
  change("route");
}

/** A link to a task, which opens without loading the page again. */
export function taskLink(id, words) {
  const onclick = (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    showTask(id);
  };
  return h("a", { href: `/tasks/${id}`, onclick }, words);
}

export function begin() {
  const read = () => showTask(Number(location.pathname.match(/^\/tasks\/(\d+)$/)?.[1]) || null);
  addEventListener("popstate", read);
  read();
}
