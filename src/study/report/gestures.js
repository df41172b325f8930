"use strict";
// Mouse, touch and keys of the picture viewer.

/** Place of a pointer in its panel, and in the whole canvas. */
function pointerPlace(event) {
  const box = canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  return { x, y, panel: [x % panelWidth(), y] };
}

/** The cursor goes to the pixel under the pointer, if there is one. */
function pointAt({ panel }) {
  const zoom = zoomNow();
  const [left, top] = corner();
  const at = [Math.floor((panel[0] - left) / zoom), Math.floor((panel[1] - top) / zoom)];
  const [width, height] = extent();
  if (at[0] >= 0 && at[1] >= 0 && at[0] < width && at[1] < height) view.cursor = at;
}

let drag = null;

canvas.addEventListener("pointerdown", (event) => {
  if (!view.a) return;
  const place = pointerPlace(event);
  const onWipe = view.mode === "wipe" && Math.abs(place.x - view.wipe * canvas.clientWidth) < 14;
  const [width, height] = extent();
  const centre = view.zoom === null ? [width / 2, height / 2] : [...view.centre];
  drag = { x: place.x, y: place.y, centre, onWipe, moved: false };
  canvas.setPointerCapture(event.pointerId);
});

canvas.addEventListener("pointermove", (event) => {
  if (!view.a || !view.b) return;
  const place = pointerPlace(event);
  if (drag?.onWipe) {
    view.wipe = Math.min(Math.max(place.x / canvas.clientWidth, 0), 1);
  } else if (drag) {
    // A click that trembles is no drag.
    drag.moved ||= Math.hypot(place.x - drag.x, place.y - drag.y) > 3;
    if (!drag.moved) return;
    view.zoom ??= zoomNow();
    view.centre = [drag.centre[0] - (place.x - drag.x) / view.zoom, drag.centre[1] - (place.y - drag.y) / view.zoom];
  } else {
    const near = view.mode === "wipe" && Math.abs(place.x - view.wipe * canvas.clientWidth) < 14;
    canvas.style.cursor = near ? "col-resize" : "crosshair";
    pointAt(place);
  }
  draw();
});

for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { drag = null; });

// The page scrolls under the wheel until the picture has been clicked.
canvas.addEventListener("wheel", (event) => {
  if (!view.a || (document.activeElement !== canvas && !event.ctrlKey)) return;
  event.preventDefault();
  zoomBy(2 ** (-event.deltaY / 300), pointerPlace(event).panel);
}, { passive: false });

canvas.addEventListener("dblclick", fit);

const VIEWER_KEYS = {
  ArrowLeft: (by) => moveCursor(-by, 0),
  ArrowRight: (by) => moveCursor(by, 0),
  ArrowUp: (by) => moveCursor(0, -by),
  ArrowDown: (by) => moveCursor(0, by),
  "+": () => zoomBy(Math.SQRT2),
  "=": () => zoomBy(Math.SQRT2),
  "-": () => zoomBy(Math.SQRT1_2),
  0: fit,
  9: actualPixels,
  "[": () => setExposure(view.stops - 0.5),
  "]": () => setExposure(view.stops + 0.5),
  ",": () => moveWipe(-0.05),
  ".": () => moveWipe(0.05),
  x: exchange,
  " ": flip,
};

function moveWipe(by) {
  view.wipe = Math.min(Math.max(view.wipe + by, 0), 1);
  setMode("wipe");
}

function exchange() {
  if (view.a && view.b) load(view.b, view.a);
}

/** From another mode: shows A; from then on the other of the two. */
function flip() {
  view.showsB = view.mode === "flip" && !view.showsB;
  setMode("flip");
  byId("viewer-status").textContent = `Showing ${view.showsB ? "B" : "A"}`;
}

canvas.addEventListener("keydown", (event) => {
  if (!view.a || !view.b || event.ctrlKey || event.metaKey || event.altKey) return;
  const mode = MODES[Number(event.key) - 1];
  const action = mode ? () => setMode(mode) : VIEWER_KEYS[event.key];
  if (!action) return;
  event.preventDefault();
  event.stopPropagation();
  action(event.shiftKey ? 10 : 1);
});

byId("modes").addEventListener("click", (event) => {
  if (event.target.dataset.mode) setMode(event.target.dataset.mode);
});

byId("modes").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
  if (!step) return;
  event.preventDefault();
  setMode(MODES[(MODES.indexOf(view.mode) + step + MODES.length) % MODES.length]);
  byId("modes").querySelector("[aria-checked=true]").focus();
});

for (const id of ["picture-a", "picture-b"]) {
  byId(id).addEventListener("change", () => load(pictures[byId("picture-a").value], pictures[byId("picture-b").value]));
}
byId("exchange").addEventListener("click", exchange);
byId("exposure").addEventListener("input", (event) => setExposure(Number(event.target.value)));
byId("wipe").addEventListener("input", (event) => { view.wipe = event.target.value / 100; draw(); });
byId("zoom-in").addEventListener("click", () => zoomBy(Math.SQRT2));
byId("zoom-out").addEventListener("click", () => zoomBy(Math.SQRT1_2));
byId("zoom-one").addEventListener("click", actualPixels);
byId("zoom-fit").addEventListener("click", fit);
byId("map-range").append(
  html("option", { value: "auto" }, "auto"),
  ...[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5].map((v) => html("option", { value: v }, `${Math.round(100 * v)} %`)),
);
byId("map-range").addEventListener("change", (event) => { view.range = event.target.value; draw(); });
new ResizeObserver(draw).observe(canvas);
