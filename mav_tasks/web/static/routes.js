// Permalinks: /tasks/12 shows a task.

import { change, state } from "./store.js";

/** Show a task; null: none. */
export function showTask(id) {
  state.task = id;
  const path = id === null ? "/" : `/tasks/${id}`;
  if (location.pathname !== path) history.pushState(null, "", path);
  change("route");
}

/** Follow a link to a task without loading the page again. */
export function goTo(event, id) {
  if (event.ctrlKey || event.metaKey || event.shiftKey || event.button) return;
  event.preventDefault();
  showTask(id);
}

export function begin() {
  const read = () => {
    const found = location.pathname.match(/^\/tasks\/(\d+)$/);
    state.task = found ? Number(found[1]) : null;
    change("route");
  };
  addEventListener("popstate", read);
  read();
}
