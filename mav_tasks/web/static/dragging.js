// Dragging: a row of a list onto another one, with a mouse anywhere on it, with a finger or a pen by its handle, so that
// a finger on the row still scrolls. Escape ends it, and so does the browser (pointercancel).

const FEW = 5; // px before it is a drag

/** Follow a pointer that is pressed on an element: it "moved" as a drag; it "ended", and whether it was let go as one. */
export function follow(element, pressed, moved, ended = () => {}) {
  const listeners = new AbortController();
  const on = (target, kind, act) => target.addEventListener(kind, act, { signal: listeners.signal });
  let isDragged = false;
  const end = (isReleased) => {
    listeners.abort();
    ended(isReleased && isDragged);
  };
  on(element, "pointermove", (event) => {
    if (event.pointerId !== pressed.pointerId) return;
    if (!isDragged && Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) < FEW) return;
    if (!isDragged) element.setPointerCapture(event.pointerId); // what is below it is not clicked then
    isDragged = true;
    moved(event);
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    on(element, kind, (event) => event.pointerId === pressed.pointerId && end(kind === "pointerup"));
  }
  on(document, "keydown", (event) => event.key === "Escape" && end(false));
}

/**
 * Let the rows of a list be dragged that are "movable" and have a "grip". "over" is told which row is dragged, and over which
 * one it is; of null for both at the end. "drop" comes before that.
 */
export function makeDraggable(list, over, drop) {
  list.addEventListener("dragstart", (event) => event.preventDefault()); // of a link
  list.addEventListener("pointerdown", (event) => {
    const row = event.target.closest(".movable");
    const isOnRow = event.pointerType === "mouse" && !event.target.closest("button");
    if (!row || event.button !== 0 || !event.isPrimary || !(isOnRow || event.target.closest(".grip"))) return;
    let [target, at] = [null, null];
    const look = () => {
      if (!at) return;
      // it may run now, or somebody may have cancelled it
      const found = row.isConnected && document.elementFromPoint(at.clientX, at.clientY)?.closest(".movable");
      target = found && found !== row ? found : null;
      target?.scrollIntoView({ block: "nearest", behavior: "smooth" }); // at an edge of the pane it goes on from row to row
      over(row, target);
    };
    const pane = list.closest(".pane");
    pane.addEventListener("scroll", look);
    follow(list, event, (later) => {
      at = later;
      look();
    }, (isReleased) => {
      pane.removeEventListener("scroll", look);
      if (isReleased && target) drop(row, target);
      over(null, null);
    });
  });
}
