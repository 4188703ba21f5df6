// Values over a region of the plan as coloured cells, with a bar that tells the colours.

// spec(): {x, y, columns, rows, values, unit, name, zero, circles, more(value)}; mm in the plan.
function heat(place, holder, spec) {
  const canvas = add(holder, "canvas", { role: "img", tabindex: 0 });
  let at = null;
  let frame = null;

  function draw() {
    const s = spec();
    const width = Math.max(280, Math.min(640, holder.clientWidth || place.clientWidth));
    const pad = { left: 46, right: 76, top: 8, bottom: 38 };
    const ratio = (s.y[1] - s.y[0]) / (s.x[1] - s.x[0] || 1) || 1;
    // A millimetre is as long along x as along y, unless the strip were too thin to read.
    const w = Math.min(width - pad.left - pad.right, 460 / ratio);
    const h = Math.max(80, w * ratio);
    const pen = sharp(canvas, width, h + pad.top + pad.bottom);
    frame = { s, pad, w, h, width };
    const [lo, hi] = range(s.values);
    const colours = palette([lo, hi], s.zero);
    cells(pen, s, pad, w, h, colours);
    if (s.zero && lo < 0 && hi > 0) contour(pen, s, pad, w, h);
    circles(pen, s, pad, w, h);
    axes(pen, s, pad, w, h);
    bar(pen, s, pad, w, h, colours);
    if (at !== null) cross(pen, pad, w, h);
    canvas.setAttribute("aria-label", `${place.dataset.what}; from ${say(lo)} to ${say(hi)} ${s.unit}. Arrow keys read the values.`);
  }

  const cw = () => frame.w / frame.s.columns;
  const ch = () => frame.h / frame.s.rows;

  function cells(pen, s, pad, w, h, colours) {
    const image = new ImageData(s.columns, s.rows);
    s.values.forEach((v, k) => {
      const row = s.rows - 1 - Math.floor(k / s.columns);
      const to = 4 * (row * s.columns + (k % s.columns));
      if (!Number.isFinite(v)) return;
      image.data.set([...colours.colour(v), 255], to);
    });
    const small = document.createElement("canvas");
    small.width = s.columns;
    small.height = s.rows;
    small.getContext("2d").putImageData(image, 0, 0);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(small, pad.left, pad.top, w, h);
  }

  // Where the values change sign between neighbours.
  function contour(pen, s, pad, w, h) {
    pen.beginPath();
    const [dx, dy] = [w / s.columns, h / s.rows];
    const spot = (c, r) => [pad.left + (c + 0.5) * dx, pad.top + h - (r + 0.5) * dy];
    for (let r = 0; r + 1 < s.rows; r += 1) {
      for (let c = 0; c + 1 < s.columns; c += 1) {
        const corner = [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]];
        const v = corner.map(([i, k]) => s.values[k * s.columns + i]);
        const cuts = [];
        for (let k = 0; k < 4; k += 1) {
          const n = (k + 1) % 4;
          if (Number.isFinite(v[k] + v[n]) && v[k] < 0 !== v[n] < 0) {
            const t = v[k] / (v[k] - v[n]);
            const [a, b] = [spot(...corner[k]), spot(...corner[n])];
            cuts.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
          }
        }
        for (let k = 0; k + 1 < cuts.length; k += 2) {
          pen.moveTo(...cuts[k]);
          pen.lineTo(...cuts[k + 1]);
        }
      }
    }
    pen.lineWidth = 2.6;
    pen.strokeStyle = "rgba(0,0,0,.55)";
    pen.stroke();
    pen.lineWidth = 1.2;
    pen.strokeStyle = "#fff";
    pen.stroke();
  }

  function circles(pen, s, pad, w, h) {
    pen.save();
    pen.beginPath();
    pen.rect(pad.left, pad.top, w, h);
    pen.clip();
    for (const one of s.circles || []) {
      const x = pad.left + ((one.x - s.x[0]) / (s.x[1] - s.x[0])) * w;
      const y = pad.top + h - ((one.y - s.y[0]) / (s.y[1] - s.y[0])) * h;
      const r = (one.radius / (s.x[1] - s.x[0])) * w;
      for (const [line, width] of [["rgba(0,0,0,.5)", 2.4], ["rgba(255,255,255,.9)", 1]]) {
        pen.setLineDash([4, 4]);
        pen.beginPath();
        pen.arc(x, y, Math.max(1, r), 0, 2 * Math.PI);
        pen.strokeStyle = line;
        pen.lineWidth = width;
        pen.stroke();
      }
    }
    pen.restore();
  }

  function axes(pen, s, pad, w, h) {
    pen.strokeStyle = style("--soft");
    pen.fillStyle = style("--soft");
    pen.lineWidth = 1;
    pen.strokeRect(pad.left, pad.top, w, h);
    pen.textAlign = "center";
    for (const v of ticks(...s.x, w / 70)) {
      const x = pad.left + ((v - s.x[0]) / (s.x[1] - s.x[0])) * w;
      pen.fillRect(x - 0.5, pad.top + h, 1, 4);
      pen.fillText(say(v, 6), x, pad.top + h + 17);
    }
    pen.fillText("x / mm", pad.left + w / 2, pad.top + h + 33);
    pen.textAlign = "right";
    for (const v of ticks(...s.y, h / 50)) {
      const y = pad.top + h - ((v - s.y[0]) / (s.y[1] - s.y[0])) * h;
      pen.fillRect(pad.left - 4, y - 0.5, 4, 1);
      pen.fillText(say(v, 6), pad.left - 7, y + 4);
    }
    pen.save();
    pen.translate(11, pad.top + h / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText("y / mm", 0, 0);
    pen.restore();
  }

  function bar(pen, s, pad, w, h, { lo, hi, colour }) {
    const x = pad.left + w + 14;
    for (let k = 0; k < 100; k += 1) {
      pen.fillStyle = css(colour(lo + (k / 99) * (hi - lo)));
      pen.fillRect(x, pad.top + h * (1 - (k + 1) / 100), 13, h / 100 + 0.6);
    }
    pen.fillStyle = style("--soft");
    pen.textAlign = "left";
    for (const v of ticks(lo, hi, h / 42)) {
      const y = pad.top + h * (1 - (v - lo) / (hi - lo));
      pen.fillRect(x + 13, y - 0.5, 3, 1);
      pen.fillText(say(v, 6), x + 19, Math.max(pad.top + 9, y + 4));
    }
    pen.textAlign = "center";
    pen.fillText(s.unit, x + 14, pad.top + h + 17);
  }

  function cross(pen, pad, w, h) {
    const x = pad.left + at[0] * cw();
    const y = pad.top + h - (at[1] + 1) * ch();
    pen.strokeStyle = "#000";
    pen.lineWidth = 3;
    pen.strokeRect(x - 1, y - 1, cw() + 2, ch() + 2);
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.4;
    pen.strokeRect(x - 1, y - 1, cw() + 2, ch() + 2);
  }

  function tell(aloud, clientX, clientY) {
    const { s, pad } = frame;
    const v = s.values[at[1] * s.columns + at[0]];
    const middle = ([from, to], k, count) => (count > 1 ? from + ((to - from) * k) / (count - 1) : from);
    const lines = [
      `x ${say(middle(s.nodesX || s.x, at[0], s.columns))} mm, y ${say(middle(s.nodesY || s.y, at[1], s.rows))} mm`,
      Number.isFinite(v) ? `${s.name}: ${say(v)} ${s.unit}` : "no surface",
      ...(s.more && Number.isFinite(v) ? s.more(v, at[1] * s.columns + at[0]) : []),
    ];
    const r = canvas.getBoundingClientRect();
    showTip(lines, clientX ?? r.left + pad.left + (at[0] + 1) * cw(), clientY ?? r.top + pad.top + frame.h - at[1] * ch(), aloud);
  }

  function move(event) {
    const r = canvas.getBoundingClientRect();
    const { s, pad, w, h } = frame;
    const c = Math.floor((event.clientX - r.left - pad.left) / cw());
    const row = Math.floor((h - (event.clientY - r.top - pad.top)) / ch());
    if (c < 0 || row < 0 || c >= s.columns || row >= s.rows) return leave();
    at = [c, row];
    draw();
    tell(false, event.clientX, event.clientY);
  }

  function leave() {
    at = null;
    hideTip();
    draw();
  }

  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerdown", move);
  canvas.addEventListener("pointerleave", leave);
  canvas.addEventListener("blur", leave);
  canvas.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!way) return;
    event.preventDefault();
    const { columns, rows } = frame.s;
    const [c, r] = at || [Math.floor(columns / 2), Math.floor(rows / 2)];
    at = [Math.max(0, Math.min(columns - 1, c + way[0])), Math.max(0, Math.min(rows - 1, r + way[1]))];
    draw();
    tell(true);
  });
  return draw;
}
