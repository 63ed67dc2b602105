"use strict";
// What the page knows: places, times, currents and the seabed, read from its one JSON text.
const data = JSON.parse(document.getElementById("data").textContent);
const [west, east, south, north] = data.box;
const legs = data.legs;
const total = data.time.total;

const at = (id) => document.getElementById(id);
const shape = (name, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  return made;
};
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const between = (a, b, share) => a + (b - a) * share;
const look = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const isDark = () => document.documentElement.dataset.theme === "dark";

// the number of the last value that is not above `wanted`; the values rise
const lastBelow = (values, wanted) => {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= wanted) low = middle; else high = middle - 1;
  }
  return low;
};
const departures = legs.map((leg) => leg.depart);

// where the glider is at a time [s]
const glider = (time) => {
  const n = lastBelow(departures, time), leg = legs[n];
  const i = Math.min(lastBelow(leg.t, time), Math.max(leg.t.length - 2, 0)), j = Math.min(i + 1, leg.t.length - 1);
  const span = leg.t[j] - leg.t[i], share = span > 0 ? clamp((time - leg.t[i]) / span, 0, 1) : 0;
  const read = (values) => between(values[i], values[j], share);
  const ground = leg.seabed[i] === null || leg.seabed[j] === null ? null : read(leg.seabed);
  return { leg: n, x: read(leg.x), y: read(leg.y), depth: read(leg.depth), seabed: ground };
};

// linear between the points of a grid that are (points) on its sides; null where one of four is not known
const onGrid = (values, columns, rows, fx, fy) => {
  const i = clamp(Math.floor(fx), 0, columns - 2), j = clamp(Math.floor(fy), 0, rows - 2);
  const a = clamp(fx - i, 0, 1), b = clamp(fy - j, 0, 1), k = j * columns + i;
  const four = [values[k], values[k + 1], values[k + columns], values[k + columns + 1]];
  return four.includes(null) ? null : between(between(four[0], four[1], a), between(four[2], four[3], a), b);
};
const inside = (x, y) => x >= west && x <= east && y >= south && y <= north;

// the current [mm/s] of each cell that the map shows: at one of the depths, linear in time
const flowNow = { u: [], v: [] };
const showCurrent = (level, time) => {
  const { times } = data.current, n = Math.min(lastBelow(times, time), Math.max(times.length - 2, 0));
  const m = Math.min(n + 1, times.length - 1), span = times[m] - times[n];
  const share = span > 0 ? clamp((time - times[n]) / span, 0, 1) : 0;
  for (const name of ["u", "v"]) {
    const before = data.current[name][n][level], after = data.current[name][m][level];
    flowNow[name] = before.map((value, k) => (value === null || after[k] === null ? null : between(value, after[k], share)));
  }
};

// the shown current [m/s] at a place
const currentAt = (x, y) => {
  const [columns, rows] = data.current.cells;
  const fx = ((x - west) / (east - west)) * columns - 0.5, fy = ((y - south) / (north - south)) * rows - 0.5;
  const u = onGrid(flowNow.u, columns, rows, fx, fy);
  const v = onGrid(flowNow.v, columns, rows, fx, fy);
  return u === null || v === null ? null : [u / 1000, v / 1000];
};

// the seabed's depth [m]: 0 on land, null where none is known
const seabedAt = (x, y) => {
  if (!data.seabed || !inside(x, y)) return null;
  const [columns, rows] = data.seabed.cells;
  const i = Math.min(Math.floor(((x - west) / (east - west)) * columns), columns - 1);
  const j = Math.min(Math.floor(((y - south) / (north - south)) * rows), rows - 1);
  return data.seabed.depth[j * columns + i];
};

// the lines that a map is ruled with: longitude and latitude, or x and y in the map's unit
const ruled = (() => {
  if (data.lonlat) return { points: data.lonlat.points, a: data.lonlat.lon, b: data.lonlat.lat };
  const points = 2, size = data.unit.size;
  const x = [west / size, east / size], y = [south / size, north / size];
  return { points, a: [...x, ...x], b: [y[0], y[0], y[1], y[1]] };
})();
const rulesAt = (x, y) => {
  const fx = ((x - west) / (east - west)) * (ruled.points - 1), fy = ((y - south) / (north - south)) * (ruled.points - 1);
  return [ruled.a, ruled.b].map((values) => onGrid(values, ruled.points, ruled.points, fx, fy));
};

const angle = (value, letters, digits) => {
  const turned = ((((value + 180) % 360) + 360) % 360) - 180;
  return `${Math.abs(turned).toFixed(digits)}°${turned < 0 ? letters[1] : letters[0]}`;
};
const placeName = (x, y) => {
  const [a, b] = rulesAt(x, y);
  if (data.lonlat) return `${angle(b, "NS", 4)}, ${angle(a, "EW", 4)}`;
  const digits = data.unit.size > 1 ? 2 : 0;
  return `x ${a.toFixed(digits)}, y ${b.toFixed(digits)} ${data.unit.name}`;
};
const spanName = (time) => `${(time / data.time.size).toFixed(data.time.size > 1 ? 2 : 0)} ${data.time.name}`;
// a moment is a date and time where the departure is known, else the time since then in the unit of the axis
const momentName = (time) => dateName(time) ?? spanName(time);
const dateName = (time) =>
  data.departs === null ? null : new Date(data.departs + time * 1000).toISOString().slice(0, 16).replace("T", " ") + " UTC";

// the segments of a line of equal value in a triangle mesh
const segments = (mesh, level) => {
  const found = [], { x, y, value, triangles } = mesh;
  for (let n = 0; n < triangles.length; n += 3) {
    const ends = [];
    for (let k = 0; k < 3; k++) {
      const i = triangles[n + k], j = triangles[n + ((k + 1) % 3)];
      if (value[i] < level === value[j] < level) continue;
      const share = (level - value[i]) / (value[j] - value[i]);
      ends.push(between(x[i], x[j], share), between(y[i], y[j], share));
    }
    if (ends.length === 4) found.push(ends);
  }
  return found;
};
const roundStep = (span, most) => {
  const power = 10 ** Math.floor(Math.log10(span / most));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => span / step <= most);
};

const TIMES = ["#0d0887", "#5b02a3", "#9a179b", "#cb4678", "#eb7852", "#fbb32f"];
const TIMES_DARK = ["#7d6bff", "#b555ea", "#e855b4", "#ff7381", "#ffa65e", "#ffe27a"];
const mixed = (stops, share) => {
  const place = clamp(share, 0, 1) * (stops.length - 1), n = Math.min(Math.floor(place), stops.length - 2);
  const part = (hex, k) => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16);
  return [0, 1, 2].map((k) => Math.round(between(part(stops[n], k), part(stops[n + 1], k), place - n)));
};
const timeColour = (time) => `rgb(${mixed(isDark() ? TIMES_DARK : TIMES, time / total).join(",")})`;
const speedStops = () => [look("--calm"), look("--swift"), look("--fast")];
