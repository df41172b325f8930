"use strict";
// The picture viewer: two pictures under one view, and their values.

const view = {
  a: null, b: null, mode: "side", stops: 0, wipe: 0.5, showsB: false,
  zoom: null, // screen pixels per picture pixel; null fits the panel
  centre: [0, 0], cursor: [0, 0], range: "auto", map: null, turn: 0,
};
const canvas = byId("canvas");
const context = canvas.getContext("2d");
const MODES = ["side", "wipe", "flip", "error", "signed"];

const isMap = () => view.mode === "error" || view.mode === "signed";
const panelWidth = () => (view.mode === "side" ? canvas.clientWidth / 2 : canvas.clientWidth);

/** Columns and rows that the view is laid out for. */
function extent() {
  const shown = [view.a, view.b].filter(Boolean);
  return [Math.max(1, ...shown.map((p) => p.width)), Math.max(1, ...shown.map((p) => p.height))];
}

function fitZoom() {
  const [width, height] = extent();
  return 0.97 * Math.min(panelWidth() / width, canvas.clientHeight / height);
}

const zoomNow = () => view.zoom ?? fitZoom();

/** Where the upper left corner of the pictures lies in a panel. */
function corner() {
  const zoom = zoomNow();
  const [width, height] = extent();
  const [cx, cy] = view.zoom === null ? [width / 2, height / 2] : view.centre;
  // On whole pixels, so that neighbours stay equally large.
  return [Math.round(panelWidth() / 2 - cx * zoom), Math.round(canvas.clientHeight / 2 - cy * zoom)];
}

/** Loads the two chosen pictures, then draws. */
async function load(a, b) {
  const turn = ++view.turn;
  byId("viewer").dataset.ready = "false";
  const [first, second] = await Promise.all([a, b].map((p) => (p ? decode(p) : null)));
  if (turn !== view.turn) return; // another choice came in between
  Object.assign(view, { a: first, b: second, map: null });
  byId("picture-a").value = a ? a.index : "";
  byId("picture-b").value = b ? b.index : "";
  const [width, height] = extent();
  view.cursor = [Math.min(view.cursor[0], width - 1), Math.min(view.cursor[1], height - 1)];
  draw();
  byId("viewer").dataset.ready = "true";
}

/** The pictures of a scene into the lists; a reference becomes B. */
function viewScene(scene) {
  const own = pictures.filter((p) => scene && p.scene === scene.name);
  byId("viewer").hidden = !own.length;
  byId("viewer-empty").hidden = own.length > 0;
  for (const id of ["picture-a", "picture-b"]) {
    byId(id).replaceChildren(...own.map((p) => html("option", { value: p.index }, p.label)));
  }
  view.zoom = null;
  if (!own.length) return;
  const reference = own.find((p) => p.label === "reference") ?? own.at(-1);
  const chosen = pictureOf(scene, state.configuration) ?? own.find((p) => p !== reference) ?? reference;
  view.cursor = [Math.floor(reference.width / 2), Math.floor(reference.height / 2)];
  load(chosen, reference);
}

/** The picture of a configuration with the largest budget that was kept. */
function pictureOf(scene, name) {
  const configuration = scene?.configurations.find((c) => c.name === name);
  if (!configuration) return null;
  const labels = configuration.rungs.map((r) => `${name}, ${r.budget}`).toReversed();
  const own = pictures.filter((p) => p.scene === scene.name);
  for (const label of [...labels, name]) {
    const found = own.find((p) => p.label === label);
    if (found) return found;
  }
  return null;
}

/** Draws everything anew; cheap, since toned pictures are kept. */
function draw() {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !view.a || !view.b) return;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  }
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.fillStyle = "#17191d";
  context.fillRect(0, 0, width, height);
  if (view.mode === "side") {
    drawPanel(toned(view.a, view.stops), 0, 0, width / 2, `A  ${view.a.label}`);
    drawPanel(toned(view.b, view.stops), width / 2, width / 2, width, `B  ${view.b.label}`);
    separator(width / 2);
  } else if (view.mode === "wipe") {
    const at = Math.round(view.wipe * width);
    drawPanel(toned(view.a, view.stops), 0, 0, at, `A  ${view.a.label}`);
    drawPanel(toned(view.b, view.stops), 0, at, width, `B  ${view.b.label}`, true);
    separator(at);
  } else if (view.mode === "flip") {
    const shown = view.showsB ? view.b : view.a;
    drawPanel(toned(shown, view.stops), 0, 0, width, `${view.showsB ? "B" : "A"}  ${shown.label}`);
  } else {
    drawPanel(mapCanvas(), 0, 0, width, `${view.mode === "error" ? "Relative error of" : "Signed difference of"} ${view.a.label} to ${view.b.label}`);
  }
  showControls();
  showValues();
}

/** One picture, its panel from `origin` on, seen between `left` and `right`. */
function drawPanel(picture, origin, left, right, label, labelRight = false) {
  const zoom = zoomNow();
  const [x, y] = corner();
  context.save();
  context.beginPath();
  context.rect(left, 0, right - left, canvas.clientHeight);
  context.clip();
  context.imageSmoothingEnabled = zoom * (window.devicePixelRatio || 1) < 1;
  context.drawImage(picture, origin + x, y, picture.width * zoom, picture.height * zoom);
  markCursor(origin + x + view.cursor[0] * zoom, y + view.cursor[1] * zoom, zoom);
  context.font = "13px system-ui, sans-serif";
  const width = Math.min(context.measureText(label).width + 16, right - left);
  const at = labelRight ? right - width - 8 : left + 8;
  context.fillStyle = "rgb(0 0 0 / 62%)";
  context.fillRect(at, 8, width, 24);
  context.fillStyle = "#fff";
  context.fillText(label, at + 8, 24);
  context.restore();
}

/** The pixel under the cursor: seen on any ground. */
function markCursor(x, y, zoom) {
  const size = Math.max(zoom, 6), shift = (zoom - size) / 2;
  for (const [colour, grow] of [["#000", 2], ["#fff", 1]]) {
    context.strokeStyle = colour;
    context.lineWidth = 1;
    context.strokeRect(x + shift - grow + 0.5, y + shift - grow + 0.5, size + 2 * grow - 1, size + 2 * grow - 1);
  }
}

function separator(x) {
  context.fillStyle = "#fff";
  context.fillRect(x - 1, 0, 2, canvas.clientHeight);
}

/** The error map of A and B, made anew when something of it changed. */
function mapCanvas() {
  const key = [view.a.index, view.b.index, view.mode, view.range].join();
  if (view.map?.key !== key) {
    const signed = view.mode === "signed";
    const difference = relativeDifference(view.a, view.b, signed);
    const range = view.range === "auto" ? usualRange(difference.values) : Number(view.range);
    view.map = { key, range, canvas: errorMap(difference, signed, range) };
  }
  return view.map.canvas;
}

/** Controls as the view is. */
function showControls() {
  byId("exposure").value = view.stops;
  byId("exposure-value").textContent = `${view.stops > 0 ? "+" : ""}${minus(String(view.stops))} stops`;
  byId("wipe").value = Math.round(100 * view.wipe);
  byId("wipe-label").hidden = view.mode !== "wipe";
  byId("map-label").hidden = byId("map-legend").hidden = !isMap();
  byId("zoom-value").textContent = view.zoom === null ? "fit" : `${number(100 * view.zoom)} %`;
  for (const button of byId("modes").children) {
    const on = button.dataset.mode === view.mode;
    button.setAttribute("aria-checked", String(on));
    button.tabIndex = on ? 0 : -1;
  }
  const data = byId("viewer").dataset;
  [data.mode, data.shows] = [view.mode, view.showsB ? "b" : "a"];
  if (!isMap()) return;
  const signed = view.mode === "signed";
  byId("map-bar").style.background = gradient(signed ? DIVERGING : HEAT);
  byId("map-low").textContent = signed ? minus(percent(-view.map.range)) : "0";
  byId("map-high").textContent = `${signed ? "+" : ""}${percent(view.map.range)}`;
}

const valuesAt = (p, [x, y]) => (x < p.width && y < p.height ? [0, 1, 2].map((c) => p.rgb[3 * (y * p.width + x) + c]) : [null, null, null]);
const exact = (v) => (v === null ? "–" : Number.isNaN(v) ? "NaN" : Number.isFinite(v) ? number(v) : v > 0 ? "∞" : "−∞");

/** Values of A and B under the cursor, exact ones as `data-` attributes. */
function showValues() {
  const [a, b] = [valuesAt(view.a, view.cursor), valuesAt(view.b, view.cursor)];
  const difference = a.map((v, c) => (v === null || b[c] === null ? null : v - b[c]));
  const rows = { "value-a": a, "value-b": b, "value-difference": difference };
  for (const [id, values] of Object.entries(rows)) {
    const row = byId(id);
    values.forEach((v, c) => {
      if (v === null) delete row.dataset["rgb"[c]];
      else row.dataset["rgb"[c]] = v;
      row.cells[c + 1].textContent = exact(v);
    });
  }
  const relative = byId("value-relative");
  difference.forEach((d, c) => { relative.cells[c + 1].textContent = d === null || !b[c] ? "–" : percent(d / b[c]); });
  byId("pixel-x").textContent = view.cursor[0];
  byId("pixel-y").textContent = view.cursor[1];
}

/** For those who do not see the table change. */
function speak() {
  const text = (p) => valuesAt(p, view.cursor).map(exact).join(", ");
  byId("viewer-status").textContent = `Pixel ${view.cursor.join(", ")}. A ${text(view.a)}. B ${text(view.b)}.`;
}

function setMode(mode) {
  view.mode = mode;
  draw();
}

/** Zooms by `factor`, the picture under `at` (in a panel) staying there. */
function zoomBy(factor, at) {
  const before = zoomNow();
  const after = Math.min(Math.max(before * factor, 0.02), 256);
  const [x, y] = corner();
  const point = at ?? [x + (view.cursor[0] + 0.5) * before, y + (view.cursor[1] + 0.5) * before];
  const fixed = [(point[0] - x) / before, (point[1] - y) / before];
  view.centre = [fixed[0] - (point[0] - panelWidth() / 2) / after, fixed[1] - (point[1] - canvas.clientHeight / 2) / after];
  view.zoom = after;
  draw();
}

function fit() {
  view.zoom = null;
  draw();
}

/** One picture pixel is one CSS pixel, around the cursor. */
function actualPixels() {
  view.centre = [view.cursor[0] + 0.5, view.cursor[1] + 0.5];
  view.zoom = 1;
  draw();
}

/** Shows a pixel at a size at which it can be seen. */
function goTo(x, y) {
  view.cursor = [x, y];
  view.centre = [x + 0.5, y + 0.5];
  view.zoom = Math.max(zoomNow(), 8);
  draw();
  speak();
}

function moveCursor(dx, dy) {
  const [width, height] = extent();
  view.cursor = [Math.min(Math.max(view.cursor[0] + dx, 0), width - 1), Math.min(Math.max(view.cursor[1] + dy, 0), height - 1)];
  keepCursorInSight();
  draw();
  speak();
}

function keepCursorInSight() {
  if (view.zoom === null) return;
  const sizes = [panelWidth(), canvas.clientHeight];
  for (const k of [0, 1]) {
    const reach = Math.max(sizes[k] / 2 / view.zoom - 1, 0);
    view.centre[k] = Math.min(Math.max(view.centre[k], view.cursor[k] + 0.5 - reach), view.cursor[k] + 0.5 + reach);
  }
}

function setExposure(stops) {
  view.stops = Math.min(Math.max(stops, -8), 8);
  draw();
}
