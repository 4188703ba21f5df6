// What all drawings share: numbers out of the page, numbers for people, the tip at the pointer.

const data = JSON.parse(document.getElementById("data").textContent);
const pixels = () => Math.max(1, window.devicePixelRatio || 1);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function bytes(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
}

// 32-bit floats, or 16-bit steps between two values.
function numbers(packed) {
  if (packed.f32 !== undefined) return new Float32Array(bytes(packed.f32));
  const step = (packed.hi - packed.lo) / 65535;
  return Float64Array.from(new Uint16Array(bytes(packed.u16)), (k) => packed.lo + step * k);
}

function say(value, digits = 4) {
  if (!Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-4 || size >= 1e6) return value.toExponential(digits - 1).replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

function range(values) {
  let lo = Infinity;
  let hi = -Infinity;
  for (const v of values) {
    if (v < lo) lo = v;
    if (v > hi) hi = v;
  }
  return lo <= hi ? [lo, hi] : [0, 1];
}

// Round numbers within [lo, hi], about `count` of them.
function ticks(lo, hi, count) {
  const raw = (hi - lo) / Math.max(1, count);
  if (!(raw > 0)) return [lo];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5].find((k) => k * power >= raw) || 10);
  const all = [];
  for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + 1e-9 * step; k += 1) {
    all.push(Number((k * step).toPrecision(12)));
  }
  return all;
}

function add(parent, name, attributes = {}, text) {
  const svg = name === "svg" || parent.namespaceURI.endsWith("svg");
  const element = svg
    ? document.createElementNS("http://www.w3.org/2000/svg", name)
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

// A text along an axis, turned by so many degrees.
function turned(svg, x, y, angle, text) {
  add(svg, "text", { transform: `translate(${x},${y}) rotate(${angle})`, "text-anchor": "middle" }, text);
}

const tip = document.getElementById("tip");
const spoken = document.getElementById("say");

// Shows lines at a place of the window; `aloud` tells a screen reader too.
function showTip(lines, x, y, aloud) {
  tip.textContent = lines.join("\n");
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  const left = x + 14 + box.width > innerWidth - 6 ? x - 14 - box.width : x + 14;
  tip.style.left = `${Math.max(6, left)}px`;
  tip.style.top = `${Math.max(6, Math.min(y + 14, innerHeight - box.height - 6))}px`;
  if (aloud) spoken.textContent = lines.join(", ");
}

function hideTip() {
  tip.hidden = true;
}

// Viridis, bright where values are large: the order survives in grey and for every eye.
const STOPS = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141],
  [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37],
];

// Blue below zero, red above it, pale at it: the sign is seen before the size.
const SIGNED = [
  [33, 102, 172], [103, 169, 207], [209, 229, 240], [247, 247, 247],
  [253, 219, 199], [239, 138, 98], [178, 24, 43],
];

// The colours of values from lo to hi; of signed values zero lies in the middle of both.
function palette([lo, hi], isSigned) {
  const most = Math.max(Math.abs(lo), Math.abs(hi)) || 1;
  const [from, to] = isSigned ? [-most, most] : hi > lo ? [lo, hi] : [lo - 0.5, hi + 0.5];
  const stops = isSigned ? SIGNED : STOPS;
  const colour = (value) => {
    const at = Math.max(0, Math.min(1, (value - from) / (to - from))) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(at));
    return stops[k].map((a, i) => Math.round(a + (at - k) * (stops[k + 1][i] - a)));
  };
  return { lo: from, hi: to, colour };
}

const css = (rgb) => `rgb(${rgb.join(",")})`;

// A canvas of so many CSS pixels, sharp on any screen.
function sharp(canvas, width, height) {
  const scale = Math.max(2, pixels());
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
  return pen;
}

function box(id) {
  return document.getElementById(id);
}
