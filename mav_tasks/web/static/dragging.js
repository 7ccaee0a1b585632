// Dragging a row of a list onto another one: with a mouse anywhere on it, with a finger or a pen by its handle, so
// that a finger on the row still scrolls. Escape ends it, and so does the browser (pointercancel).

const FEW = 5; // px before it is a drag

/**
 * Let the rows of a list be dragged that are "movable" and have a "grip".
 * @param {HTMLElement} list
 * @param {(row: HTMLElement|null, target: HTMLElement|null) => void} over is told of each new target; null: of none, and of no row at the end
 * @param {(row: HTMLElement, target: HTMLElement) => void} drop comes before that
 */
export function makeDraggable(list, over, drop) {
  list.addEventListener("dragstart", (event) => event.preventDefault()); // of a link
  list.addEventListener("pointerdown", (event) => {
    const row = event.target.closest(".movable");
    const isOnRow = event.pointerType === "mouse" && !event.target.closest("button");
    if (row && event.button === 0 && event.isPrimary && (isOnRow || event.target.closest(".grip"))) follow(row, event);
  });

  function follow(row, pressed) {
    const listeners = new AbortController();
    let isDragged = false;
    let target = null;
    let at = pressed;

    const look = () => {
      if (!row.isConnected) return end(); // it runs now, or somebody cancelled it
      const found = document.elementFromPoint(at.clientX, at.clientY)?.closest(".movable") ?? null;
      const next = found === row ? null : found;
      if (next === target) return;
      target = next;
      target?.scrollIntoView({ block: "nearest", behavior: "smooth" }); // at an edge of the pane it goes on from row to row
      over(row, target);
    };
    const end = () => {
      listeners.abort();
      if (!isDragged) return;
      over(null, null);
      // the click that follows on the row is none
      const stop = (event) => (event.preventDefault(), event.stopPropagation());
      row.addEventListener("click", stop, { capture: true, once: true });
      setTimeout(() => row.removeEventListener("click", stop, { capture: true }));
    };
    const on = (kind, act) => document.addEventListener(kind, (event) => {
      if (event.pointerId === pressed.pointerId) act(event);
    }, { signal: listeners.signal });
    on("pointermove", (event) => {
      at = event;
      if (!isDragged) {
        if (Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) < FEW) return;
        isDragged = true;
        over(row, null);
      }
      look();
    });
    on("pointerup", () => {
      if (isDragged && target) drop(row, target);
      end();
    });
    on("pointercancel", end);
    list.closest(".pane").addEventListener("scroll", look, { signal: listeners.signal });
    document.addEventListener("keydown", (event) => event.key === "Escape" && end(), { signal: listeners.signal });
  }
}
