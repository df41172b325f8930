"use strict";
// What the other scripts share: the embedded data, elements, numbers as text.
// Numbers that JSON cannot hold arrive as null; every reader here takes null.

const study = JSON.parse(document.getElementById("study-data").textContent);
const metricLabels = new Map(
  JSON.parse(document.getElementById("metric-labels").textContent).map((c) => [c.metric, c.label]),
);

const byId = (id) => document.getElementById(id);
const finite = (v) => typeof v === "number" && Number.isFinite(v);

/** An HTML element with attributes and children; text is never parsed. */
function html(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

const SVG = "http://www.w3.org/2000/svg";

/** The same for SVG. */
function svg(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

function fill(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

/** Three significant digits, as the tables have them. */
function number(v) {
  if (!finite(v)) return "–";
  if (v === 0) return "0";
  const exponent = Number(v.toExponential(2).split("e")[1]);
  if (exponent >= -3 && exponent < 5) return minus(v.toFixed(Math.max(0, 2 - exponent)));
  return minus(`${(v / 10 ** exponent).toFixed(2)}e${exponent}`);
}

const minus = (text) => text.replaceAll("-", "−");
const percent = (v) => (finite(v) ? `${number(100 * v)} %` : "–");

function seconds(v) {
  if (!finite(v)) return "–";
  if (v < 1) return `${number(1e3 * v)} ms`;
  if (v < 120) return `${number(v)} s`;
  if (v < 7200) return `${number(v / 60)} min`;
  return `${number(v / 3600)} h`;
}

/** `1.2 (1.1 to 1.3)`, or the value alone where there is no interval. */
function withInterval(interval, write = number) {
  const { value, low, high } = interval;
  return finite(low) && finite(high) ? `${write(value)} (${write(low)} to ${write(high)})` : write(value);
}

/** Colour and marker of a configuration: by its place in the first scene that
    has it, so that it looks the same everywhere. */
const styles = new Map();
for (const scene of study.scenes) {
  scene.configurations.forEach((c, i) => styles.has(c.name) || styles.set(c.name, i));
}
const styleOf = (name) => styles.get(name) ?? 0;
const colourOf = (name) => `var(--series-${styleOf(name) % 7})`;

// The same shapes as in the plots as files.
const MARKERS = [
  "M-2.5-6 2.5-6 6-2.5 6 2.5 2.5 6-2.5 6-6 2.5-6-2.5Z",
  "M-5-5H5V5H-5Z",
  "M0-6.5 6.5 5H-6.5Z",
  "M0-7 7 0 0 7-7 0Z",
  "M0 6.5 6.5-5H-6.5Z",
  "M-2-6H2V-2H6V2H2V6H-2V2H-6V-2H-2Z",
];
const markerOf = (name) => MARKERS[styleOf(name) % MARKERS.length];

/** A marker as a small picture, for legends and tables. */
function swatch(name) {
  const shape = svg("path", { d: markerOf(name), fill: colourOf(name) });
  return svg("svg", { viewBox: "-8 -8 16 16", width: 14, height: 14, "aria-hidden": "true" }, shape);
}

/** The page's state; whoever shows it listens. */
const state = { scene: 0, configuration: null, metric: "rel-mse", target: null, abscissa: "cpu" };
const listeners = [];
const onChange = (listener) => listeners.push(listener);

function change(what) {
  Object.assign(state, what);
  for (const listener of listeners) listener(what);
}

const currentScene = () => study.scenes[state.scene] ?? null;
