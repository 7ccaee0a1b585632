// What the page knows, and who is told of changes: once for each frame of the display.

export const state = {
  session: null,
  /** @type {Map<number, any>} */ vehicles: new Map(),
  /** @type {Map<number, any>} */ queues: new Map(),
  /** @type {Map<number, any>} */ tasks: new Map(),
  /** @type {Map<number, any>} */ tracks: new Map(),
  /** @type {Map<number, any>} */ grounds: new Map(), // fence, rally points and mission by rover
  texts: [],
  areTextsWhole: false, // the web process has no older ones
  stops: [],
  chosen: null,
  task: null, // the task of a permalink
  stream: { isOpen: false, isLost: false, heardAt: 0 },
  server: { reachable: true, detail: null },
};

const MOST_TEXTS = 2000;
const MOST_TASKS = 10000;
const listeners = [];
let changed = new Set();
let isAsked = false;

/** Call a view before the next frame is drawn if one of these has changed. */
export function onChange(names, view) {
  listeners.push({ names, view });
}

/** Note that parts of the state have changed. */
export function change(...names) {
  for (const name of names) changed.add(name);
  if (isAsked) return;
  isAsked = true;
  // a page in the background gets no frames, and must be right when it is looked at again
  if (document.hidden) setTimeout(tell, 200);
  else requestAnimationFrame(tell);
}

function tell() {
  isAsked = false;
  const names = changed;
  changed = new Set();
  for (const each of listeners) if (each.names.some((name) => names.has(name))) each.view();
}

/** Seconds of this page's clock. */
export const now = () => performance.now() / 1000;

let clockAhead = 0; // s by which the clock of the web process is ahead of this device's

/** Take the time of the web process: a tablet's own clock may be hours off. */
export function takeClock(at) {
  clockAhead = at - Date.now() / 1000;
}

/** Seconds since 1970, by the clock of the web process. */
export const serverNow = () => Date.now() / 1000 + clockAhead;

/** Take the states of rovers. */
export function takeVehicles(vehicles) {
  const at = now();
  for (const vehicle of vehicles) {
    vehicle.takenAt = at;
    state.vehicles.set(vehicle.vehicle, vehicle);
    addToTrack(vehicle);
  }
  if (state.chosen === null && state.vehicles.size) choose(Math.min(...state.vehicles.keys()));
  change("vehicles");
}

/** Take a queue; it has its tasks in it. */
export function takeQueue(queue) {
  queue.takenAt = now();
  state.queues.set(queue.vehicle, queue);
  for (const task of [queue.current, ...queue.waiting]) {
    if (task && !(state.tasks.get(task.id)?.version > task.version)) state.tasks.set(task.id, task);
  }
  change("queues");
}

/** Take what has changed in a queue: the order of all of it, and the rows that are new or other. */
export function takeQueueChange({ order, rows, ...head }) {
  const before = state.queues.get(head.vehicle);
  const known = new Map([...(before ? before.waiting : []), ...rows].map((row) => [row.id, row]));
  const waiting = order.filter(([id]) => known.has(id)).map(([id, position, begin, end]) => (
    { ...known.get(id), position, time_to_start: begin, time_to_finish: end, halt_epoch: head.halt_epoch }
  ));
  takeQueue({ ...head, waiting });
}

/** Take a task; in the queue it replaces the line that it had. */
export function takeTask(task) {
  const before = state.tasks.get(task.id);
  if (before && before.version > task.version) return;
  state.tasks.delete(task.id); // the latest ones stay
  state.tasks.set(task.id, task);
  if (state.tasks.size > MOST_TASKS) state.tasks.delete(state.tasks.keys().next().value);
  const queue = state.queues.get(task.vehicle);
  if (queue && queue.current && queue.current.id === task.id) {
    state.queues.set(task.vehicle, { ...queue, current: task });
  }
  change("queues", "tasks");
}

export function takeTexts(texts) {
  state.texts.push(...texts);
  if (state.texts.length > MOST_TEXTS) state.texts.splice(0, state.texts.length - MOST_TEXTS);
  change("texts");
}

/** Take texts that are older than all that are known; "areAll": there are no others. */
export function takeOlderTexts(texts, areAll) {
  state.texts.unshift(...texts);
  state.areTextsWhole = areAll || state.texts.length >= MOST_TEXTS;
  change("texts");
}

/** Take a STOP. "age": s since it was pressed. */
export function takeStop(stop, age = 0) {
  const place = state.stops.findIndex((each) => each.number === stop.number);
  const before = state.stops[place];
  stop.takenAt = before ? before.takenAt : now() - age;
  // the answer of the request may come after a later event
  const isOlder = before && ((before.acknowledged_after !== null && stop.acknowledged_after === null) || (before.standing_after !== null && stop.standing_after === null));
  if (isOlder) return;
  if (before) state.stops[place] = stop;
  else state.stops.push(stop);
  if (state.stops.length > 50) state.stops.shift();
  change("stops");
}

/** Choose a rover; null: none. */
export function choose(vehicle) {
  state.chosen = vehicle;
  change("chosen", "queues", "vehicles");
}

/** The queue of the chosen rover. */
export const chosenQueue = () => (state.chosen === null ? null : state.queues.get(state.chosen) ?? null);

const agedBy = (age, vehicle) => (age === null ? null : age + (now() - vehicle.takenAt));

/** How old the position of a rover is now, s; null: it has none. */
export const dataAge = (vehicle) => agedBy(vehicle.data_age, vehicle);

/** How long ago its heartbeat was, s; null: not known. */
export const linkAge = (vehicle) => agedBy(vehicle.heartbeat_age, vehicle);

const APART = 0.1; // m between two points of a track
const MOST_POINTS = 20000;

function addToTrack(vehicle) {
  if (vehicle.north === null) return;
  let track = state.tracks.get(vehicle.vehicle);
  if (!track) state.tracks.set(vehicle.vehicle, (track = { points: [], isWhole: false, revision: 0 }));
  const queue = state.queues.get(vehicle.vehicle);
  const task = queue && queue.current && queue.current.state === "executing" ? queue.current.id : null;
  const last = track.points[track.points.length - 1];
  if (last && Math.hypot(last[1] - vehicle.north, last[2] - vehicle.east) < APART && last[4] === task) return;
  track.points.push([serverNow(), vehicle.north, vehicle.east, vehicle.heading, task]);
  if (track.points.length <= MOST_POINTS) return;
  track.points.splice(0, MOST_POINTS / 10); // many at once: the map then draws all of it again
  track.revision += 1;
}
