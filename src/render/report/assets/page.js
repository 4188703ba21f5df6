// Which drawings a page has, and when they are drawn again.

const drawings = [];

function own(id, make) {
  const place = box(`draw-${id}`);
  if (place) drawings.push(make(place));
}

own("path", (place) => {
  const p = data.path;
  const lambda = numbers(p.lambda);
  return chart(place, {
    xName: "lambda", xUnit: "N/m", xLabel: "lambda / N/m", yLabel: "error / mN", rightLabel: "relative / %",
    xRange: [0, p.end], start: p.chosen ?? undefined, marks: marks(p),
    series: [
      { name: "rms error", unit: "mN", x: lambda, y: numbers(p.rms), colour: "--c0", width: 2.4, dots: p.turns },
      { name: "least worst error", unit: "mN", x: numbers(p.worst.lambda), y: numbers(p.worst.error), colour: "--c2", dash: DASHES[3] },
      { name: "rms error over rms force", unit: "%", x: lambda, y: numbers(p.relative), colour: "--c1", dash: DASHES[1], right: true },
    ],
  });
});

own("currents", (place) => {
  const p = data.path;
  const lambda = numbers(p.lambda);
  return chart(place, {
    xName: "lambda", xUnit: "N/m", xLabel: "lambda / N/m", yLabel: "I / A",
    xRange: [0, p.end], start: p.chosen ?? undefined, marks: marks(p),
    series: p.currents.map((one, k) => ({
      name: `coil ${k}`, unit: "A", x: lambda, y: numbers(one), colour: `--c${k % 9}`,
      // Coils that carry the same lie on each other: the later ones are thinner.
      width: 1.4 + 2.2 * (1 - k / p.currents.length), dash: DASHES[Math.floor(k / 3) % 4],
    })),
  });
});

function marks(p) {
  const all = p.marks.filter((one) => one.lambda <= p.end).map((one) => ({
    x: one.lambda, name: one.lambda === p.chosen ? `${one.name} (chosen)` : one.name, chosen: one.lambda === p.chosen,
  }));
  if (p.chosen !== null && !all.some((one) => one.chosen)) all.push({ x: p.chosen, name: "chosen", chosen: true });
  return all.sort((a, b) => a.x - b.x);
}

// A range of cells about a range of nodes.
function around([from, to], count) {
  const half = count > 1 ? (to - from) / (count - 1) / 2 : 0.5;
  return [from - half, to + half];
}

own("turn", turn);
own("replay", replay);

own("errors", (place) => {
  const s = data.surface;
  const [error, height] = [numbers(s.error), numbers(s.height)];
  const drawn = {
    x: around(s.x, s.columns), y: around(s.y, s.rows), nodesX: s.x, nodesY: s.y,
    columns: s.columns, rows: s.rows, values: error, unit: "mN", name: "given - requested", zero: true,
    circles: data.coils, more: (v, k) => [`height: ${say(height[k])} mm`],
  };
  return heat(place, place, () => drawn);
});

own("field", (place) => {
  const f = data.field;
  const layers = f.layers.map((one) => ({ ...one, planes: one.planes.map(numbers) }));
  const control = add(place, "div", { class: "control" });
  const which = add(add(control, "label", {}, "show"), "select");
  layers.forEach((one, k) => add(which, "option", { value: k }, one.name));
  const label = add(control, "label", {}, "height");
  const slider = add(label, "input", { type: "range", min: 0, step: 1 });
  const told = add(control, "output");
  const holder = add(place, "div");
  let layer = layers[0];
  const spec = () => {
    const values = layer.planes[slider.value];
    const rows = values.length / layer.columns;
    return {
      x: around(f.x, layer.columns), y: around(f.y, rows), nodesX: f.x, nodesY: f.y,
      columns: layer.columns, rows, values, unit: layer.unit, name: "dBz/dz", zero: false, circles: data.coils,
      more: (v) => (layer.unit === "T/m" && f.force !== null ? [`force: ${say(v * f.force * 1e3)} mN`] : []),
    };
  };
  const draw = heat(place, holder, spec);
  const at = () => {
    told.textContent = `${say(layer.heights[slider.value])} mm`;
    slider.setAttribute("aria-valuetext", told.textContent);
    draw();
  };
  const to = (height) => {
    const off = (k) => Math.abs(layer.heights[k] - height);
    slider.max = layer.heights.length - 1;
    slider.value = layer.heights.reduce((best, _, k) => (off(k) < off(best) ? k : best), 0);
    at();
  };
  which.addEventListener("change", () => {
    const before = layer.heights[slider.value];
    layer = layers[which.value];
    to(before);
  });
  slider.addEventListener("input", at);
  to(f.first);
  return draw;
});

function seconds(value) {
  const [unit, factor] = [["s", 1], ["ms", 1e3], ["\u00b5s", 1e6], ["ns", 1e9]].find(([, f]) => value * f >= 1) || ["ns", 1e9];
  return `${say(value * factor, 3)} ${unit}`;
}

// A measured curve; an error that is no more than rounding is drawn at 1e-17.
function measured(one, colour, more) {
  const [error, time, low, high] = [one.error, one.seconds, one.low, one.high].map((packed) => packed && numbers(packed));
  const name = one.unit ? `, ${one.unit}` : "";
  return {
    name: one.name, unit: "", x: time, y: error.map((e) => Math.max(e, 1e-17)), colour, rings: one.rings,
    dots: Array.from(error, (_, k) => k), ...more,
    tell: (k) => [
      `${one.knobName}: ${say(one.knob[k], 6)}${one.rings.includes(k) ? ` (${one.ringed})` : ""}`,
      `error: ${say(error[k], 3)}${name}`,
      `CPU time: ${seconds(time[k])}`,
      ...(low ? [`quartiles: ${seconds(low[k])} to ${seconds(high[k])}`] : []),
    ],
  };
}

own("cost", (place) => {
  const c = data.cost;
  const curve = measured(c.curve, "--c0", { width: 2.2 });
  const [from, to] = range(curve.x);
  return chart(place, {
    xLabel: "CPU time / s", yLabel: "relative error", log: true,
    series: [
      curve,
      { name: "this run's tolerance", unit: "", x: [from, to], y: [c.tolerance, c.tolerance], colour: "--c1", dash: DASHES[1] },
    ],
  });
});

(data.stages || []).forEach((stage, number) => own(`stage-${number}`, (place) => chart(place, {
  xLabel: "CPU time / s", yLabel: stage.label, log: true,
  series: stage.curves.map((one, k) => measured(one, `--c${k % 9}`, { dash: one.peer ? DASHES[1] : "", width: one.peer ? 1.6 : 2.2 })),
})));

// A sweep's designs: those that meet their limits, those that do not, and the front.
(data.fronts || []).forEach((one, number) => own(`front-${number}`, (place) => {
  const tell = (points) => (k) => [points.y, points.x].map((v, j) => `${one.names[1 - j]}: ${say(v[k])} ${one.units[1 - j]}`);
  const series = [["does not meet its limits", one.unmet, "--soft"], ["meets its limits", one.met, "--c0"]].map(([name, packed, colour]) => {
    const points = { x: numbers(packed.x), y: numbers(packed.y) };
    return { name, unit: "", ...points, colour, cloud: true, tell: tell(points) };
  });
  const front = { x: numbers(one.front.x), y: numbers(one.front.y) };
  return chart(place, {
    xLabel: one.labels[0], yLabel: one.labels[1], near: true,
    series: [
      ...series.filter((cloud) => cloud.x.length),
      {
        name: "none is better", unit: "", ...front, colour: "--c1", dots: Array.from(front.x, (_, k) => k),
        tell: (k) => [`design ${one.designs[k]}`, ...data.keys.map((key, j) => `${key}: ${(data.best[one.designs[k]] || [])[j] ?? "\u2013"}`), ...tell(front)(k)],
      },
    ],
  });
}));

function drawAll() {
  for (const draw of drawings) draw();
}

let width = innerWidth;
addEventListener("resize", () => {
  if (innerWidth === width) return;
  width = innerWidth;
  drawAll();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
addEventListener("beforeprint", () => {
  document.documentElement.classList.add("paper");
  for (const one of document.querySelectorAll("details")) one.open = true;
  hideTip();
  drawAll();
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("paper");
  drawAll();
});
addEventListener("scroll", hideTip, { passive: true });
drawAll();
document.documentElement.dataset.drawn = drawings.length;
