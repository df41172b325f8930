"use strict";
// The charts of the current scene, from the embedded study.

/** The figure of the chosen metric and target at a rung. */
const figureOf = (rung, metric, target) => rung.figures.find((f) => f.metric === metric && f.target === target);

const costOf = (rung) => (state.abscissa === "cpu" ? rung.cpu.value : rung.samples_per_pixel);
const SIGNED = new Set(["bias"]);
const LINEAR = new Set(["bias", "psnr"]);

function convergenceChart(scene) {
  const { metric, target } = state;
  const linear = LINEAR.has(metric);
  let floor = 0;
  const series = scene.configurations.map((c) => ({ name: c.name, points: [] }));
  scene.configurations.forEach((c, i) => {
    for (const rung of c.rungs) {
      const figure = figureOf(rung, metric, target);
      const x = costOf(rung);
      if (!figure || !(x > 0) || !finite(figure.mean.value)) continue;
      if (!linear && !(figure.mean.value > 0)) continue;
      if (finite(figure.floor)) floor = Math.max(floor, figure.floor);
      series[i].points.push({ x, y: figure.mean.value, low: figure.mean.low, high: figure.mean.high, hollow: figure.limited, text: describe(rung, figure) });
    }
    series[i].points.sort((a, b) => a.x - b.x);
  });
  const shown = series.filter((s) => s.points.length);
  const points = shown.flatMap((s) => s.points);
  const lowest = Math.min(...points.map((p) => p.y));
  const drawFloor = floor > lowest / 100 && !linear;
  // An interval may reach far: it does not rule a logarithmic axis.
  const ends = points.flatMap((p) => (linear ? [p.low, p.high] : [Math.min(p.high ?? p.y, 4 * p.y), Math.max(p.low ?? p.y, p.y / 4)]));
  const x = makeAxis(state.abscissa === "cpu" ? "log" : "log2", state.abscissa === "cpu" ? "CPU time of rendering (s)" : "samples per pixel", points.map((p) => p.x));
  const y = makeAxis(linear ? "linear" : "log", metricLabels.get(metric) ?? metric, [...points.map((p) => p.y), ...ends, ...(drawFloor ? [floor] : []), ...(SIGNED.has(metric) ? [0] : [])]);
  const guides = x && y ? convergenceGuides(scene, shown, x, linear, drawFloor ? floor : 0) : [];
  const below = floor > 0 && !drawFloor ? ` The reference’s noise, ${number(floor)}, lies below.` : "";
  const limited = points.some((p) => p.hollow) ? " Hollow: within the reference’s noise." : "";
  return { name: "Convergence", x, y, series: shown, guides, hint: `Bands are ${(100 * study.confidence).toFixed(0)} % intervals.${limited}${below}`, empty: "No figures of this kind were measured." };
}

function convergenceGuides(scene, shown, x, linear, floor) {
  const across = Array.from({ length: 41 }, (_, i) => 10 ** (x.low + ((x.high - x.low) * i) / 40));
  if (linear) return SIGNED.has(state.metric) ? [{ label: "no bias", points: across.map((v) => [v, 0]), at: 0 }] : [];
  const guides = [];
  const slope = ["mse", "rel-mse", "rel-mse-trimmed"].includes(state.metric) ? -1 : -0.5;
  const first = (shown.find((s) => s.name === scene.baseline) ?? shown[0])?.points[0];
  if (first) {
    const points = across.filter((v) => v >= first.x).map((v) => [v, first.y * (v / first.x) ** slope]);
    guides.push({ label: slope === -1 ? "slope −1" : "slope −½", points, at: 1, below: true, before: true });
  }
  if (floor > 0) guides.push({ label: "noise of the reference", points: across.map((v) => [v, floor]), at: 0 });
  return guides;
}

function describe(rung, figure) {
  const label = metricLabels.get(figure.metric) ?? figure.metric;
  const write = figure.metric === "bias" ? percent : number;
  const value = figure.limited ? "within the reference’s noise" : withInterval(figure.mean, write);
  const runs = rung.cpu_seconds.length;
  return `${rung.budget}, ${seconds(rung.cpu.value)} of CPU time\n${label} ${value}\n${runs} run${runs === 1 ? "" : "s"}`;
}

function efficiencyChart(scene) {
  const series = [];
  for (const c of scene.configurations) {
    const rung = c.rungs.at(-1);
    // What computes something else has an error, but no efficiency to compare.
    if (!rung || c.biased_by_design || !(rung.efficiency.value > 0)) continue;
    const { value, low, high } = rung.efficiency;
    const text = `efficiency ${withInterval(rung.efficiency)}\nat ${rung.budget}`;
    series.push({ name: c.name, points: [{ x: series.length, y: value, low, high, text }] });
  }
  const top = Math.max(...series.flatMap((s) => s.points.flatMap((p) => [p.y, p.high ?? 0])));
  const x = series.length ? makeAxis("linear", "", [], [-0.6, series.length - 0.4]) : null;
  const y = series.length ? makeAxis("linear", "1 ÷ (relMSE · CPU s)", [], [0, 1.06 * top]) : null;
  return { title: "Efficiency", name: "Efficiency", hint: "At the largest budget; higher is better.", x, y, series, bars: true, height: 260 };
}

/** Curves of pairs, such as spectra. */
function pairSeries(scene, pairs, text, positive) {
  return scene.configurations.map((c) => ({
    name: c.name,
    line: !positive.markers,
    points: (pairs(c) ?? [])
      .filter(([x, y]) => finite(x) && finite(y) && (!positive.x || x > 0) && (!positive.y || y > 0))
      .map(([x, y]) => ({ x, y, text: text(x, y) })),
  })).filter((s) => s.points.length);
}

function spectrumChart(scene) {
  const series = pairSeries(scene, (c) => c.noise?.spectrum, (f, p) => `${number(p)} × white noise\nat ${number(f)} cycles per pixel`, { y: true });
  const powers = series.flatMap((s) => s.points.map((p) => p.y));
  return {
    title: "Is the noise blue?", name: "Power spectrum", height: 260, series,
    hint: "Power spectrum of the relative error. Dashed: white; low on the left is blue.",
    x: makeAxis("linear", "cycles per pixel", [], [0, 0.5]),
    y: powers.length ? makeAxis("log", "power ÷ white", [...powers, 0.5, 2]) : null,
    guides: [{ label: "", points: Array.from({ length: 21 }, (_, i) => [i / 40, 1]), at: 0 }],
    empty: "Needs two runs of a configuration.",
  };
}

function histogramChart(scene) {
  const series = pairSeries(scene, (c) => c.noise?.histogram, (x, y) => `${percent(y)} of the values\nbetween ${number(x / 2)} and ${number(x)} × RMS`, { x: true, y: true, markers: true });
  const points = series.flatMap((s) => s.points);
  const x = makeAxis("log2", "|error| ÷ RMS", points.map((p) => p.x));
  const along = x ? Array.from({ length: 61 }, (_, i) => 10 ** (x.low + ((x.high - x.low) * i) / 60)) : [];
  return {
    title: "Fireflies", name: "Histogram of pixel errors", height: 260, series, x,
    hint: "Histogram of pixel errors; a long right tail is fireflies.",
    y: makeAxis("log", "part of the values", points.map((p) => p.y)),
    guides: [{ label: "normal", points: along.map((v) => [v, normalWithin(v) - normalWithin(v / 2)]), at: 0.98, below: true, before: true }],
    empty: "Needs two runs of a configuration.",
  };
}

function calibrationChart(scene) {
  const series = pairSeries(scene, (c) => c.calibration?.rungs.at(-1)?.curve, (k, p) => `${percent(p)} within ${number(k)} standard errors\nperfect: ${percent(normalWithin(k))}`, {});
  const end = Math.min(6, Math.max(3, ...series.flatMap((s) => s.points.map((p) => p.x))));
  const along = Array.from({ length: 61 }, (_, i) => (end * i) / 60);
  return {
    title: "Is the error layer honest?", name: "Calibration of the error layer", height: 260, series,
    hint: "True error within k reported ones; above the dashes is cautious.",
    x: makeAxis("linear", "k standard errors", [], [0, end]),
    y: makeAxis("linear", "part within k", [], [0, 1.03]),
    guides: [{ label: "perfect", points: along.map((k) => [k, normalWithin(k)]), at: 0.28, before: true }],
    empty: "These pictures have no error layer.",
  };
}

/** Probability that a standard normal value lies within ±z (a midpoint sum,
    good to five digits, which is more than a line shows). */
function normalWithin(z) {
  const steps = 64;
  let sum = 0;
  for (let i = 0; i < steps; i++) sum += Math.exp(-0.5 * (((i + 0.5) / steps) * z) ** 2);
  return Math.min(1, Math.sqrt(2 / Math.PI) * (z / steps) * sum);
}

function drawFigures() {
  const scene = currentScene();
  if (!scene) {
    for (const figure of document.querySelectorAll("figure.plot")) figure.hidden = true;
    return;
  }
  drawChart(byId("plot-convergence"), convergenceChart(scene));
  drawChart(byId("plot-efficiency"), efficiencyChart(scene));
  drawChart(byId("plot-spectrum"), spectrumChart(scene));
  drawChart(byId("plot-histogram"), histogramChart(scene));
  drawChart(byId("plot-calibration"), calibrationChart(scene));
  drawLegend(scene);
  highlight();
}

/** One button per configuration, with its last figure. */
function drawLegend(scene) {
  const buttons = scene.configurations.map((c) => {
    const figure = c.rungs.map((r) => figureOf(r, state.metric, state.target)).findLast((f) => f);
    const write = state.metric === "bias" ? percent : number;
    const value = !figure ? "no figure" : figure.limited ? "within the reference’s noise" : write(figure.mean.value);
    const more = [c.external ? "made elsewhere" : null, c.biased_by_design].filter(Boolean).join(", ");
    const button = html("button", { type: "button", class: "entry", "data-pick": c.name, "aria-pressed": String(state.configuration === c.name) },
      swatch(c.name), html("span", { class: "entry-name" }, c.name), html("span", { class: "entry-value" }, value), more ? html("span", { class: "hint" }, more) : null);
    return button;
  });
  const empty = html("p", { class: "empty" }, "No configurations.");
  byId("legend").replaceChildren(...(buttons.length ? buttons : [empty]));
}

/** Marks what belongs to the selected configuration. */
function highlight() {
  const chosen = state.configuration;
  document.body.classList.toggle("has-selection", chosen !== null);
  for (const element of document.querySelectorAll("[data-configuration]")) {
    element.classList.toggle("selected", element.dataset.configuration === chosen);
  }
  for (const button of document.querySelectorAll("[data-pick]")) {
    if (!button.classList.contains("goto")) button.setAttribute("aria-pressed", String(button.dataset.pick === chosen));
  }
}
