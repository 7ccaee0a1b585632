// Tracks and goals of rovers on the map. Where there are many rovers, only those of the chosen one, unless all are
// wanted: then each has a share of the points and goals that one page draws, so that the cost has a bound.

import { get } from "./api.js";
import { change, kept, serverNow, state } from "./store.js";
import { taskColour } from "./words.js";

/* global L: Leaflet, loaded before this module */

const MANY = 5; // rovers; beyond that somebody must want all of them
const MOST_POINTS = 20000; // of one rover; of all together where there are many
const MOST_TASKS = 50; // of one rover, with their goals
const MOST_GOALS = 2000; // of one rover; of all together where there are many
const LATELY = 600; // s of the track of each of many rovers
const PIECE = 200; // points of a track in one line

const choice = document.getElementById("map-choice");
const all = choice.querySelector("input");

let [trackLayer, goalLayer] = [];
let place = null; // of the map: point(place, vehicle), here(vehicle), placed(vehicle)
let isLoading = false;
const tracks = new Map();
const goals = new Map();
const long = new Map(); // goals of tasks that have many, by task

/** Draw into two layers of the map. "on": its "point", "here" and "placed". */
export function begin(layerOfTracks, layerOfGoals, on) {
  [trackLayer, goalLayer, place] = [layerOfTracks, layerOfGoals, on];
  all.checked = kept["mav-tasks all tracks"] === "yes";
  all.onchange = () => {
    kept["mav-tasks all tracks"] = all.checked ? "yes" : "";
    change("vehicles", "queues");
  };
}

const areMany = () => state.vehicles.size > MANY;
const isShown = (rover) => !areMany() || all.checked || rover === state.chosen;
const shareOf = (most) => Math.ceil(most / (areMany() && all.checked ? state.vehicles.size : 1));

/** Draw what is new of each rover that is shown; what was drawn of others goes. */
function drawEach(drawn, layer, draw) {
  for (const [id, each] of drawn) {
    if (isShown(id) && state.vehicles.has(id)) continue;
    each.layer.remove();
    drawn.delete(id);
  }
  for (const [id, vehicle] of state.vehicles) {
    if (!isShown(id)) continue;
    if (!drawn.has(id)) drawn.set(id, { layer: L.layerGroup().addTo(layer) });
    draw(id, vehicle, drawn.get(id));
  }
}

export function drawTracks() {
  choice.hidden = !areMany();
  const most = shareOf(MOST_POINTS);
  drawEach(tracks, trackLayer, (id, vehicle, drawn) => {
    const track = state.tracks.get(id);
    if (!track) return;
    if (id === state.chosen && !track.isWhole) load(id, track, 0);
    else if (!track.isWhole && !track.isLate && !isLoading) load(id, track, serverNow() - LATELY);
    extend(drawn, track, vehicle, most);
  });
}

/** Whether nobody saw the rover on its way between two points: it was silent, or began to count anew. */
export const isGap = ([at, north, east], [later, ...to]) => Math.hypot(to[0] - north, to[1] - east) > (later - at > 2 ? 1 : 20);

/** The ways along points of a rover's track: a new one begins with another task, and where nobody saw the rover. */
export function waysOf(points, vehicle) {
  const ways = [];
  for (const [at, each] of points.entries()) {
    const [, north, east, , task] = each;
    const to = place.point({ north, east }, vehicle);
    if (!to) continue;
    const isCut = !ways.length || isGap(points[at - 1], each);
    if (isCut || ways.at(-1).task !== task) ways.push({ task, places: isCut ? [] : ways.at(-1).places.slice(-1) });
    ways.at(-1).places.push(to);
  }
  return ways;
}

// Only the last piece is drawn again: a track has thousands of points and grows ten times a second. Short pieces,
// because Leaflet projects all points of a line again when one is added.
function extend(drawn, { points, revision }, vehicle, most) {
  const shown = `${revision} ${most} ${place.placed(vehicle)}`;
  if (drawn.shown !== shown) {
    Object.assign(drawn, { shown, count: 0, pieces: new Map() });
    drawn.layer.clearLayers();
  }
  const pieceAt = (count) => Math.max(0, Math.floor(count / PIECE));
  const first = pieceAt(points.length - most);
  for (let at = Math.max(first, pieceAt(drawn.count - 1)); at * PIECE < points.length && drawn.count < points.length; at += 1) {
    drawn.pieces.get(at)?.remove();
    const ways = waysOf(points.slice(Math.max(0, at * PIECE - 1), (at + 1) * PIECE), vehicle);
    const lines = ways.map(({ task, places }) => L.polyline(places, { color: taskColour(task), weight: task === null ? 2 : 3, opacity: 0.85, interactive: false, smoothFactor: 1.5 }));
    drawn.pieces.set(at, L.layerGroup(lines).addTo(drawn.layer));
  }
  drawn.count = points.length;
  for (const [at, piece] of drawn.pieces) if (at < first && drawn.pieces.delete(at)) piece.remove();
}

async function load(id, track, since) {
  track[since ? "isLate" : "isWhole"] = true;
  isLoading = true; // those of many rovers one after another
  try {
    const { points } = await get(`/vehicles/${id}/track?since=${since}`);
    const first = track.points.length ? track.points[0][0] : Infinity;
    track.points.unshift(...points.filter((each) => each[0] < first));
    track.revision += 1;
  } catch {
    track.isWhole = track.isLate = false;
  }
  isLoading = false;
  change("vehicles");
}

export function drawGoals() {
  const most = shareOf(MOST_GOALS);
  drawEach(goals, goalLayer, (id, vehicle, drawn) => {
    const queue = state.queues.get(id);
    const where = `${most} ${place.placed(vehicle)}`;
    if (!queue || (drawn.queue === queue && drawn.where === where)) return;
    Object.assign(drawn, { queue, where });
    drawn.layer.clearLayers();
    drawQueue(drawn.layer, queue, vehicle, most);
  });
}

/** The goals of a task, null if they are not here yet: a queue has no long lists of them. */
function goalsOf(task) {
  if (!task.goals || task.goals.length) return task.goals;
  let known = long.get(task.id);
  if (!known) {
    if (long.size >= MOST_TASKS) long.delete(long.keys().next().value);
    long.set(task.id, (known = { goals: null }));
    get(`/tasks/${task.id}`).then((whole) => {
      known.goals = whole.goals;
      goals.get(task.vehicle).queue = null; // draw them
      change("queues");
    }).catch(() => long.delete(task.id));
  }
  return known.goals;
}

/** The pose of a rover after a task that is driven from where it stands then; null: not known. */
function poseAfter(task, pose, isNow) {
  const [, kind, said] = task.what.match(/^(move|rotate|face) (-?[\d.]+)/) ?? [];
  if (!kind || !pose || pose.north === null || pose.heading === null) return null;
  const amount = isNow && task.left !== null ? Math.sign(said) * task.left : Number(said);
  if (kind !== "move") return { ...pose, heading: kind === "face" ? Number(said) : pose.heading + amount };
  const turn = (pose.heading * Math.PI) / 180;
  return { ...pose, north: pose.north + amount * Math.cos(turn), east: pose.east + amount * Math.sin(turn) };
}

function drawQueue(layer, queue, vehicle, most) {
  const from = place.here(vehicle);
  let left = most;
  let pose = { north: vehicle.north, east: vehicle.east, heading: vehicle.heading };
  for (const task of [queue.current, ...queue.waiting.slice(0, MOST_TASKS)]) {
    if (!task) continue;
    const isNow = task === queue.current;
    pose = poseAfter(task, pose, isNow);
    const of = goalsOf(task) ?? (pose && task.what.startsWith("move") ? [pose] : null);
    if (!of) continue;
    const places = of.slice(0, left).map((each) => place.point(each, vehicle)).filter(Boolean);
    left -= places.length;
    const colour = taskColour(task.id);
    if (isNow && from && places.length) L.polyline([from, ...places.slice(Math.max(0, task.item - 1))], { color: colour, weight: 2, dashArray: "6 6", interactive: false }).addTo(layer);
    for (const [at, each] of places.entries()) {
      const isNext = isNow && at === Math.min(Math.max(task.item, 1), places.length) - 1;
      L.circleMarker(each, { radius: isNext ? 7 : 5, color: colour, weight: 2, opacity: isNow ? 1 : 0.45, fillOpacity: isNext ? 0.6 : 0.1, interactive: false }).addTo(layer);
    }
  }
}
