// The view of the surface: turned by mouse, touch, arrow keys and buttons.

function turn(place) {
  const START = { yaw: 0.55, pitch: 0.5 };
  const scene = { surface: surfaceOf(data.surface), coils: data.coils };
  scene.colours = [palette(range(scene.surface.height), false), palette(range(scene.surface.error), true)];
  scene.top = Math.max(1, range(scene.surface.height)[1]);
  // The floor holds the surface and every coil.
  scene.floor = ["x", "y"].map((axis) => {
    const reach = data.coils.flatMap((coil) => [coil[axis] - coil.radius, coil[axis] + coil.radius]);
    return range([...scene.surface[axis], ...reach]);
  });
  const hasError = data.errors === true;
  const worse = (best, e, k) => (Number.isFinite(e) && !(Math.abs(e) <= Math.abs(scene.surface.error[best])) ? k : best);
  scene.worst = hasError ? scene.surface.error.reduce(worse, -1) : -1;
  const look = { byError: hasError, points: true };
  const view = { ...START };
  let spots = [];

  const control = add(place, "div", { class: "control" });
  if (hasError) {
    const label = add(control, "label", {}, "colour");
    const choice = add(label, "select");
    add(choice, "option", { value: "error" }, "force error");
    add(choice, "option", { value: "height" }, "height");
    choice.addEventListener("change", () => {
      look.byError = choice.value === "error";
      draw();
    });
  }
  const label = add(control, "label");
  const tick = add(label, "input", { type: "checkbox" });
  tick.checked = true;
  label.append("points");
  tick.addEventListener("change", () => {
    look.points = tick.checked;
    draw();
  });
  const canvas = document.createElement("canvas");
  for (const [name, what, yaw, pitch] of [["\u25c0", "left", -1, 0], ["\u25b6", "right", 1, 0], ["\u25b2", "up", 0, 1], ["\u25bc", "down", 0, -1]]) {
    add(control, "button", { type: "button", "aria-label": `Turn ${what}`, title: `Turn ${what}` }, name)
      .addEventListener("click", () => by(0.26 * yaw, 0.2 * pitch));
  }
  add(control, "button", { type: "button" }, "reset").addEventListener("click", () => {
    Object.assign(view, START);
    draw();
  });
  canvas.setAttribute("role", "img");
  canvas.tabIndex = 0;
  place.append(canvas);

  function by(yaw, pitch) {
    view.yaw = (view.yaw + yaw) % (2 * Math.PI);
    view.pitch = Math.max(0.02, Math.min(Math.PI / 2, view.pitch + pitch));
    draw();
  }

  function draw() {
    const width = Math.max(280, place.clientWidth);
    const height = Math.round(Math.min(430, Math.max(300, width * 0.78)));
    const pen = sharp(canvas, width, height);
    const [x, y] = scene.floor;
    const middle = [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2, scene.top / 2];
    const across = Math.hypot(x[1] - x[0], y[1] - y[0]);
    const up = Math.sin(view.pitch) * across + Math.cos(view.pitch) * scene.top;
    const scale = Math.min((width - 60) / across, (height - 70) / up);
    spots = paintScene(pen, scene, projector(view.yaw, view.pitch, scale, middle, width / 2, (height - 26) / 2), look);
    const { lo, hi, colour } = scene.colours[look.byError ? 1 : 0];
    const unit = look.byError ? "mN" : "mm";
    for (let k = 0; k < 60; k += 1) {
      pen.fillStyle = css(colour(lo + (k / 59) * (hi - lo)));
      pen.fillRect(8 + k * 1.6, height - 14, 2.2, 8);
    }
    pen.fillStyle = style("--soft");
    pen.textAlign = "left";
    pen.fillText(`${say(lo, 3)} to ${say(hi, 3)} ${unit}`, 112, height - 6);
    canvas.setAttribute("aria-label", `${place.dataset.what}; turned by ${Math.round((view.yaw * 180) / Math.PI)} degrees, seen from ${Math.round((view.pitch * 180) / Math.PI)} degrees above. Arrow keys turn it.`);
    canvas.dataset.yaw = view.yaw.toFixed(4);
    canvas.dataset.pitch = view.pitch.toFixed(4);
  }

  function tell(event) {
    const r = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - r.left, event.clientY - r.top];
    let best = -1;
    let nearest = 14 * 14;
    spots.forEach((spot, k) => {
      if (!spot) return;
      const d = (spot[0] - x) ** 2 + (spot[1] - y) ** 2;
      // Of points behind each other the one in front.
      if (d < nearest - 1 || (d < nearest + 1 && best >= 0 && spot[2] < spots[best][2])) {
        nearest = d;
        best = k;
      }
    });
    if (best < 0) return hideTip();
    const [px, py, h] = scene.surface.nodes[best];
    const lines = [`x ${say(px)} mm, y ${say(py)} mm, height ${say(h)} mm`];
    if (hasError) lines.push(`force error ${say(scene.surface.error[best])} mN`);
    showTip(lines, event.clientX, event.clientY, false);
  }

  let from = null;
  canvas.addEventListener("pointerdown", (event) => {
    from = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
    hideTip();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!from) return tell(event);
    by((event.clientX - from[0]) * -0.009, (event.clientY - from[1]) * 0.007);
    from = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (from = null));
  canvas.addEventListener("pointerleave", hideTip);
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!way) return;
    event.preventDefault();
    by(0.12 * way[0], 0.1 * way[1]);
  });
  return draw;
}
