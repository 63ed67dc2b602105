// What moves: the chosen time, depth and fronts, the look, and the hands on map, profile and table.
const describe = (list, rows) =>
  list.replaceChildren(...rows.filter(([, value]) => value !== null).flatMap(([name, value]) => {
    const term = document.createElement("dt"), said = document.createElement("dd");
    term.textContent = name;
    said.textContent = value;
    return [term, said];
  }));
const bearing = (u, v) => ((Math.atan2(u, v) * 180) / Math.PI + 360) % 360;
const kind = (leg) => (leg.glide > 0 ? "climb" : leg.glide < 0 ? "dive" : "drift");
const metres = (value) => (value === null ? null : `${value.toFixed(0)} m`);
const ends = (leg) => [leg.depth[0], leg.depth[leg.depth.length - 1]];

const chooseLeg = (n) => {
  if (n === chosen.leg) return;
  chosen.leg = n;
  const leg = legs[n], [u, v] = leg.current, [from, to] = ends(leg);
  at("leg-title").textContent = `Leg ${n + 1} of ${legs.length}: ${kind(leg)}`;
  describe(at("leg"), [
    ["Heading", leg.glide ? `${leg.heading.toFixed(1)}°` : null],
    ["Glide angle", leg.glide ? `${leg.glide.toFixed(1)}°` : null],
    ["Depths", `${from.toFixed(0)} to ${to.toFixed(0)} m`],
    ["Departs", momentName(leg.depart)],
    ["Arrives", momentName(leg.depart + leg.duration)],
    ["Takes", spanName(leg.duration)],
    ["Through water", `${leg.speed.toFixed(3)} m/s`],
    ["Over ground", leg.ground === null ? null : `${leg.ground.toFixed(3)} m/s`],
    ["Mean current", u === null ? null : `${Math.hypot(u, v).toFixed(3)} m/s to ${bearing(u, v).toFixed(0)}°`],
    ["Misses by", leg.miss === null ? null : `${leg.miss.toFixed(2)} m`],
  ]);
  for (const { made, leg: mine } of pieces) made.classList.toggle("chosen", mine === n);
  profilePieces.forEach((made, k) => made.classList.toggle("chosen", pieces[k].leg === n));
  [...at("table").tBodies[0].rows].forEach((row, k) => row.classList.toggle("chosen", k === n));
};

const chooseTime = (time) => {
  chosen.time = clamp(time, 0, total);
  const here = glider(chosen.time);
  chooseLeg(here.leg);
  if (data.current.times.length > 1) { paint(); redraw(); }
  placeMarks();
  placePlan();
  markProfile();
  at("time").value = (1000 * chosen.time) / total;
  at("time").setAttribute("aria-valuetext", momentName(chosen.time));
  at("clock").textContent = momentName(chosen.time);
  describe(at("now"), [
    ["Time", spanName(chosen.time)],
    ["Date", dateName(chosen.time)],
    ["Place", placeName(here.x, here.y)],
    ["Depth", metres(here.depth)],
    ["Seabed", metres(here.seabed)],
  ]);
};
// the whole of it plays in some seconds; any touch of time, map or profile stops it
const PLAYED = 24;
let playing = null;
const stop = () => {
  playing = null;
  at("play").textContent = "\u25B6";
  at("play").setAttribute("aria-pressed", "false");
  at("play").setAttribute("aria-label", "Play");
};
const play = (now) => {
  if (!playing) return;
  if (playing.before !== null) chooseTime(chosen.time + ((now - playing.before) / 1000 / PLAYED) * total);
  playing.before = now;
  if (chosen.time >= total) stop(); else requestAnimationFrame(play);
};
const startOrStop = () => {
  if (playing) return stop();
  if (chosen.time >= total) chooseTime(0);
  playing = { before: null };
  at("play").textContent = "\u25A0";
  at("play").setAttribute("aria-pressed", "true");
  at("play").setAttribute("aria-label", "Stop");
  requestAnimationFrame(play);
};
const chooseLegAt = (n) => chooseTime(n <= 0 ? 0 : legs[Math.min(n, legs.length - 1)].depart + 1e-3);

const readPlace = (px, py) => {
  const x = worldX(px), y = worldY(py);
  if (!inside(x, y)) { at("place").textContent = ""; return; }
  const ground = seabedAt(x, y), current = currentAt(x, y), said = [placeName(x, y)];
  if (ground === 0) said.push("land");
  else if (ground !== null) said.push(`seabed ${ground} m`);
  if (current && (ground === null || ground > data.current.depths[chosen.level]))
    said.push(`current ${Math.hypot(...current).toFixed(2)} m/s`);
  at("place").textContent = said.join(" · ");
};

const dress = (dark) => {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  for (const { made, time } of pieces) made.setAttribute("stroke", timeColour(time));
  at("speed-key").style.background = `linear-gradient(to right, ${speedStops().join(",")})`;
  at("time-key").style.background = `linear-gradient(to right, ${(dark ? TIMES_DARK : TIMES).join(",")})`;
  paint();
  redraw();
  drawProfile();
};

// words and choices
at("title").textContent = data.title;
at("said").textContent = data.departs === null
  ? data.said : `${data.said}, departs ${dateName(0)}, arrives ${dateName(total)}`;
at("when").textContent = data.when;
at("speed-most").textContent = `${data.current.fastest.toFixed(2)} m/s`;
at("time-most").textContent = spanName(total);
data.current.depths.forEach((depth, n) => at("depth").add(new Option(`${depth} m`, n)));
at("depth").addEventListener("change", () => { chosen.level = +at("depth").value; paint(); redraw(); });
if (fronts) {
  at("fronts-label").hidden = false;
  at("ways").textContent = data.fronts.ways;
  const choices = [data.fronts.hours, 2 * data.fronts.hours, 4 * data.fronts.hours, 0];
  for (const hours of choices) at("fronts").add(new Option(hours ? `${+hours.toFixed(4)} h` : "none", hours));
  at("fronts").addEventListener("change", () => { chosen.every = +at("fronts").value; traceFronts(); redraw(); });
}
at("plan-key").hidden = !data.plans.length;
at("play").addEventListener("click", startOrStop);
at("time").addEventListener("input", () => { stop(); chooseTime((at("time").value / 1000) * total); });
at("earlier").addEventListener("click", () => { stop(); chooseLegAt(chosen.leg - 1); });
at("later").addEventListener("click", () => { stop(); chooseLegAt(chosen.leg + 1); });
at("theme").addEventListener("click", () => dress(!isDark()));
at("closer").addEventListener("click", () => zoom(1.6));
at("farther").addEventListener("click", () => zoom(1 / 1.6));
at("whole").addEventListener("click", showAll);

const head = at("table").createTHead().insertRow(), body = at("table").createTBody();
const titles = ["Leg", "", "Departs", "Arrives", "From", "To", "Heading", "Glide", "Ground", "Ends at"];
for (const title of titles) head.append(Object.assign(document.createElement("th"), { textContent: title, scope: "col" }));
legs.forEach((leg, n) => {
  const row = body.insertRow(), [from, to] = ends(leg);
  const cells = [
    n + 1, kind(leg), momentName(leg.depart), momentName(leg.depart + leg.duration), metres(from), metres(to),
    leg.glide ? `${leg.heading.toFixed(1)}°` : "", leg.glide ? `${leg.glide.toFixed(1)}°` : "", leg.ground === null ? "" : `${leg.ground.toFixed(2)} m/s`,
    placeName(leg.x[leg.x.length - 1], leg.y[leg.y.length - 1]),
  ];
  for (const cell of cells) row.insertCell().textContent = cell;
  row.addEventListener("click", () => chooseLegAt(n));
});

// hands on the map: one moves it, two pull it apart, a short touch chooses a place on the route
const held = new Map();
let pulled = 0, travelled = 0;
const spot = (event) => {
  const box = map.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
map.addEventListener("pointerdown", (event) => {
  if (event.target.closest("#zoom")) return;
  if (event.isTrusted) map.setPointerCapture(event.pointerId);
  held.set(event.pointerId, spot(event));
  if (held.size === 1) travelled = 0;
  map.classList.add("held");
});
map.addEventListener("pointermove", (event) => {
  const [px, py] = spot(event), before = held.get(event.pointerId);
  readPlace(px, py);
  if (!before) {
    const time = event.pointerType === "touch" || event.target.closest("#zoom") ? null : nearest(px, py, 12);
    map.classList.toggle("near", time !== null);
    if (time !== null && !playing) chooseTime(time);
    return;
  }
  travelled += Math.hypot(px - before[0], py - before[1]);
  if (held.size === 2) {
    const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, where]) => where);
    const was = Math.hypot(before[0] - other[0], before[1] - other[1]), is = Math.hypot(px - other[0], py - other[1]);
    zoom(is / Math.max(was, 1), (px + other[0]) / 2, (py + other[1]) / 2);
    pulled = 1;
  } else move(px - before[0], py - before[1]);
  held.set(event.pointerId, [px, py]);
});
const release = (event) => {
  if (!held.delete(event.pointerId)) return;
  if (!held.size) {
    map.classList.remove("held");
    const time = event.type === "pointerup" && !pulled && travelled < 8 ? nearest(...spot(event), 32) : null;
    if (time !== null) { stop(); chooseTime(time); }
    pulled = 0;
  }
};
for (const name of ["pointerup", "pointercancel"]) map.addEventListener(name, release);
map.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") at("place").textContent = ""; });
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-clamp(event.deltaY * (event.deltaMode ? 20 : 1), -300, 300) * 0.0015), ...spot(event));
}, { passive: false });
const KEYS = {
  ArrowLeft: () => move(40, 0), ArrowRight: () => move(-40, 0), ArrowUp: () => move(0, 40), ArrowDown: () => move(0, -40),
  "+": () => zoom(1.6), "=": () => zoom(1.6), "-": () => zoom(1 / 1.6), 0: showAll,
};
map.addEventListener("keydown", (event) => {
  if (event.target !== map || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
});
for (const name of ["pointerdown", "pointermove"])
  profile.addEventListener(name, (event) => {
    if (name === "pointermove" && playing) return;
    stop();
    chooseTime(profileTime(event));
  });

traceFronts();
const wanted = window.matchMedia("(prefers-color-scheme: dark)");
dress(wanted.matches);
wanted.addEventListener("change", () => dress(wanted.matches));
sizeMap();
new ResizeObserver(sizeMap).observe(map);
new ResizeObserver(drawProfile).observe(profile);
chooseTime(0);
