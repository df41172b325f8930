"use strict";
// A small chart: curves with bands and markers, or bars; linear or logarithmic.
// One tab stop per chart; arrow keys go from point to point.

/** Axis of `kind` "linear", "log" or "log2" over `values`; null without any. */
function makeAxis(kind, label, values, fixed = null) {
  const log = kind !== "linear";
  const usable = values.filter((v) => finite(v) && (!log || v > 0)).map((v) => (log ? Math.log10(v) : v));
  if (!usable.length && !fixed) return null;
  let [low, high] = fixed ?? [Math.min(...usable), Math.max(...usable)];
  if (!fixed) {
    const margin = Math.max(0.05 * (high - low), log ? 0.04 : 0);
    [low, high] = [low - margin, high + margin];
  }
  if (!(high > low)) high = low + 1;
  const at = (v) => Math.min(Math.max(((log ? Math.log10(v) : v) - low) / (high - low), -0.02), 1.02);
  const holds = (v) => {
    const t = ((log ? Math.log10(v) : v) - low) / (high - low);
    return t > -1e-6 && t < 1 + 1e-6;
  };
  return { kind, label, low, high, at, holds };
}

/** Grid lines: [value, text or null]. */
function axisTicks(axis, room) {
  if (axis.kind === "linear") return evenTicks(axis, room);
  if (axis.kind === "log2") {
    const octave = Math.log10(2);
    const first = Math.ceil(axis.low / octave), last = Math.floor(axis.high / octave);
    const step = Math.max(1, Math.ceil((last - first) / room));
    const ticks = [];
    for (let n = first; n <= last; n++) {
      const text = n < 0 ? `1/${2 ** -n}` : String(2 ** n);
      ticks.push([2 ** n, n % step === 0 ? text : null]);
    }
    if (ticks.length) return ticks;
  }
  return decadeTicks(axis, room);
}

function evenTicks(axis, room) {
  const rough = (axis.high - axis.low) / Math.min(room, 6);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  const ticks = [];
  for (let n = Math.ceil(axis.low / step - 1e-9); n * step <= axis.high + 1e-9 * step; n++) {
    const v = n * step;
    ticks.push([v, Math.abs(v) >= 1e5 ? number(v) : minus(v.toFixed(digits))]);
  }
  return ticks;
}

function decadeTicks(axis, room) {
  const span = axis.high - axis.low;
  // Within a factor of two there are too few round digits: even steps.
  if (span < 0.35) return evenTicks({ low: 10 ** axis.low, high: 10 ** axis.high }, room);
  const step = Math.max(1, Math.ceil(span / Math.min(room, 10)));
  const named = span > 3 ? [1] : span > 0.9 ? [1, 2, 5] : [1, 2, 3, 4, 5, 6, 7, 8, 9];
  const ticks = [];
  for (let decade = Math.floor(axis.low); decade <= Math.ceil(axis.high); decade++) {
    for (let digit = 1; digit < 10; digit++) {
      const at = decade + Math.log10(digit);
      if (at < axis.low || at > axis.high || (step > 1 && digit > 1)) continue;
      const has = named.includes(digit) && (((decade % step) + step) % step) === 0;
      ticks.push([10 ** at, has ? decimal(digit, decade) : null]);
    }
  }
  return ticks;
}

function decimal(digit, decade) {
  if (decade >= -3 && decade < 0) return (digit * 10 ** decade).toFixed(-decade);
  if (decade >= 0 && decade <= 4) return String(digit * 10 ** decade);
  return minus(`${digit}e${decade}`);
}

/**
 * Draws `chart` into `figure`:
 * { title, hint, x, y, series: [{ name, points: [{ x, y, low, high, hollow, text }], line }],
 *   guides: [{ label, points, at, below, before }], bars, height }.
 */
function drawChart(figure, chart) {
  figure.replaceChildren();
  if (chart.title) figure.append(html("figcaption", {}, chart.title));
  if (!chart.x || !chart.y || !chart.series.length) {
    figure.append(html("p", { class: "empty" }, chart.empty ?? "Nothing to draw yet."));
    return;
  }
  const width = Math.max(280, figure.clientWidth || 640);
  const height = chart.height ?? Math.round(Math.min(460, width * 0.62));
  const frame = { left: 64, top: 10, right: width - 14, bottom: height - 46 };
  const place = {
    x: (v) => frame.left + chart.x.at(v) * (frame.right - frame.left),
    y: (v) => frame.bottom - chart.y.at(v) * (frame.bottom - frame.top),
  };
  const points = chart.series.reduce((n, s) => n + s.points.length, 0);
  const root = svg("svg", {
    viewBox: `0 0 ${width} ${height}`, width, height, tabindex: 0, role: "application",
    "aria-label": `${chart.name}: ${chart.series.length} configurations, ${points} points. Arrow keys move between them, Enter selects.`,
  });
  const clip = `clip-${figure.id}`;
  const { left, top, right, bottom } = frame;
  root.append(svg("clipPath", { id: clip }, svg("rect", { x: left, y: top - 6, width: right - left + 6, height: bottom - top + 6 })));
  drawAxes(root, chart, frame, place);
  const plane = svg("g", { "clip-path": `url(#${clip})` });
  root.append(plane);
  for (const guide of chart.guides ?? []) drawGuide(plane, chart, guide, frame, place);
  for (const series of chart.series) {
    plane.append(chart.bars ? drawBar(series, place, frame, chart) : drawSeries(series, chart, place));
  }
  figure.append(root);
  if (chart.hint) figure.append(html("p", { class: "hint" }, chart.hint));
  listen(root, chart, place);
}

function drawAxes(root, chart, frame, place) {
  const grid = svg("g", { class: "grid" }), texts = svg("g", { class: "ticks" });
  const across = Math.max(3, Math.floor((frame.right - frame.left) / 58));
  const up = Math.max(3, Math.floor((frame.bottom - frame.top) / 30));
  if (!chart.bars) {
    for (const [v, text] of axisTicks(chart.x, across)) {
      const x = place.x(v);
      grid.append(svg("line", { x1: x, x2: x, y1: frame.top, y2: frame.bottom, class: text ? "main" : null }));
      if (text) texts.append(svg("text", { x, y: frame.bottom + 17, "text-anchor": "middle" }, text));
    }
  }
  for (const [v, text] of axisTicks(chart.y, up)) {
    const y = place.y(v);
    grid.append(svg("line", { x1: frame.left, x2: frame.right, y1: y, y2: y, class: text ? "main" : null }));
    if (text) texts.append(svg("text", { x: frame.left - 8, y: y + 4, "text-anchor": "end" }, text));
  }
  const middle = (frame.top + frame.bottom) / 2;
  texts.append(
    svg("text", { x: (frame.left + frame.right) / 2, y: frame.bottom + 38, "text-anchor": "middle", class: "axis" }, chart.x.label),
    svg("text", { transform: `translate(13 ${middle}) rotate(-90)`, "text-anchor": "middle", class: "axis" }, chart.y.label),
  );
  root.append(grid, texts);
}

/** A dashed line; its name stands on it, where it is well inside. */
function drawGuide(plane, chart, guide, frame, place) {
  const inside = guide.points.filter(([x, y]) => chart.x.holds(x) && chart.y.holds(y));
  if (inside.length < 2) return;
  const d = inside.map(([x, y], i) => `${i ? "L" : "M"}${place.x(x).toFixed(1)} ${place.y(y).toFixed(1)}`).join("");
  plane.append(svg("path", { d, class: "guide" }));
  const at = inside[Math.floor((inside.length - 1) * (guide.at ?? 0.7))];
  const [x, y] = [place.x(at[0]), place.y(at[1])];
  // Near the end of the plot the label stands on the inner side.
  const before = guide.before || x > frame.right - 130;
  const where = { x: before ? x - 7 : x + 6, y: guide.below ? y + 14 : y - 6, "text-anchor": before ? "end" : "start" };
  plane.append(svg("text", { ...where, class: "guide-label" }, guide.label));
}

function drawSeries(series, chart, place) {
  const group = svg("g", { class: "series", "data-configuration": series.name, style: `--colour: ${colourOf(series.name)}` });
  const seen = series.points.filter((p) => chart.x.holds(p.x) && chart.y.holds(p.y));
  const banded = seen.filter((p) => finite(p.low) && finite(p.high));
  const at = (x, y) => `${place.x(x).toFixed(1)} ${place.y(y).toFixed(1)}`;
  // What is not positive has no place on a logarithmic axis: to its bottom.
  const low = (v) => (chart.y.kind === "linear" || v > 0 ? v : Number.MIN_VALUE);
  if (banded.length > 1) {
    const edge = [...banded.map((p) => at(p.x, low(p.high))), ...banded.toReversed().map((p) => at(p.x, low(p.low)))];
    group.append(svg("path", { d: `M${edge.join("L")}Z`, class: "band" }));
  }
  if (seen.length > 1) group.append(svg("path", { d: `M${seen.map((p) => at(p.x, p.y)).join("L")}`, class: "line" }));
  if (!series.line) {
    for (const p of seen) {
      const transform = `translate(${at(p.x, p.y)})`;
      group.append(svg("path", { d: markerOf(series.name), transform, class: p.hollow ? "marker hollow" : "marker" }));
    }
  }
  return group;
}

function drawBar(series, place, frame, chart) {
  const group = svg("g", { class: "series", "data-configuration": series.name, style: `--colour: ${colourOf(series.name)}` });
  const [p] = series.points;
  const half = Math.min(26, ((frame.right - frame.left) / chart.series.length) * 0.3);
  const x = place.x(p.x), y = place.y(p.y);
  group.append(svg("rect", { x: x - half, width: 2 * half, y, height: Math.max(0, frame.bottom - y), class: "bar" }));
  if (finite(p.low) && finite(p.high)) {
    const [a, b] = [place.y(p.low), place.y(p.high)];
    group.append(svg("path", { d: `M${x} ${a}V${b}M${x - 5} ${a}h10M${x - 5} ${b}h10`, class: "whisker" }));
  }
  group.append(svg("path", { d: markerOf(series.name), class: "marker", transform: `translate(${x} ${frame.bottom - 11})` }));
  return group;
}

/** Hover, click and keys. */
function listen(root, chart, place) {
  const all = chart.series.map((s) => s.points.filter((p) => chart.x.holds(p.x) && chart.y.holds(p.y)).map((p) => ({ ...p, name: s.name })))
    .filter((list) => list.length);
  if (!all.length) return;
  const ring = svg("circle", { r: 10, class: "ring", visibility: "hidden" });
  root.append(ring);
  let [curve, index] = [0, 0];
  const show = (spoken) => {
    const p = all[curve][index];
    const [x, y] = [place.x(p.x), place.y(p.y)];
    ring.setAttribute("cx", x);
    ring.setAttribute("cy", y);
    ring.setAttribute("visibility", "visible");
    root.dataset.point = `${p.name}: ${p.text}`;
    const box = root.getBoundingClientRect();
    showTip(p.name, p.text, box.left + x, box.top + y, spoken);
  };
  const hide = () => { ring.setAttribute("visibility", "hidden"); hideTip(); };
  root.addEventListener("pointermove", (event) => {
    const box = root.getBoundingClientRect();
    const [mx, my] = [event.clientX - box.left, event.clientY - box.top];
    let best = 26;
    all.forEach((list, c) => list.forEach((p, i) => {
      const distance = chart.bars ? Math.abs(place.x(p.x) - mx) : Math.hypot(place.x(p.x) - mx, place.y(p.y) - my);
      if (distance < best) [best, curve, index] = [distance, c, i];
    }));
    if (best < 26) show(false); else hide();
  });
  root.addEventListener("pointerleave", hide);
  root.addEventListener("click", () => {
    if (ring.getAttribute("visibility") === "visible") select(all[curve][index].name);
  });
  root.addEventListener("focus", () => { if (root.matches(":focus-visible")) show(true); });
  root.addEventListener("blur", hide);
  root.addEventListener("keydown", (event) => {
    const [step, turn] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
    if (step || turn) {
      const x = all[curve][index].x;
      curve = (curve + turn + all.length) % all.length;
      if (turn) index = nearest(all[curve], x);
      index = Math.min(Math.max(index + step, 0), all[curve].length - 1);
      show(true);
    } else if (event.key === "Enter") {
      select(all[curve][index].name);
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  });
}

const nearest = (points, x) => points.reduce((best, p, i) => (Math.abs(p.x - x) < Math.abs(points[best].x - x) ? i : best), 0);

function showTip(name, text, x, y, spoken) {
  const tip = byId("tip");
  tip.replaceChildren(html("b", {}, swatch(name), name), ...text.split("\n").map((line) => html("span", {}, line)));
  tip.setAttribute("aria-live", spoken ? "polite" : "off");
  tip.hidden = false;
  const left = Math.min(x + 16, document.documentElement.clientWidth - tip.offsetWidth - 8);
  const top = y + tip.offsetHeight + 24 > window.innerHeight ? y - tip.offsetHeight - 14 : y + 14;
  tip.style.left = `${Math.max(8, left)}px`;
  tip.style.top = `${top}px`;
}

const hideTip = () => { byId("tip").hidden = true; };
