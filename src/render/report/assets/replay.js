// A replay: fingers over the array at one moment, which a slider moves and a button plays.

function replay(place) {
  const r = data.replay;
  const t = numbers(r.t);
  const currents = r.currents.map(numbers);
  const fingers = r.fingers.map((one) => {
    const curves = Object.entries(one).map(([key, packed]) => [key, numbers(packed)]);
    return Object.fromEntries(curves);
  });
  const colours = ["--c0", "--c2"];
  // The requested force is wide and pale, so that one given as requested is seen on it.
  const arrows = [["requested", "--soft", 7, 0.45], ["fixed", "--c1", 2, 1], ["given", null, 2, 1]];
  const most = Math.max(1e-9, ...range(fingers.flatMap((f) => [...f.requested, ...f.given, ...f.fixed])).map(Math.abs));
  const largest = Math.max(1e-9, ...range(currents.flatMap((one) => [...one])).map(Math.abs));
  const shade = palette([-largest, largest], true);

  const control = add(place, "div", { class: "control" });
  const button = add(control, "button", { type: "button" }, "Play");
  const label = add(control, "label", {}, "time");
  const slider = add(label, "input", { type: "range", min: 0, max: Math.max(0, t.length - 1), step: 1, value: 0 });
  const shown = add(control, "output");
  const holder = add(place, "div", { class: "pair" });
  const strip = add(place, "div");
  let move = () => {};

  // Lines of an SVG whose axes are to one scale, mm.
  function view(width, [x0, x1], [y0, y1], names, what) {
    const scale = Math.min((width - 62) / (x1 - x0), 380 / (y1 - y0));
    const [w, h] = [(x1 - x0) * scale, (y1 - y0) * scale];
    const svg = add(add(holder, "div"), "svg", {
      width: w + 62, height: h + 46, viewBox: `0 0 ${w + 62} ${h + 46}`, role: "img", "aria-label": what,
    });
    const px = (x) => 50 + (x - x0) * scale;
    const py = (y) => 8 + (y1 - y) * scale;
    for (const v of ticks(x0, x1, w / 75)) add(svg, "text", { x: px(v), y: h + 24, "text-anchor": "middle" }, say(v, 6));
    for (const v of ticks(y0, y1, h / 45)) {
      add(svg, "line", { class: "grid", x1: 50, x2: 50 + w, y1: py(v), y2: py(v) });
      add(svg, "text", { x: 44, y: py(v) + 4, "text-anchor": "end" }, say(v, 6));
    }
    add(svg, "text", { x: 50 + w / 2, y: h + 41, "text-anchor": "middle" }, names[0]);
    turned(svg, 12, 8 + h / 2, -90, names[1]);
    return { svg, px, py, scale };
  }

  function path(svg, points, attributes) {
    return add(svg, "path", { fill: "none", d: points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`).join(""), ...attributes });
  }

  function plan(width) {
    const all = (key, edge) => range([...fingers.flatMap((f) => [...f[key]]), ...r.coils.flatMap((c) => [c[edge] - r.radius, c[edge] + r.radius])]);
    const at = view(width, all("x", 0), all("y", 1), ["x / mm", "y / mm"], "The array from above with the currents, and where the fingers are.");
    const coils = r.coils.map(([x, y], i) => {
      const circle = add(at.svg, "circle", { cx: at.px(x), cy: at.py(y), r: r.radius * at.scale, stroke: style("--soft") });
      if (r.coils.length <= 36) add(at.svg, "text", { class: "over", x: at.px(x), y: at.py(y) + 4, "text-anchor": "middle" }, String(i));
      return circle;
    });
    const dots = fingers.map((f, n) => {
      path(at.svg, Array.from(t, (_, k) => [at.px(f.x[k]), at.py(f.y[k])]), { stroke: style(colours[n]), "stroke-opacity": 0.35 });
      return add(at.svg, "circle", { r: 6, fill: style(colours[n]), stroke: style("--ground"), "stroke-width": 2 });
    });
    return (k) => {
      coils.forEach((circle, i) => circle.setAttribute("fill", css(shade.colour(currents[i][k]))));
      dots.forEach((dot, n) => {
        dot.setAttribute("cx", at.px(fingers[n].x[k]));
        dot.setAttribute("cy", at.py(fingers[n].y[k]));
      });
    };
  }

  function section(width) {
    const x = range([...fingers.flatMap((f) => [...f.x]), ...r.coils.flatMap((c) => [c[0] - r.radius, c[0] + r.radius])]);
    const top = range(fingers.flatMap((f) => [...f.z, ...f.surface]))[1];
    const arrow = 0.35 * top / most;
    const at = view(width, x, [-0.15 * top, 1.4 * top], ["x / mm", "z / mm"], "The fingers from the side with the forces on them, and the height of the surface.");
    for (const x of new Set(r.coils.map(([x]) => x))) {
      const wide = { x: at.px(x - r.radius), width: 2 * r.radius * at.scale };
      add(at.svg, "rect", { ...wide, y: at.py(0), height: at.py(-0.15 * top) - at.py(0), fill: style("--grid"), stroke: style("--soft") });
    }
    const moving = fingers.map((f, n) => ({
      surface: add(at.svg, "line", { stroke: style("--soft"), "stroke-width": 3 }),
      lines: arrows.map(([, colour, size, opacity]) => add(at.svg, "line", { stroke: style(colour || colours[n]), "stroke-width": size, "stroke-opacity": opacity })),
      dot: add(at.svg, "circle", { r: 5, fill: style(colours[n]), stroke: style("--ground"), "stroke-width": 2 }),
    }));
    return (k) => moving.forEach((one, n) => {
      const f = fingers[n];
      const [x0, z0] = [at.px(f.x[k]), at.py(f.z[k])];
      const felt = f.surface[k] > 0;
      for (const [key, v] of Object.entries({ x1: x0 - 14, x2: x0 + 14, y1: at.py(f.surface[k]), y2: at.py(f.surface[k]), visibility: felt ? "visible" : "hidden" })) one.surface.setAttribute(key, v);
      one.lines.forEach((line, i) => {
        const force = f[arrows[i][0]][k] * arrow;
        const sideways = (f[`${arrows[i][0]}_x`] || [])[k] || 0;
        for (const [key, v] of Object.entries({ x1: x0, y1: z0, x2: x0 + sideways * arrow * at.scale, y2: z0 - force * at.scale })) line.setAttribute(key, v);
      });
      one.dot.setAttribute("cx", x0);
      one.dot.setAttribute("cy", z0);
    });
  }

  function over(width) {
    const height = 170;
    const [lo, hi] = range([0, ...fingers.flatMap((f) => [...f.requested, ...f.given, ...f.fixed])]);
    const [from, to] = [t[0] ?? 0, Math.max(t[t.length - 1] ?? 1, (t[0] ?? 0) + 1e-9)];
    const svg = add(strip, "svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "Upward forces over time." });
    const px = (v) => 50 + ((v - from) / (to - from)) * (width - 62);
    const py = (v) => 8 + ((hi - v) / (hi - lo || 1)) * (height - 50);
    for (const v of ticks(lo, hi, 3)) {
      add(svg, "line", { class: "grid", x1: 50, x2: width - 12, y1: py(v), y2: py(v) });
      add(svg, "text", { x: 44, y: py(v) + 4, "text-anchor": "end" }, say(v, 6));
    }
    for (const v of ticks(from, to, width / 90)) add(svg, "text", { x: px(v), y: height - 22, "text-anchor": "middle" }, say(v, 6));
    add(svg, "text", { x: width / 2, y: height - 5, "text-anchor": "middle" }, "t / s");
    turned(svg, 12, 70, -90, "F / mN");
    fingers.forEach((f, n) => arrows.forEach(([key, colour, size, opacity]) => {
      path(svg, Array.from(t, (time, k) => [px(time), py(f[key][k])]), { stroke: style(colour || colours[n]), "stroke-width": 0.65 * size, "stroke-opacity": opacity });
    }));
    const cursor = add(svg, "line", { class: "cursor", y1: 8, y2: height - 42 });
    return (k) => {
      cursor.setAttribute("x1", px(t[k]));
      cursor.setAttribute("x2", px(t[k]));
    };
  }

  const numbersOf = (k) => fingers.map((f) => {
    const off = f.given[k] - f.requested[k];
    return `(${[f.x, f.y, f.z].map((v) => say(v[k], 4)).join(", ")}) mm: requested ${say(f.requested[k], 3)} mN, given ${say(f.given[k], 3)} mN (${say(off, 2)} off), with fixed currents ${say(f.fixed[k], 3)} mN`;
  }).join("; ");
  const now = add(place, "p", { class: "note" });

  function show() {
    const k = Number(slider.value);
    shown.textContent = `${say(t[k], 4)} s`;
    slider.setAttribute("aria-valuetext", `${shown.textContent}: ${numbersOf(k)}`);
    now.textContent = numbersOf(k);
    move(k);
  }

  let playing = null;
  function stop() {
    if (playing !== null) cancelAnimationFrame(playing);
    playing = null;
    button.textContent = "Play";
  }
  button.addEventListener("click", () => {
    if (playing !== null) {
      stop();
      return;
    }
    button.textContent = "Pause";
    if (Number(slider.value) >= t.length - 1) slider.value = 0;
    const begun = performance.now() / 1e3 - (t[slider.value] - t[0]);
    const step = () => {
      const time = t[0] + performance.now() / 1e3 - begun;
      let k = Number(slider.value);
      while (k < t.length - 1 && t[k + 1] <= time) k += 1;
      slider.value = k;
      show();
      if (k >= t.length - 1) stop();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => {
    stop();
    show();
  });

  return () => {
    holder.replaceChildren();
    strip.replaceChildren();
    const width = Math.max(280, place.clientWidth);
    const each = width >= 2 * 480 + 32 ? (width - 32) / 2 : width;
    const parts = [plan(each), section(each), over(width)];
    move = (k) => parts.forEach((part) => part(k));
    if (t.length) show();
  };
}
