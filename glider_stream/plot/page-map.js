// The map: water, land, arrows, rules and fronts on a canvas; above it, the route as lines that keep their width.
const map = at("map"), water = at("water"), world = at("world"), pen = water.getContext("2d");
const view = { x: 0, y: 0, scale: 1, fit: 1, width: 1, height: 1, moved: false };
const chosen = { level: 0, time: 0, leg: -1, every: data.fronts ? data.fronts.hours : 0 };
const GAP = 34; // pixels between arrows

const screenX = (x) => (x - view.x) * view.scale + view.width / 2;
const screenY = (y) => view.height / 2 - (y - view.y) * view.scale;
const worldX = (px) => view.x + (px - view.width / 2) / view.scale;
const worldY = (py) => view.y - (py - view.height / 2) / view.scale;

// a picture with a pixel for each cell, from the north down as pictures are
const painted = (cells, colour) => {
  const [columns, rows] = cells, picture = document.createElement("canvas");
  picture.width = columns;
  picture.height = rows;
  const brush = picture.getContext("2d"), image = brush.createImageData(columns, rows);
  for (let j = 0; j < rows; j++)
    for (let i = 0; i < columns; i++)
      image.data.set(colour(j * columns + i), 4 * ((rows - 1 - j) * columns + i));
  brush.putImageData(image, 0, 0);
  return picture;
};
const rgb = (hex) => [0, 1, 2].map((k) => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16));

let speedPicture, landPicture;
const paint = () => {
  showCurrent(chosen.level, chosen.time);
  const stops = speedStops(), { u, v } = flowNow;
  speedPicture = painted(data.current.cells, (k) =>
    u[k] === null ? [0, 0, 0, 0] : [...mixed(stops, Math.hypot(u[k], v[k]) / 1000 / data.current.fastest), 255]);
  if (!data.seabed) return;
  const land = [...rgb(look("--land")), 255], shallow = [...rgb(look("--shallow")), 255];
  const depth = data.current.depths[chosen.level], ground = data.seabed.depth;
  landPicture = painted(data.seabed.cells, (k) =>
    ground[k] === 0 ? land : ground[k] !== null && ground[k] < depth ? shallow : [0, 0, 0, 0]);
};

// the sides of cells where land meets water
const coast = new Path2D();
if (data.seabed) {
  const [columns, rows] = data.seabed.cells, ground = data.seabed.depth;
  const wide = (east - west) / columns, high = (north - south) / rows;
  const isLand = (i, j) => ground[j * columns + i] === 0;
  for (let j = 0; j < rows; j++)
    for (let i = 0; i < columns; i++) {
      const x = west + (i + 1) * wide, y = south + (j + 1) * high;
      if (i + 1 < columns && isLand(i, j) !== isLand(i + 1, j)) { coast.moveTo(x, y - high); coast.lineTo(x, y); }
      if (j + 1 < rows && isLand(i, j) !== isLand(i, j + 1)) { coast.moveTo(x - wide, y); coast.lineTo(x, y); }
    }
}

const rules = (() => {
  const p = ruled.points, x = [], y = [], triangles = [];
  for (let j = 0; j < p; j++)
    for (let i = 0; i < p; i++) {
      x.push(between(west, east, i / (p - 1)));
      y.push(between(south, north, j / (p - 1)));
      const k = j * p + i;
      if (i + 1 < p && j + 1 < p) triangles.push(k, k + 1, k + p, k + 1, k + p + 1, k + p);
    }
  return ["a", "b"].map((name) => ({ x, y, triangles, value: ruled[name] }));
})();
const fronts = data.fronts && { ...data.fronts, value: data.fronts.time };
let frontLines = [];
const traceFronts = () => {
  frontLines = [];
  if (!fronts || !chosen.every) return;
  for (let n = 1; n * chosen.every <= data.fronts.last; n++)
    frontLines.push({ hours: n * chosen.every, parts: segments(fronts, n * chosen.every * 3600) });
};

const strokeParts = (parts) => {
  pen.beginPath();
  for (const [x, y, xx, yy] of parts) { pen.moveTo(screenX(x), screenY(y)); pen.lineTo(screenX(xx), screenY(yy)); }
  pen.stroke();
};
const write = (text, x, y, colour) => {
  pen.lineWidth = 3;
  pen.strokeStyle = look("--casing");
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
};

const drawRules = () => {
  const shown = [worldX(0), worldX(view.width), worldY(view.height), worldY(0)];
  const [x0, x1] = [Math.max(shown[0], west), Math.min(shown[1], east)];
  const [y0, y1] = [Math.max(shown[2], south), Math.min(shown[3], north)];
  if (x0 >= x1 || y0 >= y1) return;
  const corners = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(([x, y]) => rulesAt(x, y));
  const most = [clamp(((x1 - x0) * view.scale) / 90, 1, 8), clamp(((y1 - y0) * view.scale) / 70, 1, 8)];
  pen.font = "11.5px system-ui, 'Liberation Sans', sans-serif";
  rules.forEach((mesh, axis) => {
    const values = corners.map((corner) => corner[axis]), low = Math.min(...values), high = Math.max(...values);
    const step = roundStep(Math.max(high - low, 1e-9), most[axis]);
    const digits = clamp(-Math.floor(Math.log10(step) + 1e-9), 0, 6);
    for (let n = Math.ceil(low / step); n * step <= high; n++) {
      const parts = segments(mesh, n * step);
      pen.strokeStyle = look("--grid");
      pen.lineWidth = 1;
      strokeParts(parts);
      // a meridian is named where it leaves the map below, a parallel where it does at the left
      const seen = parts.filter(([x, y]) => x >= x0 && x <= x1 && y >= y0 && y <= y1);
      if (!seen.length) continue;
      const first = seen.reduce((a, b) => (axis ? (b[0] < a[0] ? b : a) : b[1] < a[1] ? b : a));
      const number = data.lonlat ? angle(n * step, axis ? "NS" : "EW", digits) : `${+(n * step).toFixed(digits)} ${data.unit.name}`;
      pen.textAlign = axis ? "left" : "center";
      const x = axis ? Math.max(screenX(x0), 0) + 5 : clamp(screenX(first[0]), Math.max(screenX(x0), 0) + 24, Math.min(screenX(x1), view.width) - 24);
      const y = axis ? screenY(first[1]) - 4 : Math.min(screenY(y0), view.height) - 6;
      if (!axis || (y > 44 && y < view.height - 52)) write(number, x, y, look("--soft"));
    }
  });
};

const drawFronts = () => {
  const placed = [], colour = look("--front");
  pen.font = "12px system-ui, 'Liberation Sans', sans-serif";
  pen.textAlign = "center";
  // away from the names of the parallels, and from the buttons
  const left = Math.max(0, screenX(west)) + 66, right = Math.min(view.width - 60, screenX(east) - 24);
  for (const { hours, parts } of frontLines) {
    pen.strokeStyle = colour;
    pen.lineWidth = 1.3;
    strokeParts(parts);
    let best = null, room = 46;
    for (const [x, y, xx, yy] of parts) {
      const px = screenX((x + xx) / 2), py = screenY((y + yy) / 2);
      if (px < left || px > right || py < 40 || py > view.height - 40) continue;
      const free = Math.min(200, ...placed.map(([a, b]) => Math.hypot(a - px, b - py)));
      if (free > room) { room = free; best = [px, py]; }
    }
    if (!best) continue;
    placed.push(best);
    write(`${+hours.toFixed(3)} h`, best[0], best[1] + 4, colour);
  }
};

const drawArrows = () => {
  const step = GAP / view.scale, depth = data.current.depths[chosen.level];
  pen.strokeStyle = look("--arrow");
  pen.globalAlpha = 0.55;
  pen.lineWidth = 1.2;
  pen.beginPath();
  for (let x = Math.ceil(Math.max(worldX(0), west) / step) * step; x <= Math.min(worldX(view.width), east); x += step)
    for (let y = Math.ceil(Math.max(worldY(view.height), south) / step) * step; y <= Math.min(worldY(0), north); y += step) {
      const current = currentAt(x, y), ground = seabedAt(x, y);
      if (!current || (ground !== null && (ground === 0 || ground < depth))) continue;
      const speed = Math.hypot(...current);
      // by the square root: slow water stays readable next to fast
      const long = 0.84 * GAP * Math.sqrt(speed / (data.current.fastest || 1)), a = current[0] / (speed || 1), b = -current[1] / (speed || 1);
      if (long < 2) continue;
      const px = screenX(x) + (a * long) / 2, py = screenY(y) + (b * long) / 2, barb = Math.min(5, long * 0.4);
      pen.moveTo(px - a * long, py - b * long);
      pen.lineTo(px, py);
      pen.moveTo(px - barb * (a + 0.55 * b), py - barb * (b - 0.55 * a));
      pen.lineTo(px, py);
      pen.lineTo(px - barb * (a - 0.55 * b), py - barb * (b + 0.55 * a));
    }
  pen.stroke();
  pen.globalAlpha = 1;
};

const drawScale = () => {
  const step = roundStep(140 / view.scale, 2), long = step * view.scale, y = view.height - 26;
  pen.strokeStyle = look("--ink");
  pen.lineWidth = 1.6;
  pen.beginPath();
  pen.moveTo(view.width - 14 - long, y - 4);
  pen.lineTo(view.width - 14 - long, y);
  pen.lineTo(view.width - 14, y);
  pen.lineTo(view.width - 14, y - 4);
  pen.stroke();
  pen.textAlign = "center";
  write(step >= 1000 ? `${step / 1000} km` : `${step} m`, view.width - 14 - long / 2, y - 6, look("--ink"));
};

const star = (x, y, r) =>
  [...Array(10).keys()].map((k) => {
    const turn = (k * Math.PI) / 5, far = k % 2 ? 0.42 * r : r;
    return `${x + far * Math.sin(turn)},${y - far * Math.cos(turn)}`;
  }).join(" ");
const marks = {
  start: shape("circle", { r: 6, class: "end" }),
  goal: shape("polygon", { class: "end" }),
  now: shape("circle", { r: 6.5, class: "cursor" }),
};
at("marks").append(marks.start, marks.goal, marks.now);
const placeMarks = () => {
  const last = legs[legs.length - 1], here = glider(chosen.time);
  marks.start.setAttribute("cx", screenX(legs[0].x[0]));
  marks.start.setAttribute("cy", screenY(legs[0].y[0]));
  marks.goal.setAttribute("points", star(screenX(last.x[last.x.length - 1]), screenY(last.y[last.y.length - 1]), 10));
  marks.now.setAttribute("cx", screenX(here.x));
  marks.now.setAttribute("cy", screenY(here.y));
};

// the route in pieces, each the colour of its time
const pieces = [];
const PIECES = clamp(Math.ceil(400 / legs.length), 1, 24);
legs.forEach((leg, n) => {
  const whole = leg.x.map((x, i) => `${i ? "L" : "M"}${x} ${leg.y[i]}`).join("");
  at("casing").append(shape("path", { d: whole }));
  const count = Math.min(PIECES, leg.x.length - 1);
  for (let k = 0; k < count; k++) {
    const from = Math.floor((k * (leg.x.length - 1)) / count), to = Math.floor(((k + 1) * (leg.x.length - 1)) / count);
    const d = leg.x.slice(from, to + 1).map((x, i) => `${i ? "L" : "M"}${x} ${leg.y[from + i]}`).join("");
    const made = shape("path", { d, "data-leg": n });
    pieces.push({ made, leg: n, from, to, time: (leg.t[from] + leg.t[to]) / 2 });
    at("track").append(made);
  }
});
at("stops").setAttribute("d", legs.slice(1).map((leg) => `M${leg.x[0]} ${leg.y[0]}h0`).join(""));

// the plan that holds at the chosen time: dashed, and only where a run is played
let shownPlan = -1;
const placePlan = () => {
  if (!data.plans.length) return;
  const n = lastBelow(data.plans.map((plan) => plan.t), chosen.time), { x, y } = data.plans[n];
  if (n === shownPlan) return;
  shownPlan = n;
  at("plan").setAttribute("d", x.map((east, i) => `${i ? "L" : "M"}${east} ${y[i]}`).join(""));
};

const draw = () => {
  const ratio = window.devicePixelRatio || 1, { width, height, scale } = view;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const box = [screenX(west), screenY(north), (east - west) * scale, (north - south) * scale];
  pen.imageSmoothingEnabled = true;
  pen.drawImage(speedPicture, ...box);
  drawArrows();
  if (landPicture) {
    pen.imageSmoothingEnabled = false;
    pen.drawImage(landPicture, ...box);
    pen.save();
    pen.transform(scale, 0, 0, -scale, width / 2 - view.x * scale, height / 2 + view.y * scale);
    pen.lineWidth = 1.4 / scale;
    pen.strokeStyle = look("--coast");
    pen.stroke(coast);
    pen.restore();
  }
  drawRules();
  drawFronts();
  drawScale();
  world.setAttribute("transform", `matrix(${scale} 0 0 ${-scale} ${width / 2 - view.x * scale} ${height / 2 + view.y * scale})`);
  placeMarks();
};
let waiting = false;
const redraw = () => {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
};
const showAll = () => {
  Object.assign(view, { x: (west + east) / 2, y: (south + north) / 2, scale: view.fit, moved: false });
  redraw();
};
const zoom = (factor, px = view.width / 2, py = view.height / 2) => {
  const x = worldX(px), y = worldY(py);
  view.scale = clamp(view.scale * factor, view.fit * 0.5, view.fit * 400);
  view.x = x - (px - view.width / 2) / view.scale;
  view.y = y + (py - view.height / 2) / view.scale;
  view.moved = true;
  redraw();
};
const move = (dx, dy) => {
  view.x = clamp(view.x - dx / view.scale, west, east);
  view.y = clamp(view.y + dy / view.scale, south, north);
  view.moved = true;
  redraw();
};
const sizeMap = () => {
  const ratio = window.devicePixelRatio || 1;
  view.width = map.clientWidth;
  view.height = map.clientHeight;
  view.fit = 0.97 * Math.min(view.width / (east - west), view.height / (north - south));
  water.width = Math.round(view.width * ratio);
  water.height = Math.round(view.height * ratio);
  if (view.moved) draw(); else { showAll(); draw(); }
};

// the time at which the route passes a pixel most closely, null where it is farther than some pixels
const nearest = (px, py, within) => {
  const x = worldX(px), y = worldY(py);
  let least = (within / view.scale) ** 2, time = null;
  for (const leg of legs)
    for (let i = 0; i + 1 < leg.x.length; i++) {
      const dx = leg.x[i + 1] - leg.x[i], dy = leg.y[i + 1] - leg.y[i], long = dx * dx + dy * dy;
      const share = long > 0 ? clamp(((x - leg.x[i]) * dx + (y - leg.y[i]) * dy) / long, 0, 1) : 0;
      const far = (x - leg.x[i] - share * dx) ** 2 + (y - leg.y[i] - share * dy) ** 2;
      if (far < least) { least = far; time = between(leg.t[i], leg.t[i + 1], share); }
    }
  return time;
};
