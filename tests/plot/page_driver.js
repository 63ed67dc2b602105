// What a test does to the page, by the events that hands would make; what it sees goes into the document.
// LAND, SEA and SHALLOW are places [x, y] in metres that the test puts in front.
const point = (type, target, x, y, more = {}) => {
  const box = target.getBoundingClientRect();
  const where = { clientX: box.left + x, clientY: box.top + y, bubbles: true, cancelable: true, pointerId: 1 };
  target.dispatchEvent(new (type === "wheel" ? WheelEvent : PointerEvent)(type, { ...where, ...more }));
};
const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
const pixel = ([x, y]) => {
  copy.canvas.width = water.width;
  copy.canvas.height = water.height;
  copy.drawImage(water, 0, 0);
  return [...copy.getImageData(screenX(x) * devicePixelRatio, screenY(y) * devicePixelRatio, 1, 1).data];
};
const facts = () => Object.fromEntries([...document.querySelectorAll("#facts dt")].map((term) =>
  [term.textContent, term.nextSibling.textContent]));
const shown = (query) => [...document.querySelectorAll(query)].map((one) => {
  const box = one.getBoundingClientRect();
  return { leg: one.dataset.leg, stroke: getComputedStyle(one).stroke, box: [box.left, box.top, box.right, box.bottom] };
});
const said = {};
const run = () => {
  said.title = document.title;
  said.heading = at("title").textContent;
  said.track = shown("#track path");
  said.profile = shown("#profile path.leg");
  said.ground = shown("#profile path.ground").length;
  said.map = shown("#map")[0].box;
  said.side = shown("#profile")[0].box;
  said.land = pixel(LAND);
  said.sea = pixel(SEA);
  said.shallow = [pixel(SHALLOW)];
  at("depth").value = 1;
  at("depth").dispatchEvent(new Event("change"));
  draw();
  said.shallow.push(pixel(SHALLOW));
  at("time").value = 430;
  at("time").dispatchEvent(new Event("input"));
  said.slid = facts();
  said.clock = at("clock").textContent;
  said.cursor = [screenX(glider(chosen.time).x) - marks.now.getAttribute("cx"), cursor.firstChild.getAttribute("x1")];
  said.leg = at("leg-title").textContent;
  const leg = legs[5], middle = leg.x.length >> 1;
  point("pointermove", map, screenX(leg.x[middle]), screenY(leg.y[middle]), { pointerType: "mouse" });
  said.hovered = [at("leg-title").textContent, facts(), document.querySelectorAll("#track .chosen").length > 0];
  said.readout = [at("place").textContent, leg.x[middle], leg.y[middle]];
  point("pointerdown", map, screenX(legs[2].x[middle]), screenY(legs[2].y[middle]), { pointerType: "touch" });
  point("pointerup", map, screenX(legs[2].x[middle]), screenY(legs[2].y[middle]), { pointerType: "touch" });
  said.touched = at("leg-title").textContent;
  point("pointerdown", profile, profileX(total), 50);
  said.dragged = [at("leg-title").textContent, at("time").value];
  const before = { ...view };
  point("wheel", map, 200, 100, { deltaY: -400 });
  said.zoomed = [view.scale / before.scale, worldX(200), worldY(100)];
  Object.assign(view, before);
  said.still = [worldX(200), worldY(100)];
  point("pointerdown", map, 200, 100, { pointerType: "mouse" });
  point("pointermove", map, 230, 90, { pointerType: "mouse" });
  point("pointerup", map, 230, 90, { pointerType: "mouse" });
  said.panned = [worldX(230) - said.still[0], worldY(90) - said.still[1]];
  at("whole").click();
  said.fronts = frontLines.map((line) => [line.hours, line.parts]);
  at("theme").click();
  draw();
  said.dark = [document.documentElement.dataset.theme, pixel(LAND), shown("#track path")[0].stroke];
  said.rows = [...at("table").tBodies[0].rows].map((row) => { row.click(); return at("leg-title").textContent; });
  said.resources = performance.getEntriesByType("resource").map((one) => one.name);
  said.width = [document.documentElement.scrollWidth, innerWidth];
  const out = document.createElement("pre");
  out.id = "said";
  out.textContent = JSON.stringify(said);
  document.body.append(out);
};
setTimeout(run, 300);
