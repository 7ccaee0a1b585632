// What the page knows, and who is told of changes: once for each frame of the display.

export const state = {
  session: null,
  /** @type {Map<number, any>} */ vehicles: new Map(),
  /** @type {Map<number, any>} */ queues: new Map(),
  /** @type {Map<number, any>} */ tracks: new Map(),
  /** @type {Map<number, any>} */ grounds: new Map(), // fence, rally points and mission by rover
  texts: [],
  areTextsWhole: false, // the web process has no older ones
  stops: [],
  chosen: null,
  tab: "queue",
  task: null, // the id of the task of a permalink
  one: null, // that task, once it is known
  stream: "connecting", // open, lost
  heardAt: 0,
  server: { reachable: true, detail: null },
};

const MOST_TEXTS = 2000;
const listeners = [];
let changed = new Set();

/** Call a view before the next frame is drawn if one of these has changed. */
export function onChange(names, view) {
  listeners.push({ names, view });
}

export function change(...names) {
  if (!changed.size) {
    // a page in the background gets no frames, and must be right when it is looked at again
    if (document.hidden) setTimeout(tell, 200);
    else requestAnimationFrame(tell);
  }
  for (const name of names) changed.add(name);
}

function tell() {
  const names = changed;
  changed = new Set();
  for (const each of listeners) if (each.names.some((name) => names.has(name))) each.view();
}

/** Seconds of this page's clock. */
export const now = () => performance.now() / 1000;

let clockAhead = 0; // s by which the clock of the web process is ahead of this device's

/** Seconds since 1970, by the clock of the web process. */
export const serverNow = () => Date.now() / 1000 + clockAhead;

/** Take the states of rovers, and the time of the web process: a tablet's own clock may be hours off. */
export function takeVehicles({ now: at, vehicles }) {
  clockAhead = at - Date.now() / 1000;
  for (const vehicle of vehicles) {
    vehicle.takenAt = now();
    state.vehicles.set(vehicle.vehicle, vehicle);
    addToTrack(vehicle);
  }
  if (state.chosen === null && state.vehicles.size) choose(Math.min(...state.vehicles.keys()));
  change("vehicles");
}

export function takeQueue(queue) {
  state.queues.set(queue.vehicle, queue);
  [queue.current, ...queue.waiting].forEach(takeOne);
  change("queues");
}

/** Take what has changed in a queue: the order of all of it, and the rows that are new or other. */
export function takeQueueChange({ order, rows, ...head }) {
  const before = state.queues.get(head.vehicle)?.waiting ?? [];
  const known = new Map([...before, ...rows].map((row) => [row.id, row]));
  const waiting = order.filter(([id]) => known.has(id)).map(([id, position, begin, end]) => (
    { ...known.get(id), position, time_to_start: begin, time_to_finish: end, halt_epoch: head.halt_epoch }
  ));
  takeQueue({ ...head, waiting });
}

/** Take a task; in the queue it replaces the one that runs. */
export function takeTask(task) {
  takeOne(task);
  const queue = state.queues.get(task.vehicle);
  if (queue?.current?.id === task.id && queue.current.version <= task.version) {
    state.queues.set(task.vehicle, { ...queue, current: task });
  }
  change("queues", "tasks");
}

// the task that is shown, unless what is known of it is newer
function takeOne(task) {
  if (task?.id !== state.task || (state.one?.id === task.id && state.one.version > task.version)) return;
  state.one = task;
  change("one");
}

export function takeTexts(texts) {
  state.texts = [...state.texts, ...texts].slice(-MOST_TEXTS);
  change("texts");
}

/** Take a STOP. "age": s since it was pressed. */
export function takeStop(stop, age = 0) {
  const place = state.stops.findIndex((each) => each.number === stop.number);
  const before = state.stops[place];
  // the answer of the request may come after a later event
  for (const name of ["acknowledged_after", "standing_after"]) if (before && before[name] !== null && stop[name] === null) return;
  stop.takenAt = before ? before.takenAt : now() - age;
  state.stops.splice(before ? place : state.stops.length, 1, stop);
  state.stops = state.stops.slice(-50);
  change("stops");
}

/** Show a task, by its permalink; null: none. */
export function showTask(id) {
  const path = id === null ? "/" : `/tasks/${id}`;
  if (location.pathname !== path) history.pushState(null, "", path);
  if (state.task === id) return;
  Object.assign(state, { task: id, one: null });
  change("route");
}

/** Show what the address of the page says: /tasks/12 is a task. */
export const showPath = () => showTask(Number(location.pathname.match(/^\/tasks\/(\d+)$/)?.[1]) || null);

export function choose(vehicle) {
  state.chosen = vehicle;
  change("chosen", "queues", "vehicles");
}

export const chosenQueue = () => state.queues.get(state.chosen);

/** How old something of a rover is now, s, by its age when it came; null: not known. */
export const ageOf = (vehicle, name) => (vehicle[name] === null ? null : vehicle[name] + now() - vehicle.takenAt);

/** What a person has chosen of the view: of this browser, or until the page is closed if it keeps nothing. */
export const kept = (() => {
  try {
    return localStorage;
  } catch {
    return {};
  }
})();

const APART = 0.1; // m between two points of a track
const MOST_POINTS = 20000;

function addToTrack(vehicle) {
  if (vehicle.north === null) return;
  const track = state.tracks.get(vehicle.vehicle) ?? { points: [], isWhole: false, revision: 0 };
  state.tracks.set(vehicle.vehicle, track);
  const current = state.queues.get(vehicle.vehicle)?.current;
  const task = current?.state === "executing" ? current.id : null;
  const last = track.points.at(-1);
  if (last && Math.hypot(last[1] - vehicle.north, last[2] - vehicle.east) < APART && last[4] === task) return;
  track.points.push([serverNow(), vehicle.north, vehicle.east, vehicle.heading, task]);
  if (track.points.length <= MOST_POINTS) return;
  track.points.splice(0, MOST_POINTS / 10); // many at once: the map then draws all of it again
  track.revision += 1;
}
