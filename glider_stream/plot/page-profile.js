// The profile: depth against time over the seabed, linked with the map by the time that is chosen.
const profile = at("profile"), MARGIN = { left: 52, right: 10, top: 8, bottom: 34 };
const DEEP = 2.5; // a seabed so many times deeper than the route would leave no room for it
const flat = (name) => legs.flatMap((leg) => leg[name]).filter((value) => value !== null);
const deepest = flat("depth").reduce((a, b) => Math.max(a, b), 1);
const grounds = flat("seabed"), near = grounds.reduce((a, b) => Math.min(a, b), Infinity);
const grounded = near < DEEP * deepest;
const lowest = grounded
  ? Math.max(1.12 * deepest, 1.06 * Math.min(grounds.reduce((a, b) => Math.max(a, b), 0), DEEP * deepest))
  : 1.12 * deepest;
let plot = { width: 1, height: 1 };
const profileX = (time) => MARGIN.left + (time / total) * (plot.width - MARGIN.left - MARGIN.right);
const profileY = (depth) =>
  MARGIN.top + ((depth + 0.03 * lowest) / (1.03 * lowest)) * (plot.height - MARGIN.top - MARGIN.bottom);
const cursor = shape("g", {});
let profilePieces = [];

const label = (text, x, y, anchor) => {
  const made = shape("text", { x, y, "text-anchor": anchor });
  made.textContent = text;
  return made;
};

const drawProfile = () => {
  plot = { width: profile.clientWidth, height: profile.clientHeight };
  const base = profileY(lowest), made = [];
  const across = roundStep(total / data.time.size, clamp(plot.width / 80, 3, 12)), down = roundStep(lowest, 5);
  for (let n = 0; n * across <= total / data.time.size; n++) {
    const x = profileX(n * across * data.time.size);
    made.push(shape("line", { x1: x, x2: x, y1: MARGIN.top, y2: base, class: "axis" }));
    made.push(label(`${+(n * across).toFixed(6)}`, x, base + 14, "middle"));
  }
  for (let n = 0; n * down <= lowest; n++) {
    const y = profileY(n * down);
    made.push(shape("line", { x1: MARGIN.left, x2: plot.width - MARGIN.right, y1: y, y2: y, class: "axis" }));
    made.push(label(`${+(n * down).toFixed(6)} m`, MARGIN.left - 6, y + 4, "end"));
  }
  made.push(label(`Time since departure (${data.time.name})`, (MARGIN.left + plot.width) / 2, base + 29, "middle"));
  // where the seabed is known, in one piece for each such stretch
  let stretch = [];
  const close = () => {
    if (stretch.length > 1) {
      const line = stretch.map(([time, ground]) => `${profileX(time)} ${profileY(Math.min(ground, lowest))}`);
      const ends = [stretch[0][0], stretch[stretch.length - 1][0]].map((time) => `${profileX(time)} ${base}`);
      made.push(shape("path", { d: `M${ends[0]}L${line.join("L")}L${ends[1]}Z`, class: "ground" }));
    }
    stretch = [];
  };
  for (const leg of legs)
    leg.seabed.forEach((ground, i) => (ground === null || !grounded ? close() : stretch.push([leg.t[i], ground])));
  close();
  profilePieces = pieces.map(({ leg, from, to, time }) => {
    const { t, depth } = legs[leg];
    const d = t.slice(from, to + 1).map((when, i) => `${i ? "L" : "M"}${profileX(when)} ${profileY(depth[from + i])}`).join("");
    return shape("path", { d, class: "leg", stroke: timeColour(time), "data-leg": leg });
  });
  profile.replaceChildren(...made, ...profilePieces, cursor);
  markProfile();
};

const markProfile = () => {
  const x = profileX(chosen.time), here = glider(chosen.time);
  cursor.replaceChildren(
    shape("line", { x1: x, x2: x, y1: MARGIN.top, y2: profileY(lowest), class: "now" }),
    shape("circle", { cx: x, cy: profileY(here.depth), r: 5.5, class: "cursor" }),
  );
};

const profileTime = (event) => {
  const px = event.clientX - profile.getBoundingClientRect().left;
  return clamp(((px - MARGIN.left) / (plot.width - MARGIN.left - MARGIN.right)) * total, 0, total);
};
