// The surface, its points and the coils as shapes in space, farthest first.

// A view: turned about z by yaw, then tipped by pitch; parallel, so that lengths compare.
function projector(yaw, pitch, scale, middle, cx, cy) {
  const [sy, cyaw] = [Math.sin(yaw), Math.cos(yaw)];
  const [sp, cp] = [Math.sin(pitch), Math.cos(pitch)];
  return (x, y, z) => {
    const [a, b, c] = [x - middle[0], y - middle[1], z - middle[2]];
    const right = cyaw * a - sy * b;
    const away = sy * a + cyaw * b;
    return [cx + scale * right, cy - scale * (sp * away + cp * c), cp * away - sp * c];
  };
}

function surfaceOf(s) {
  const height = numbers(s.height);
  const error = numbers(s.error);
  const node = (k) => {
    const [c, r] = [k % s.columns, Math.floor(k / s.columns)];
    const on = ([from, to], i, n) => (n > 1 ? from + ((to - from) * i) / (n - 1) : from);
    return [on(s.x, c, s.columns), on(s.y, r, s.rows), height[k]];
  };
  const nodes = Array.from(height, (h, k) => node(k));
  const there = (c, r) => c >= 0 && r >= 0 && c < s.columns && r < s.rows && Number.isFinite(height[r * s.columns + c]);
  const cell = Math.hypot((s.x[1] - s.x[0]) / (s.columns - 1 || 1), (s.y[1] - s.y[0]) / (s.rows - 1 || 1));
  // A face that plunges at a rim hangs from few points: it would show the grid, not the surface.
  const plunges = (face) => {
    const [lo, hi] = range(face.map((k) => height[k]));
    const atRim = face.some((k) => {
      const [c, r] = [k % s.columns, Math.floor(k / s.columns)];
      return [[1, 0], [-1, 0], [0, 1], [0, -1]].some(([dc, dr]) => !there(c + dc, r + dr));
    });
    return atRim && hi - lo > 2 * cell;
  };
  const faces = [];
  for (let r = 0; r + 1 < s.rows; r += 1) {
    for (let c = 0; c + 1 < s.columns; c += 1) {
      const k = r * s.columns + c;
      const corners = [k, k + 1, k + s.columns + 1, k + s.columns];
      const face = corners.filter((i) => Number.isFinite(height[i]));
      if (face.length > 2 && !plunges(face)) faces.push(face);
    }
  }
  return { ...s, height, error, nodes, faces };
}

function paintScene(pen, scene, view, look) {
  const { surface, coils } = scene;
  const spots = surface.nodes.map((n) => (Number.isFinite(n[2]) ? view(...n) : null));
  const shapes = [];
  const values = look.byError ? surface.error : surface.height;
  const { colour } = scene.colours[look.byError ? 1 : 0];
  for (const face of surface.faces) {
    let value = 0;
    let depth = 0;
    for (const k of face) {
      value += values[k] / face.length;
      depth += spots[k][2] / face.length;
    }
    shapes.push({ depth, face, fill: css(colour(value)) });
  }
  shapes.sort((a, b) => b.depth - a.depth);
  // The coils stand below every point, so they are behind as long as one looks from above.
  const most = Math.max(...coils.map((coil) => Math.abs(coil.current)));
  for (const coil of coils) paintCoil(pen, coil, most > 0 ? Math.abs(coil.current) / most : 0, view);
  paintAxes(pen, scene, view);
  pen.lineWidth = 0.7;
  for (const { face, fill } of shapes) {
    pen.beginPath();
    face.forEach((k, i) => (i ? pen.lineTo(spots[k][0], spots[k][1]) : pen.moveTo(spots[k][0], spots[k][1])));
    pen.closePath();
    pen.fillStyle = fill;
    pen.strokeStyle = fill;
    pen.fill();
    pen.stroke();
  }
  if (look.points) {
    pen.fillStyle = "rgba(0,0,0,.55)";
    for (const spot of spots) if (spot) pen.fillRect(spot[0] - 0.6, spot[1] - 0.6, 1.2, 1.2);
  }
  const worst = scene.worst >= 0 ? spots[scene.worst] : null;
  if (worst) {
    for (const [line, width] of [["#000", 3.5], ["#fff", 1.6]]) {
      pen.beginPath();
      pen.arc(worst[0], worst[1], 6, 0, 2 * Math.PI);
      pen.strokeStyle = line;
      pen.lineWidth = width;
      pen.stroke();
    }
  }
  return spots;
}

function paintCoil(pen, coil, part, view) {
  const ring = (radius) => {
    for (let k = 0; k <= 40; k += 1) {
      const angle = (2 * Math.PI * k) / 40;
      const [x, y] = view(coil.x + radius * Math.cos(angle), coil.y + radius * Math.sin(angle), 0);
      if (k) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    }
    pen.closePath();
  };
  pen.strokeStyle = style("--soft");
  pen.lineWidth = 1;
  pen.beginPath();
  ring(coil.radius);
  ring(coil.bore);
  pen.globalAlpha = 0.1 + 0.6 * part;
  pen.fillStyle = style("--c1");
  pen.fill("evenodd");
  pen.globalAlpha = 1;
  pen.stroke();
  if (coil.core > 0) {
    pen.beginPath();
    ring(coil.core);
    pen.globalAlpha = 0.35;
    pen.fillStyle = style("--soft");
    pen.fill();
    pen.globalAlpha = 1;
    pen.stroke();
  }
}

// Axes along those edges of the floor that are nearest to the eye, the height at the leftmost corner.
function paintAxes(pen, scene, view) {
  const { top, floor } = scene;
  const [x, y] = floor;
  pen.strokeStyle = style("--line");
  pen.lineWidth = 1;
  const line = (...points) => {
    pen.beginPath();
    points.forEach((p, i) => {
      const [a, b] = view(...p);
      if (i) pen.lineTo(a, b);
      else pen.moveTo(a, b);
    });
    pen.stroke();
  };
  const corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
  line(...corners.map((c) => [...c, 0]), [...corners[0], 0]);
  const middle = [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2];
  const nearer = (a, b) => (view(...a, 0)[2] <= view(...b, 0)[2] ? a : b);
  const yEdge = nearer([middle[0], y[0]], [middle[0], y[1]])[1];
  const xEdge = nearer([x[0], middle[1]], [x[1], middle[1]])[0];
  const left = corners.reduce((a, b) => (view(...a, 0)[0] <= view(...b, 0)[0] ? a : b));
  line([...left, 0], [...left, top]);
  pen.fillStyle = style("--soft");
  pen.textAlign = "center";
  const label = (text, p, dx, dy) => {
    const [a, b] = view(...p);
    const before = pen.measureText(text).width * (pen.textAlign === "right" ? 1 : 0.5);
    pen.fillText(text, Math.max(a + dx, before + 2), b + dy + 4);
  };
  // Labels stand off from their edge, away from the floor's middle.
  const off = (p) => {
    const [a, b] = view(...p, 0);
    const [c, d] = view(...middle, 0);
    const size = Math.hypot(a - c, b - d) || 1;
    return [(a - c) / size, Math.max(0.4, (b - d) / size)];
  };
  const [xOff, yOff] = [off([middle[0], yEdge]), off([xEdge, middle[1]])];
  for (const v of ticks(...x, 4)) label(say(v, 5), [v, yEdge, 0], 13 * xOff[0], 13 * xOff[1]);
  for (const v of ticks(...y, 4)) label(say(v, 5), [xEdge, v, 0], 13 * yOff[0], 13 * yOff[1]);
  label("x / mm", [middle[0], yEdge, 0], 38 * xOff[0], 34 * xOff[1]);
  label("y / mm", [xEdge, middle[1], 0], 38 * yOff[0], 34 * yOff[1]);
  pen.textAlign = "right";
  for (const v of ticks(0, top, 3)) if (v > 0) label(say(v, 5), [...left, v], -6, 0);
  label("z / mm", [...left, top], 4, -14);
}
