// Lines over one variable, with a cursor that tells all values.

const DASHES = ["", "6 3", "2 3", "8 3 2 3"];

// series: {name, unit, x, y, colour, dash, width, right, dots, rings, cloud, tell}; marks: {x, name, chosen}.
// A cloud is points alone; with `near` the axes end where the points do.
// Where series tell(k) lines of their points, the cursor goes from point to point.
function chart(place, spec) {
  const shown = place.dataset.what;
  let at = null;

  function draw() {
    place.replaceChildren();
    legend();
    const width = Math.max(280, place.clientWidth);
    const height = Math.round(Math.min(340, Math.max(250, width * 0.6)));
    const right = spec.series.some((one) => one.right);
    const pad = { left: spec.log ? 62 : 52, right: right ? 50 : 14, top: 10 + marksRoom(width), bottom: 40 };
    const inner = { w: width - pad.left - pad.right, h: height - pad.top - pad.bottom };
    const log = spec.log === true;
    const of = (v) => (log ? Math.log10(v) : v);
    const [x0, x1] = spec.xRange || (log ? decades : widened)(range(spec.series.flatMap((s) => Array.from(s.x, of))));
    const ends = [false, true].map((side) => {
      const all = spec.series.filter((one) => Boolean(one.right) === side);
      const values = all.flatMap((one) => Array.from(one.y, of).filter(Number.isFinite));
      const [lo, hi] = range(values);
      if (spec.near) return widened([lo, hi]);
      return log ? decades([lo, hi]) : [Math.min(0, lo * 1.05), hi > 0 ? hi * 1.06 : 1];
    });
    const px = (v) => pad.left + ((of(v) - x0) / (x1 - x0)) * inner.w;
    const py = (v, side) => {
      const [lo, hi] = ends[side ? 1 : 0];
      return pad.top + (1 - (of(v) - lo) / (hi - lo)) * inner.h;
    };
    const svg = add(place, "svg", {
      width, height, viewBox: `0 0 ${width} ${height}`, role: "img", tabindex: 0,
      "aria-label": `${shown}. Left and right arrow keys read the values.`,
    });
    const name = (v) => (log ? `1e${v}` : say(v, 6));
    const unlog = (v) => (log ? 10 ** v : v);
    const steps = (lo, hi, count) => (log ? ticks(lo, hi, count).filter(Number.isInteger) : ticks(lo, hi, count));
    for (const v of steps(...ends[0], inner.h / 45)) {
      const y = py(unlog(v), false);
      add(svg, "line", { class: "grid", x1: pad.left, x2: pad.left + inner.w, y1: y, y2: y });
      add(svg, "text", { x: pad.left - 7, y: y + 4, "text-anchor": "end" }, name(v));
    }
    if (right) {
      for (const v of steps(...ends[1], inner.h / 45)) {
        add(svg, "text", { x: pad.left + inner.w + 7, y: py(unlog(v), true) + 4 }, name(v));
      }
      turned(svg, width - 8, pad.top + inner.h / 2, 90, spec.rightLabel);
    }
    for (const v of steps(x0, x1, inner.w / 75)) {
      const x = px(unlog(v));
      add(svg, "line", { class: "axis", x1: x, x2: x, y1: pad.top + inner.h, y2: pad.top + inner.h + 4 });
      add(svg, "text", { x, y: pad.top + inner.h + 17, "text-anchor": "middle" }, name(v));
    }
    add(svg, "text", { x: pad.left + inner.w / 2, y: height - 6, "text-anchor": "middle" }, spec.xLabel);
    turned(svg, 12, pad.top + inner.h / 2, -90, spec.yLabel);
    add(svg, "path", { class: "axis", d: `M${pad.left},${pad.top}v${inner.h}h${inner.w}${right ? `v${-inner.h}` : ""}` });
    marks(svg, px, pad, inner);
    const clip = `${place.id}-clip`;
    add(add(add(svg, "defs"), "clipPath", { id: clip }), "rect", { x: pad.left, y: pad.top - 3, width: inner.w, height: inner.h + 6 });
    const lines = add(svg, "g", { "clip-path": `url(#${clip})` });
    for (const one of spec.series) {
      if (one.cloud) {
        one.y.forEach((v, k) => add(lines, "circle", { class: "cloud", cx: px(one.x[k]).toFixed(1), cy: py(v, one.right).toFixed(1), r: 2, fill: `var(${one.colour})` }));
        continue;
      }
      let path = "";
      let on = false;
      one.y.forEach((v, k) => {
        if (Number.isFinite(of(v))) path += `${on ? "L" : "M"}${px(one.x[k]).toFixed(1)},${py(v, one.right).toFixed(1)}`;
        on = Number.isFinite(of(v));
      });
      add(lines, "path", {
        d: path, fill: "none", stroke: `var(${one.colour})`, "stroke-width": one.width || 1.8,
        "stroke-dasharray": one.dash || "none", "stroke-linejoin": "round",
      });
      for (const k of one.dots || []) {
        add(lines, "circle", { class: "dot", cx: px(one.x[k]), cy: py(one.y[k], one.right), r: 3, stroke: `var(${one.colour})` });
      }
      for (const k of one.rings || []) {
        add(lines, "circle", { class: "ring", cx: px(one.x[k]), cy: py(one.y[k], one.right), r: 7 });
      }
    }
    const cursor = add(svg, "line", { class: "cursor", y1: pad.top, y2: pad.top + inner.h, visibility: "hidden" });
    if (spec.series.some((one) => one.tell)) {
      const spot = add(svg, "circle", { class: "spot", r: 5, visibility: "hidden" });
      pointwise(svg, spot, px, py, pad.left + inner.w + pad.right);
    } else {
      listen(svg, cursor, px, pad, inner, [x0, x1], unlog);
    }
  }

  // Whole powers of ten around logarithms, so that every axis has two ticks at least.
  function decades([lo, hi]) {
    const [from, to] = [Math.floor(lo), Math.ceil(hi)];
    return [from, to > from ? to : from + 1];
  }

  function widened([lo, hi]) {
    return hi > lo ? [lo - 0.04 * (hi - lo), hi + 0.04 * (hi - lo)] : [lo - 0.5, hi + 0.5];
  }

  function legend() {
    const list = add(place, "ul", { class: "legend" });
    for (const one of spec.series) {
      const item = add(list, "li");
      const key = add(item, "svg", { width: 24, height: 6, "aria-hidden": "true" });
      if (one.cloud) add(key, "circle", { class: "cloud", cx: 12, cy: 3, r: 3, fill: `var(${one.colour})` });
      else add(key, "line", { x1: 0, x2: 24, y1: 3, y2: 3, stroke: `var(${one.colour})`, "stroke-width": 2.4, "stroke-dasharray": one.dash || "none" });
      item.append(one.name);
    }
  }

  // Names of the marks stand in rows above the drawing, so that none lies on another.
  function rowsOfMarks(px, width) {
    const rows = [];
    return (spec.marks || []).map((one) => {
      const x = px(one.x);
      const half = one.name.length * 3.4 + 3;
      const left = Math.min(Math.max(x - half, 2), width - 2 * half - 2);
      let row = rows.findIndex((end) => end < left);
      if (row < 0) row = rows.push(0) - 1;
      rows[row] = left + 2 * half + 4;
      return { one, x, row, middle: left + half };
    });
  }

  function marksRoom(width) {
    const [x0, x1] = spec.xRange || [0, 1];
    const guess = (v) => 52 + ((v - x0) / (x1 - x0)) * (width - 110);
    return 15 * Math.max(0, ...rowsOfMarks(guess, width).map((m) => m.row + 1));
  }

  function marks(svg, px, pad, inner) {
    const all = rowsOfMarks(px, pad.left + inner.w + pad.right);
    for (const { one, x, row } of all) {
      const y = pad.top - 4 - 15 * row;
      add(svg, "line", { class: one.chosen ? "mark chosen" : "mark", x1: x, x2: x, y1: y, y2: pad.top + inner.h });
    }
    // Names last, each on ground of its own: a line to a higher name may pass behind it.
    for (const { one, row, middle } of all) {
      add(svg, "text", { class: one.chosen ? "name over" : "over", x: middle, y: pad.top - 7 - 15 * row, "text-anchor": "middle" }, one.name);
    }
  }

  function listen(svg, cursor, px, pad, inner, [x0, x1], unlog) {
    const base = spec.series[0];
    const near = (x) => {
      let best = 0;
      base.x.forEach((v, k) => {
        if (Math.abs(px(v) - x) < Math.abs(px(base.x[best]) - x)) best = k;
      });
      return best;
    };
    const show = (k, clientY, aloud) => {
      at = Math.max(0, Math.min(base.x.length - 1, k));
      const v = base.x[at];
      const x = px(v);
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.setAttribute("visibility", "visible");
      const frame = svg.getBoundingClientRect();
      const scale = frame.width / (pad.left + inner.w + pad.right);
      const lines = spec.series.map((one) => `${one.name}: ${say(value(one, v))} ${one.unit}`);
      showTip([`${spec.xName}: ${say(v, 5)} ${spec.xUnit}`, ...lines], frame.left + x * scale, clientY ?? frame.top + 40, aloud);
    };
    const hide = () => {
      cursor.setAttribute("visibility", "hidden");
      hideTip();
    };
    const move = (event) => {
      const frame = svg.getBoundingClientRect();
      show(near(((event.clientX - frame.left) / frame.width) * (pad.left + inner.w + pad.right)), event.clientY, false);
    };
    heed(svg, move, hide, (step) => show((at ?? near(px(spec.start ?? unlog((x0 + x1) / 2)))) + step, undefined, true));
  }

  // Pointer and keys: where it moves, when it leaves, and by how many places a key goes on.
  function heed(svg, move, hide, go) {
    svg.addEventListener("pointermove", move);
    svg.addEventListener("pointerdown", move);
    svg.addEventListener("pointerleave", hide);
    svg.addEventListener("blur", hide);
    svg.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -20, PageDown: 20, Home: -1e9, End: 1e9 };
      if (event.key === "Escape") hide();
      if (steps[event.key] === undefined) return;
      event.preventDefault();
      go(steps[event.key]);
    });
  }

  // The point nearest to the pointer, of all series that tell theirs, the last of equals; keys go through them in order.
  function pointwise(svg, spot, px, py, width) {
    const all = spec.series.flatMap((one) => (one.tell ? Array.from(one.x, (v, k) => ({ one, k, x: px(v), y: py(one.y[k], one.right) })) : []));
    const show = (k, aloud) => {
      at = Math.max(0, Math.min(all.length - 1, k));
      const { one, k: row, x, y } = all[at];
      spot.setAttribute("cx", x);
      spot.setAttribute("cy", y);
      spot.setAttribute("visibility", "visible");
      const frame = svg.getBoundingClientRect();
      const scale = frame.width / width;
      showTip([one.name, ...one.tell(row)], frame.left + x * scale, frame.top + y * scale, aloud);
    };
    const hide = () => {
      spot.setAttribute("visibility", "hidden");
      hideTip();
    };
    const move = (event) => {
      const frame = svg.getBoundingClientRect();
      const scale = width / frame.width;
      const [x, y] = [(event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale];
      const off = (p) => Math.hypot(p.x - x, p.y - y);
      if (all.length) show(all.reduce((best, p, k) => (off(p) <= off(all[best]) ? k : best), 0), false);
    };
    heed(svg, move, hide, (step) => all.length && show((at ?? -1) + step, true));
  }

  // A line's value at x, straight between its points.
  function value(one, x) {
    let k = 0;
    while (k < one.x.length && one.x[k] < x) k += 1;
    if (one.x[k] === x) return one.y[k];
    if (k === 0 || k === one.x.length) return NaN;
    const part = (x - one.x[k - 1]) / (one.x[k] - one.x[k - 1]);
    return one.y[k - 1] + part * (one.y[k] - one.y[k - 1]);
  }

  return draw;
}
