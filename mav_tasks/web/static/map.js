// The map: a metre grid, or tiles; rovers, tracks, goals, mission, fence, rally points.

import { get, request } from "./api.js";
import { confirmGoal, may } from "./acts.js";
import { ask } from "./dialogs.js";
import { button, draw, h, make } from "./dom.js";
import { ageOf, change, choose, onChange, state } from "./store.js";
import * as tracks from "./tracks.js";
import { taskColour } from "./words.js";

/* global L: Leaflet, loaded before this module */

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
  const { tiles } = state.session;
  hasTiles = Boolean(tiles);
  map = L.map("map", {
    crs: hasTiles ? L.CRS.EPSG3857 : L.CRS.Simple, preferCanvas: true, attributionControl: hasTiles, zoomSnap: 0.25,
    minZoom: hasTiles ? tiles.min_zoom : -4, maxZoom: hasTiles ? Math.max(tiles.max_zoom, 22) : 7,
    fadeAnimation: false, zoomAnimation: !matchMedia("(prefers-reduced-motion: reduce)").matches,
  });
  if (hasTiles) {
    map.attributionControl.setPrefix(false);
    const attribution = make(h("span", {}, tiles.attribution)).innerHTML; // a file may hold anything
    L.tileLayer(tiles.url, { minNativeZoom: tiles.min_zoom, maxNativeZoom: tiles.max_zoom, maxZoom: 22, attribution }).addTo(map);
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
  map.on("keypress", ({ originalEvent: { key, target } }) => key === "Enter" && target === map.getContainer() && clicked(map.getCenter()));
  new ResizeObserver(() => {
    map.invalidateSize();
    if (awaited) lookAt(...awaited);
  }).observe(document.getElementById("map"));
  onChange(["vehicles", "clock", "whole"], drawRovers);
  onChange(["chosen", "session"], centre);
  onChange(["vehicles", "chosen", "queues"], tracks.drawTracks);
  onChange(["vehicles", "queues", "chosen", "tasks"], tracks.drawGoals);
  onChange(["chosen", "ground"], () => {
    groundLayer.clearLayers();
    const [ground, vehicle] = [state.grounds.get(state.chosen), state.vehicles.get(state.chosen)];
    if (ground && vehicle) drawGround(groundLayer, ground, vehicle, { color: "#3b6fd4", weight: 2, opacity: 0.5, dashArray: "2 6" });
  });
  setInterval(loadGround, REFRESH);
}

/** Look at the ground of the chosen rover again: fence, rally points, mission. */
export async function loadGround() {
  const vehicle = state.chosen;
  if (vehicle === null) return;
  const part = (name, key) => get(`/vehicles/${vehicle}/${name}`).then((found) => found[key], () => []);
  const [fence, rally, path] = await Promise.all([part("fence", "shapes"), part("rally", "places"), part("mission", "path")]);
  state.grounds.set(vehicle, { fence, rally, path });
  change("ground");
}

/** The point of the map for a place, of a rover's frame or on earth; null: not known. */
function point(place, vehicle) {
  const { latitude = null, longitude } = place.latitude === undefined && vehicle?.origin ? onEarth(vehicle.origin, place.north, place.east) : place;
  if (hasTiles) return latitude === null ? null : [latitude, longitude];
  if (latitude !== null && reference) return offset(reference, latitude, longitude);
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
const placeAt = ({ lat, lng }) => (hasTiles ? { latitude: lat, longitude: lng } : reference ? onEarth(reference, lat, lng) : { north: lat, east: lng });

function here({ north, east, latitude, longitude, origin }) {
  if (north === null) return null;
  reference ??= origin;
  // the position in the local frame is the smoother one
  return origin || latitude === null ? point({ north, east }, { origin }) : point({ north, east, latitude, longitude });
}

function drawRovers() {
  if (isPast) return;
  for (const [id, mark] of marks) if (!state.vehicles.has(id) && marks.delete(id)) mark.remove();
  for (const vehicle of state.vehicles.values()) {
    const { vehicle: id, heard, heading, control } = vehicle;
    const at = here(vehicle);
    if (!at) continue;
    const mark = marks.get(id) ?? makeMark(id, at, map);
    marks.set(id, mark);
    if (follow.checked && id === state.chosen && !mark.getLatLng().equals(at)) map.panTo(at, { animate: false });
    const age = ageOf(vehicle, "data_age");
    const isOld = !heard || age === null || age > OLD || state.stream !== "open";
    turnMark(mark, at, heading, isOld ? "old" : control);
  }
  if (!isFitted && marks.size) fit();
}

function makeMark(id, at, layer) {
  const shape = '<svg viewBox="0 0 28 28"><path class="shape" d="M14 2 L23 25 L14 20 L5 25 Z"/></svg>';
  const icon = L.divIcon({ html: `${shape}<span class="number">${Number(id)}</span>`, className: "rover-mark", iconSize: [28, 28], iconAnchor: [14, 14] });
  const mark = L.marker(at, { icon, keyboard: true, alt: `Rover ${id}`, title: `Rover ${id}` });
  mark.on("click", () => choose(id));
  return mark.addTo(layer);
}

function turnMark(mark, at, heading, kind) {
  if (!mark.getLatLng().equals(at)) mark.setLatLng(at);
  const element = mark.getElement();
  for (const each of ["old", "stopped"]) element.classList.toggle(each, each === kind);
  element.firstChild.style.transform = `rotate(${heading ?? 0}deg)`;
}

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
  draw(document.getElementById("map-hint"), state.chosen === null ? "" : `${way}${hasTiles ? "" : " Grid in metres, north is up."}`);
  loadGround();
}

const points = (places, vehicle) => places.map((place) => point(place, vehicle)).filter(Boolean);

function drawGround(layer, { fence, rally, path }, vehicle, style) {
  const way = points(path, vehicle);
  if (way.length > 1) L.polyline(way, { ...style, interactive: false }).addTo(layer);
  for (const at of points(rally, vehicle)) L.circleMarker(at, { radius: 6, color: "#6a4fb3", weight: 2, fill: false }).bindTooltip("rally point").addTo(layer);
  for (const { kind, inclusion, radius, ...shape } of fence) {
    const look = { color: inclusion ? "#2f8f4e" : "#c4161c", weight: 2, fillOpacity: inclusion ? 0.03 : 0.12, interactive: false };
    const corners = points(kind === "polygon" ? shape.points : [shape.centre], vehicle);
    if (kind === "polygon" && corners.length > 2) L.polygon(corners, look).addTo(layer);
    if (kind !== "polygon" && corners.length) L.circle(corners[0], { ...look, radius }).addTo(layer); // in the grid, a unit is a metre
  }
}

/** Show what a plan file would do; null: nothing. The dialogue beside it covers part of the map. */
export function preview(plan, beside) {
  previewLayer.clearLayers();
  if (!plan) return;
  const vehicle = state.vehicles.get(state.chosen);
  drawGround(previewLayer, plan, vehicle, { color: "#d1602d", weight: 4 });
  for (const at of points(plan.path, vehicle)) L.circleMarker(at, { radius: 4, color: "#d1602d", fillOpacity: 1, interactive: false }).addTo(previewLayer);
  const bounds = L.featureGroup(previewLayer.getLayers()).getBounds();
  if (bounds.isValid()) lookAt(bounds.pad(0.2), { maxZoom: hasTiles ? 20 : 4, paddingBottomRight: covered(beside) });
}

// how much of the map a dialogue covers from the right, else from below
function covered(element) {
  const box = element.getBoundingClientRect();
  const { left, right, bottom } = map.getContainer().getBoundingClientRect();
  const isBelow = box.width > (right - left) / 2;
  return isBelow ? [0, Math.max(0, bottom - box.top)] : [Math.max(0, right - box.left), 0];
}

/** Show the track of one task; null: none. */
export function showTrack(track) {
  taskTrackLayer.clearLayers();
  if (!track) return;
  const lines = tracks.waysOf(track.points, state.vehicles.get(track.vehicle)).map(({ places }) => places);
  const places = lines.flat();
  if (places.length < 2) return;
  L.polyline(lines, { color: taskColour(track.id), weight: 7, opacity: 0.5, interactive: false }).addTo(taskTrackLayer);
  lookAt(L.latLngBounds(places).pad(0.4), { maxZoom: hasTiles ? 21 : 4 });
}

/**
 * Show the ways of a recorded run instead of the present; null: the present again. Return what shows a rover at a place
 * of its way; -1: before the first one.
 */
export function showRun(run) {
  runLayer.clearLayers();
  map.getContainer().classList.toggle("past", Boolean(run));
  for (const each of [trackLayer, goalLayer, ...marks.values()]) run ? each.remove() : each.addTo(map);
  isPast = Boolean(run);
  if (!run) return drawRovers();
  const all = [];
  const shown = new Map();
  for (const rover of run.vehicles) {
    const vehicle = state.vehicles.get(rover.vehicle);
    const places = rover.points.map(([, north, east]) => point({ north, east }, vehicle) ?? [north, east]);
    if (places.length > 1) L.polyline(places, { color: taskColour(rover.vehicle), weight: 2, opacity: 0.6, interactive: false }).addTo(runLayer);
    if (places.length) shown.set(rover.vehicle, { mark: makeMark(rover.vehicle, places[0], runLayer), places });
    all.push(...places);
  }
  if (all.length) lookAt(L.latLngBounds(all).pad(0.3), { maxZoom: hasTiles ? 21 : 4 });
  return (vehicle, index, heading) => {
    const { mark, places } = shown.get(vehicle);
    turnMark(mark, places[Math.max(index, 0)], heading, index < 0 && "old"); // it comes to be there
  };
}

function clicked(latlng) {
  if (isPast) return;
  const vehicle = state.vehicles.get(state.chosen);
  const from = vehicle && here(vehicle);
  if (!from) return;
  const place = placeAt(latlng);
  const target = "latitude" in place
    ? { kind: "goto_global", latitude: round(place.latitude, 7), longitude: round(place.longitude, 7) }
    : { kind: "goto", north: round(place.north, 2), east: round(place.east, 2) };
  const { lat, lng } = latlng;
  const [north, east] = hasTiles ? offset({ latitude: from[0], longitude: from[1] }, lat, lng) : [lat - from[0], lng - from[1]];
  const heading = round(((Math.atan2(east, north) * 180) / Math.PI + 360) % 360, 1);
  const away = Math.hypot(north, east);
  const id = vehicle.vehicle;
  const option = (isOffered, words, act) => isOffered && button(words, act);
  const box = make(h("div", {}, h("p", {}, `Rover ${id}`), h("div", { class: "row" },
    option(may("submit"), `Go here (${away.toFixed(1)} m)…`, () => confirmGoal(id, target, `Send rover ${id} here, ${away.toFixed(1)} m away?`)),
    option(may("submit"), `Face here (${Math.round(heading)}°)…`, () => confirmGoal(id, { kind: "face", heading }, `Turn rover ${id} to ${Math.round(heading)}°?`)),
    option(may("fence") && "latitude" in place, "Fence here…", () => fenceHere(id, place)),
    option(may("fence") && state.grounds.get(id)?.fence.length, "Remove its fence…", () => removeFence(id)))));
  box.onclick = () => map.closePopup();
  const first = box.querySelector("button");
  if (!first) return;
  L.popup({ closeButton: true, autoPan: true }).setLatLng(latlng).setContent(box).openOn(map);
  first.focus({ preventScroll: true });
}

function fenceHere(id, place) {
  ask({
    title: `Fence around this place for rover ${id}?`,
    words: ["The rover must stay inside the circle. This replaces its present fence. A task that would leave it is refused, and a driving rover stops at it."],
    fields: [h("div", { class: "fields" }, h("label", {}, "Radius (m)", h("input", { name: "radius", type: "number", min: 1, max: 10000, step: "any", value: FENCE_RADIUS })))],
    word: "Set the fence",
    act: (form) => request("PUT", `/vehicles/${id}/fence`, { circle: { ...place, radius: form.elements.radius.valueAsNumber } }).then(loadGround),
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
    const tile = make(h("canvas", { width: 256, height: 256 }));
    const { color, borderTopColor } = getComputedStyle(document.querySelector(".map-foot"));
    const pen = Object.assign(tile.getContext("2d"), { strokeStyle: borderTopColor, fillStyle: color, font: "10px system-ui" });
    const scale = 2 ** coords.z; // px of a metre
    const step = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((each) => each * scale >= 48) ?? 5000;
    const [west, north] = [(coords.x * 256) / scale, (-coords.y * 256) / scale];
    // from one line before: its words reach into this tile
    for (let n = -1; n * step * scale < 256 + step * scale; n += 1) {
      const [east, at] = [(Math.ceil(west / step) + n) * step, (Math.floor(north / step) - n) * step];
      const [x, y] = [Math.round((east - west) * scale) + 0.5, Math.round((north - at) * scale) + 0.5];
      pen.strokeRect(x, -1, 512, 512);
      pen.strokeRect(-1, y, 512, 512);
      if (Math.round(north / step) % 2 === 0) pen.fillText(named(east, "E", "W"), x + 2, 10);
      if (Math.round(west / step) % 2 === 0) pen.fillText(named(at, "N", "S"), 2, y - 2);
    }
    return tile;
  };
  return layer;
}
