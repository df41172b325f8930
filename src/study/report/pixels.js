"use strict";
// Pictures out of the page, and pictures onto canvases: tone curve, error maps.

const pictures = [...document.querySelectorAll("script.exhibit")].map((element, index) => ({
  index,
  element,
  scene: element.dataset.scene,
  label: element.dataset.label,
  width: Number(element.dataset.width),
  height: Number(element.dataset.height),
  format: element.dataset.format,
  rgb: null,
}));

/** Decodes a picture once: base64, zlib, byte planes (see exhibits.rs). */
async function decode(picture) {
  if (picture.rgb) return picture;
  const packed = Uint8Array.from(atob(picture.element.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = picture.width * picture.height;
  const rgb = new Float32Array(3 * count);
  const view = new DataView(new ArrayBuffer(4));
  for (let channel = 0; channel < 3; channel++) {
    if (picture.format === "half") {
      const high = 2 * channel * count, low = high + count;
      for (let i = 0; i < count; i++) rgb[3 * i + channel] = halfToNumber((bytes[high + i] << 8) | bytes[low + i]);
    } else {
      const start = 4 * channel * count;
      for (let i = 0; i < count; i++) {
        for (let k = 0; k < 4; k++) view.setUint8(k, bytes[start + k * count + i]);
        rgb[3 * i + channel] = view.getFloat32(0);
      }
    }
  }
  picture.rgb = rgb;
  return picture;
}

/** IEEE 754 binary16: sign, 5 bits of exponent, 10 of fraction. */
function halfToNumber(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return exponent ? sign * 2 ** (exponent - 15) * (1 + fraction / 1024) : sign * 2 ** -14 * (fraction / 1024);
}

/** Code values of the sRGB curve at i / 8192: within one code everywhere. */
const SRGB = Uint8ClampedArray.from({ length: 8193 }, (_, i) => {
  const v = i / 8192;
  return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
});

/** A canvas of `width` × `height` whose pixels `colour(i, out, o)` writes. */
function paint(width, height, colour) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  for (let i = 0; i < width * height; i++) {
    colour(i, image.data, 4 * i);
    image.data[4 * i + 3] = 255;
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** The picture through exposure and the sRGB curve; not-finite is magenta. */
function toned(picture, stops) {
  if (picture.toned?.stops === stops) return picture.toned.canvas;
  const scale = 2 ** stops * 8192;
  const { rgb, width, height } = picture;
  const canvas = paint(width, height, (i, out, o) => {
    const bad = !(Number.isFinite(rgb[3 * i]) && Number.isFinite(rgb[3 * i + 1]) && Number.isFinite(rgb[3 * i + 2]));
    for (let c = 0; c < 3; c++) out[o + c] = bad ? [255, 0, 255][c] : SRGB[Math.min(8192, Math.max(0, Math.round(rgb[3 * i + c] * scale)))];
  });
  picture.toned = { stops, canvas };
  return canvas;
}

/** Mean of the finite values. */
function meanOf(picture) {
  if (picture.mean === undefined) {
    let sum = 0, count = 0;
    for (const v of picture.rgb) if (Number.isFinite(v)) { sum += v; count++; }
    picture.mean = count ? sum / count : 0;
  }
  return picture.mean;
}

/** Relative difference of A and B by pixel, mean of the channels, where both
    have pixels: |A − B| ÷ (|B| + 0.01 mean B), or the same signed. */
function relativeDifference(a, b, signed) {
  const width = Math.min(a.width, b.width), height = Math.min(a.height, b.height);
  const floor = 0.01 * Math.abs(meanOf(b)) || 1e-12;
  const values = new Float32Array(width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const ia = 3 * (y * a.width + x), ib = 3 * (y * b.width + x);
      let sum = 0;
      for (let c = 0; c < 3; c++) {
        const d = (a.rgb[ia + c] - b.rgb[ib + c]) / (Math.abs(b.rgb[ib + c]) + floor);
        sum += signed ? d : Math.abs(d);
      }
      values[y * width + x] = sum / 3;
    }
  }
  return { width, height, values };
}

/** 98 % of the values lie within this, rounded up to 1, 2 or 5 × 10^n. */
function usualRange(values) {
  const sizes = values.filter((v) => Number.isFinite(v)).map(Math.abs).sort();
  const high = sizes.length ? sizes[Math.floor(0.98 * (sizes.length - 1))] : 0;
  if (!(high > 1e-9)) return 0.01;
  const power = 10 ** Math.floor(Math.log10(high));
  return [1, 2, 5, 10].map((m) => m * power).find((v) => v >= high * 0.9999);
}

// Dark to bright with evenly rising lightness; and blue over grey to red, which
// all kinds of colour vision tell apart.
const HEAT = [[4, 3, 18], [40, 11, 84], [101, 21, 110], [159, 42, 99], [212, 72, 66], [245, 125, 21], [250, 193, 39], [252, 255, 164]];
const DIVERGING = [[18, 78, 160], [88, 150, 205], [176, 206, 228], [238, 238, 238], [244, 190, 165], [216, 105, 82], [160, 20, 40]];

/** The colour at `t` in [0, 1] between the stops of a map. */
function mapColour(stops, t) {
  const at = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  return stops[i].map((v, c) => v + (stops[i + 1][c] - v) * (at - i));
}

const gradient = (stops) => `linear-gradient(to right, ${stops.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;

/** The error map as a canvas. */
function errorMap(difference, signed, range) {
  const stops = signed ? DIVERGING : HEAT;
  const table = Array.from({ length: 256 }, (_, i) => mapColour(stops, i / 255));
  return paint(difference.width, difference.height, (i, out, o) => {
    const v = difference.values[i];
    const t = signed ? 0.5 + (0.5 * v) / range : v / range;
    const colour = Number.isFinite(v) ? table[Math.round(255 * Math.min(1, Math.max(0, t)))] : [255, 0, 255];
    for (let c = 0; c < 3; c++) out[o + c] = colour[c];
  });
}
