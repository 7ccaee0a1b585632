// The map: a metre grid, or tiles; rovers, tracks, goals, mission, fence, rally points.

import { get, request } from "./api.js";
import { confirmGoal, may } from "./acts.js";
import { ask } from "./dialogs.js";
import { h, say } from "./dom.js";
import { change, choose, dataAge, onChange, state } from "./store.js";
import * as tracks from "./tracks.js";
import { taskColour } from "./words.js";

/* global L: Leaflet, loaded before this module */

const hint = document.getElementById("map-hint");
const follow = document.querySelector("#map-follow input");
const METRES = 111318.845; // of a degree of latitude, as the server converts
const OLD = 3; // s
const FENCE_RADIUS = 20; // m
const REFRESH = 30000; // ms

let map = null;
let hasTiles = false;
let reference = null; // the place on earth at the grid's origin
let [groundLayer, trackLayer, goalLayer, taskTrackLayer, previewLayer, runLayer] = [];
let isFitted = false;
let awaited = null; // what to look at once the map has a size
let isPast = false; // a recorded run is shown
const marks = new Map();

export function begin() {
  const tiles = state.session.tiles;
  hasTiles = Boolean(tiles);
  map = L.map("map", {
    crs: hasTiles ? L.CRS.EPSG3857 : L.CRS.Simple, preferCanvas: true, attributionControl: hasTiles, zoomSnap: 0.25,
    minZoom: hasTiles ? tiles.min_zoom : -4, maxZoom: hasTiles ? Math.max(tiles.max_zoom, 22) : 7,
    fadeAnimation: false, zoomAnimation: !matchMedia("(prefers-reduced-motion: reduce)").matches,
  });
  if (hasTiles) {
    map.attributionControl.setPrefix(false);
    const attribution = document.createElement("span");
    attribution.textContent = tiles.attribution; // a file may hold anything
    L.tileLayer(tiles.url, { minNativeZoom: tiles.min_zoom, maxNativeZoom: tiles.max_zoom, maxZoom: 22, attribution: attribution.innerHTML }).addTo(map);
  } else {
    grid().addTo(map);
  }
  map.setView([0, 0], 3);
  [groundLayer, trackLayer, goalLayer, taskTrackLayer, previewLayer, runLayer] = Array.from({ length: 6 }, () => L.layerGroup().addTo(map));
  tracks.begin(trackLayer, goalLayer, { point, here, placed });
  document.getElementById("map-fit").addEventListener("click", fit);
  follow.addEventListener("change", centre);
  map.on("dragstart", () => (follow.checked = false));
  map.on("click", (event) => clicked(event.latlng));
  map.getContainer().addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || event.target !== map.getContainer()) return;
    event.preventDefault();
    clicked(map.getCenter());
  });
  new ResizeObserver(() => {
    map.invalidateSize();
    if (awaited) lookAt(...awaited);
  }).observe(document.getElementById("map"));
  onChange(["whole"], () => {
    for (const mark of marks.values()) mark.remove();
    marks.clear();
  });
  onChange(["vehicles", "clock"], drawRovers);
  onChange(["chosen", "session"], centre);
  onChange(["vehicles", "chosen", "queues"], tracks.drawTracks);
  onChange(["vehicles", "queues", "chosen", "tasks"], tracks.drawGoals);
  onChange(["chosen", "ground"], drawGround);
  setInterval(loadGround, REFRESH);
}

/** Look at the ground of the chosen rover again: fence, rally points, mission. */
export async function loadGround() {
  const vehicle = state.chosen;
  if (vehicle === null) return;
  const parts = await Promise.allSettled(["fence", "rally", "mission"].map((part) => get(`/vehicles/${vehicle}/${part}`)));
  const [fence, rally, mission] = parts.map((part) => (part.status === "fulfilled" ? part.value : null));
  state.grounds.set(vehicle, { shapes: fence ? fence.shapes : [], places: rally ? rally.places : [], path: mission ? mission.path : [] });
  change("ground");
}

/** The point of the map for a place, of a rover's frame or on earth; null: not known. */
function point(place, vehicle) {
  const origin = vehicle ? vehicle.origin : null;
  const { latitude, longitude } = place.latitude === undefined && origin ? onEarth(origin, place.north, place.east) : place;
  const isKnown = (latitude ?? null) !== null;
  if (hasTiles) return isKnown ? [latitude, longitude] : null;
  if (isKnown && reference) return offset(reference, latitude, longitude);
  return place.north === undefined ? null : [place.north, place.east];
}

const across = (latitude) => METRES * Math.cos((latitude * Math.PI) / 180); // m of a degree of longitude

/** The place on earth that is so many metres from another one. */
const onEarth = (from, north, east) => ({ latitude: from.latitude + north / METRES, longitude: from.longitude + east / across(from.latitude) });

/** How many metres a place on earth is north and east of another one. */
const offset = (from, latitude, longitude) => [(latitude - from.latitude) * METRES, (longitude - from.longitude) * across(from.latitude)];

/** What the points of a rover's frame depend on: if it changes, they are drawn again. */
const placed = ({ origin }) => `${origin?.latitude} ${origin?.longitude} ${reference?.latitude} ${reference?.longitude}`;

/** The place of a point of the map, for a goal: on earth, or in the rover's frame. */
function placeAt(latlng, vehicle) {
  if (hasTiles) return { latitude: latlng.lat, longitude: latlng.lng };
  if (reference) return onEarth(reference, latlng.lat, latlng.lng);
  return vehicle ? { north: latlng.lat, east: latlng.lng } : null;
}

function here(vehicle) {
  if (vehicle.north === null) return null;
  if (!reference && vehicle.origin) reference = vehicle.origin;
  // the position in the local frame is the smoother one
  if (vehicle.origin) return point({ north: vehicle.north, east: vehicle.east }, vehicle);
  return point({ north: vehicle.north, east: vehicle.east, latitude: vehicle.latitude ?? undefined, longitude: vehicle.longitude ?? undefined }, vehicle);
}

function drawRovers() {
  if (isPast) return;
  for (const vehicle of state.vehicles.values()) {
    const at = here(vehicle);
    if (!at) continue;
    let mark = marks.get(vehicle.vehicle);
    if (!mark) {
      mark = makeMark(vehicle.vehicle, at);
      marks.set(vehicle.vehicle, mark);
    }
    if (mark._at !== `${at}`) {
      mark.setLatLng(at);
      if (follow.checked && vehicle.vehicle === state.chosen) map.panTo(at, { animate: false });
      mark._at = `${at}`;
    }
    const turn = `rotate(${vehicle.heading ?? 0}deg)`;
    if (mark._turn !== turn) {
      mark._svg.style.transform = turn;
      mark._turn = turn;
    }
    const age = dataAge(vehicle);
    const isOld = !vehicle.heard || age === null || age > OLD || !state.stream.isOpen;
    const kind = `rover-mark leaflet-marker-icon leaflet-zoom-animated leaflet-interactive${isOld ? " old" : vehicle.control === "stopped" ? " stopped" : ""}`;
    const element = mark.getElement();
    if (element && mark._kind !== kind) {
      element.className = kind;
      mark._kind = kind;
    }
  }
  if (!isFitted && marks.size) fit();
}

function makeMark(id, at, layer = map) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 28 28");
  const shape = document.createElementNS("http://www.w3.org/2000/svg", "path");
  shape.setAttribute("class", "shape");
  shape.setAttribute("d", "M14 2 L23 25 L14 20 L5 25 Z");
  svg.append(shape);
  const icon = h("div", {}, svg, h("span", { class: "number" }, String(id)));
  const mark = L.marker(at, { icon: L.divIcon({ html: icon, className: "rover-mark", iconSize: [28, 28], iconAnchor: [14, 14] }), keyboard: true, alt: `Rover ${id}`, title: `Rover ${id}` });
  mark.on("click", () => {
    choose(id);
    centre();
  });
  mark.addTo(layer);
  mark._svg = svg;
  return mark;
}

/** Look at all rovers. */
function fit() {
  isFitted = marks.size > 0;
  if (isFitted) lookAt(L.latLngBounds([...marks.values()].map((mark) => mark.getLatLng())).pad(0.4), { maxZoom: hasTiles ? 19 : 4 });
}

// on a phone the map may be hidden, and then has no size to fit anything into: it is done when it is shown
function lookAt(bounds, options) {
  awaited = map.getSize().x ? null : [bounds, options];
  if (!awaited) map.fitBounds(bounds, options);
}

function centre() {
  const mark = marks.get(state.chosen);
  if (mark && isFitted) map.panTo(mark.getLatLng());
  const way = may("submit") ? `Click the map, or press Enter on it, to send rover ${state.chosen} there or to turn it.` : "";
  say(hint, state.chosen === null ? "" : `${way}${hasTiles ? "" : " Grid in metres, north is up."}`);
  loadGround();
}

function drawGround() {
  groundLayer.clearLayers();
  const ground = state.grounds.get(state.chosen);
  const vehicle = state.vehicles.get(state.chosen);
  if (!ground || !vehicle) return;
  drawShapes(ground.shapes, vehicle, groundLayer);
  drawRally(ground.places, vehicle, groundLayer);
  const path = points(ground.path, vehicle);
  if (path.length > 1) L.polyline(path, { color: "#3b6fd4", weight: 2, opacity: 0.5, dashArray: "2 6", interactive: false }).addTo(groundLayer);
}

const points = (places, vehicle) => places.map((place) => point(place, vehicle)).filter(Boolean);

function drawRally(places, vehicle, layer) {
  for (const at of points(places, vehicle)) L.circleMarker(at, { radius: 6, color: "#6a4fb3", weight: 2, fill: false }).bindTooltip("rally point").addTo(layer);
}

function drawShapes(shapes, vehicle, layer) {
  for (const shape of shapes) {
    const style = { color: shape.inclusion ? "#2f8f4e" : "#c4161c", weight: 2, fillOpacity: shape.inclusion ? 0.03 : 0.12, interactive: false };
    if (shape.kind === "polygon") {
      const corners = points(shape.points, vehicle);
      if (corners.length > 2) L.polygon(corners, style).addTo(layer);
    } else {
      const at = point(shape.centre, vehicle);
      // in the grid, a unit is a metre
      if (at) L.circle(at, { ...style, radius: shape.radius }).addTo(layer);
    }
  }
}

/**
 * Show what a plan file would do; null: nothing. "beside" covers part of the map.
 * @param {any} plan
 * @param {Element} [beside]
 */
export function preview(plan, beside) {
  if (!previewLayer) return;
  previewLayer.clearLayers();
  if (!plan) return;
  const vehicle = state.vehicles.get(state.chosen);
  const path = points(plan.path, vehicle);
  if (path.length) {
    L.polyline(path, { color: "#d1602d", weight: 4, interactive: false }).addTo(previewLayer);
    for (const at of path) L.circleMarker(at, { radius: 4, color: "#d1602d", fillOpacity: 1, interactive: false }).addTo(previewLayer);
  }
  drawRally(plan.rally, vehicle, previewLayer);
  drawShapes(plan.fence, vehicle, previewLayer);
  const bounds = L.featureGroup(previewLayer.getLayers()).getBounds();
  if (bounds.isValid()) lookAt(bounds.pad(0.2), { maxZoom: hasTiles ? 20 : 4, paddingBottomRight: covered(beside) });
}

// how much of the map a dialogue covers from the right, else from below
function covered(element) {
  if (!element) return [0, 0];
  const box = element.getBoundingClientRect();
  const { left, right, bottom } = map.getContainer().getBoundingClientRect();
  const isBelow = box.width > (right - left) / 2;
  return isBelow ? [0, Math.max(0, bottom - box.top)] : [Math.max(0, right - box.left), 0];
}

/** Show the track of one task; null: none. */
export function showTrack(track) {
  if (!taskTrackLayer) return;
  taskTrackLayer.clearLayers();
  if (!track) return;
  const vehicle = state.vehicles.get(track.vehicle);
  const lines = [[]];
  for (const [at, each] of track.points.entries()) {
    if (at && tracks.isGap(track.points[at - 1], each)) lines.push([]);
    const shown = point({ north: each[1], east: each[2] }, vehicle);
    if (shown) lines.at(-1).push(shown);
  }
  const places = lines.flat();
  if (places.length < 2) return;
  L.polyline(lines, { color: taskColour(track.id), weight: 7, opacity: 0.5, interactive: false }).addTo(taskTrackLayer);
  lookAt(L.latLngBounds(places).pad(0.4), { maxZoom: hasTiles ? 21 : 4 });
}

/**
 * Show the ways of a recorded run instead of the present; null: the present again.
 * Return a function that shows the rovers at a place of their ways; -1: before the first one.
 */
export function showRun(run) {
  if (!runLayer) return () => {};
  runLayer.clearLayers();
  document.getElementById("map").classList.toggle("past", Boolean(run));
  for (const layer of [trackLayer, goalLayer]) run ? layer.remove() : layer.addTo(map);
  for (const mark of marks.values()) run ? mark.remove() : mark.addTo(map);
  isPast = Boolean(run);
  if (!run) {
    drawRovers();
    return () => {};
  }
  const all = [];
  const shown = new Map();
  for (const rover of run.vehicles) {
    const vehicle = state.vehicles.get(rover.vehicle) ?? null;
    const places = rover.points.map(([, north, east]) => point({ north, east }, vehicle) ?? [north, east]);
    if (places.length > 1) L.polyline(places, { color: taskColour(rover.vehicle), weight: 2, opacity: 0.6, interactive: false }).addTo(runLayer);
    if (places.length) shown.set(rover.vehicle, { mark: makeMark(rover.vehicle, places[0], runLayer), places });
    all.push(...places);
  }
  if (all.length) lookAt(L.latLngBounds(all).pad(0.3), { maxZoom: hasTiles ? 21 : 4 });
  return (vehicle, index, heading) => {
    const { mark, places } = shown.get(vehicle);
    mark.setLatLng(places[Math.max(index, 0)]);
    mark.getElement().classList.toggle("old", index < 0); // it comes to be there
    mark._svg.style.transform = `rotate(${heading ?? 0}deg)`;
  };
}

function clicked(latlng) {
  if (isPast) return;
  const vehicle = state.vehicles.get(state.chosen);
  if (!vehicle) return;
  const place = placeAt(latlng, vehicle);
  const from = here(vehicle);
  if (!place || !from) return;
  const target = "latitude" in place
    ? { kind: "goto_global", latitude: round(place.latitude, 7), longitude: round(place.longitude, 7) }
    : { kind: "goto", north: round(place.north, 2), east: round(place.east, 2) };
  const { lat, lng } = latlng;
  const [north, east] = hasTiles ? offset({ latitude: from[0], longitude: from[1] }, lat, lng) : [lat - from[0], lng - from[1]];
  const heading = round(((Math.atan2(east, north) * 180) / Math.PI + 360) % 360, 1);
  const away = Math.hypot(north, east);
  const id = vehicle.vehicle;
  const buttons = [];
  const button = (words, act) => buttons.push(h("button", { class: "small", type: "button", onclick: () => { map.closePopup(); act(); } }, words));
  if (may("submit")) {
    button(`Go here (${away.toFixed(1)} m)…`, () => confirmGoal(id, target, `Send rover ${id} here, ${away.toFixed(1)} m away?`));
    button(`Face here (${Math.round(heading)}°)…`, () => confirmGoal(id, { kind: "face", heading }, `Turn rover ${id} to ${Math.round(heading)}°?`));
  }
  if (may("fence") && "latitude" in place) button("Fence here…", () => fenceHere(id, place));
  const ground = state.grounds.get(id);
  if (may("fence") && ground && ground.shapes.length) button("Remove its fence…", () => removeFence(id));
  if (!buttons.length) return;
  const box = h("div", {}, h("p", {}, `Rover ${id}`), h("div", { class: "row" }, ...buttons));
  L.popup({ closeButton: true, autoPan: true }).setLatLng(latlng).setContent(box).openOn(map);
  buttons[0].focus({ preventScroll: true });
}

function fenceHere(id, place) {
  ask({
    title: `Fence around this place for rover ${id}?`,
    words: ["The rover must stay inside the circle. This replaces its present fence. A task that would leave it is refused, and a driving rover stops at it."],
    fields: h("div", { class: "fields" }, h("label", {}, "Radius (m)", h("input", { name: "radius", type: "number", min: 1, max: 10000, step: "any", value: FENCE_RADIUS }))),
    word: "Set the fence",
    act: (form) => request("PUT", `/vehicles/${id}/fence`, { circle: { ...place, radius: Number(new FormData(form).get("radius")) } }).then(loadGround),
  });
}

function removeFence(id) {
  ask({
    title: `Remove the fence of rover ${id}?`,
    words: ["Nothing then keeps its tasks inside an area. The present fence is not kept anywhere else."],
    word: "Remove the fence",
    act: () => request("DELETE", `/vehicles/${id}/fence`).then(loadGround),
  });
}

const round = (value, digits) => Number(value.toFixed(digits));

const named = (metres, positive, negative) => (Math.abs(metres) < 0.05 ? "0" : `${+Math.abs(metres).toFixed(1)} ${metres > 0 ? positive : negative}`);

// lines of a metre grid, drawn on canvas tiles
function grid() {
  const layer = L.gridLayer({ tileSize: 256, updateWhenIdle: false });
  layer.createTile = (coords) => {
    const tile = document.createElement("canvas");
    tile.width = tile.height = 256;
    const pen = tile.getContext("2d");
    const size = 256 / 2 ** coords.z; // m
    const step = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((each) => each * 2 ** coords.z >= 48) ?? 5000;
    const style = getComputedStyle(document.documentElement);
    pen.strokeStyle = style.getPropertyValue("--line");
    pen.fillStyle = style.getPropertyValue("--soft");
    pen.font = "10px system-ui";
    const west = coords.x * size;
    const north = -coords.y * size;
    // from one line before: its words reach into this tile
    for (let east = (Math.ceil(west / step) - 1) * step; east < west + size; east += step) {
      const x = Math.round((east - west) * 2 ** coords.z) + 0.5;
      pen.strokeRect(x, -1, 512, 512);
      if (Math.round(north / step) % 2 === 0) pen.fillText(named(east, "E", "W"), x + 2, 10);
    }
    for (let at = Math.floor(north / step) * step; at > north - size - step; at -= step) {
      const y = Math.round((north - at) * 2 ** coords.z) + 0.5;
      pen.strokeRect(-1, y, 512, 512);
      if (Math.round(west / step) % 2 === 0) pen.fillText(named(at, "N", "S"), 2, y - 2);
    }
    return tile;
  };
  return layer;
}
