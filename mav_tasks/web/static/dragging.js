// Dragging a row of a list onto another one: with a mouse anywhere on it, with a finger or a pen by its handle, so
// that a finger on the row still scrolls. Escape ends it, and so does the browser (pointercancel).

const FEW = 5; // px before it is a drag
const EDGE = 48; // px from the edge of the pane, where it scrolls
const FAST = 10; // px a frame, at most

/**
 * Let a row be dragged.
 * @param {HTMLElement} row
 * @param {{grip: HTMLElement, may: () => boolean, rowAt: (element: Element) => HTMLElement|null, over: (row: HTMLElement|null) => void, drop: (row: HTMLElement) => void}} what
 *   "rowAt": the row that an element is in, null: none that it can be dropped on; "over" is told of each new one, and of
 *   null at the end; "drop" comes before that.
 */
export function makeDraggable(row, { grip, may, rowAt, over, drop }) {
  row.addEventListener("dragstart", (event) => event.preventDefault()); // of the link in it
  row.addEventListener("pointerdown", (event) => {
    const isByGrip = grip.contains(event.target);
    if (event.button !== 0 || !event.isPrimary || !may()) return;
    if (!isByGrip && (event.pointerType !== "mouse" || event.target.closest("button"))) return;
    follow(event);
  });

  function follow(pressed) {
    const pane = row.closest(".pane");
    let isDragged = false;
    let target = null;
    let at = pressed;
    const listeners = new AbortController();

    const look = () => {
      if (!row.isConnected) return end(); // it runs now, or somebody cancelled it
      const element = document.elementFromPoint(at.clientX, at.clientY);
      const found = element && rowAt(element);
      const next = found === row ? null : found;
      if (next === target) return;
      target = next;
      over(target);
    };
    const scroll = () => {
      if (listeners.signal.aborted) return;
      const { top, bottom } = pane.getBoundingClientRect();
      const [above, below] = [top + EDGE - at.clientY, at.clientY - bottom + EDGE];
      const by = above > 0 ? -above : below > 0 ? below : 0;
      if (by) {
        pane.scrollTop += Math.max(-FAST, Math.min(FAST, by / 4));
        look();
      }
      requestAnimationFrame(scroll);
    };
    const moved = (event) => {
      if (event.pointerId !== pressed.pointerId) return;
      at = event;
      if (!isDragged) {
        if (Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) < FEW) return;
        isDragged = true;
        row.classList.add("dragged");
        scroll();
      }
      look();
    };
    const end = () => {
      listeners.abort();
      if (!isDragged) return;
      row.classList.remove("dragged");
      over(null);
      // the click that follows on the row is none
      const stop = (event) => (event.preventDefault(), event.stopPropagation());
      row.addEventListener("click", stop, { capture: true, once: true });
      setTimeout(() => row.removeEventListener("click", stop, { capture: true }));
    };
    const released = (event) => {
      if (event.pointerId !== pressed.pointerId) return;
      if (isDragged && target) drop(target);
      end();
    };
    const on = (kind, act) => document.addEventListener(kind, act, { signal: listeners.signal });
    on("pointermove", moved);
    on("pointerup", released);
    on("pointercancel", (event) => event.pointerId === pressed.pointerId && end());
    on("keydown", (event) => event.key === "Escape" && end());
  }
}
