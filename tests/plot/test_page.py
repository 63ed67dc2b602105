"""The page: what stands in it, and what a real browser makes of it, where there is one."""

import html
import json
import re
import shutil
import subprocess
from dataclasses import replace
from datetime import timedelta
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.scenes import arrivals, box_scene, ocean_scene
from helpers.small import strict_json

from glider_stream import plot
from glider_stream.plot.page import Replay, page_text

pytestmark = pytest.mark.slow

TITLE = """</title></script><script>document.title = "broken"</script> & 'sea' <!-- {{js}}"""
PLACES = {"LAND": (27e3, -24e3), "SEA": (-10e3, -25e3), "SHALLOW": (18e3, -24e3)}
DRIVER = Path(__file__).with_name("page_driver.js")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
QUIET = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--disable-extensions"),
    *("--virtual-time-budget=3000", "--enable-logging=stderr"),
)
OWN = ("google.com", "googleapis.com", "gvt1.com")
"""Hosts that the browser itself asks for, whatever page it shows; no page of ours names any."""
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')


def written(folder, scene, title=TITLE, fronts=6.0, depths=(0.0, 400.0), replay=None):
    file, every = folder / "page.html", None
    if fronts:
        every = (plot.fronts_of(scene.position, arrivals(scene), scene.terrain), fronts)
    path = plot.placed(scene.path, scene.problem)
    what = scene.flow, scene.terrain, scene.problem, scene.position, path, depths, every, title
    plot.save_page(file, *what, replay=replay)
    return file


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    return written(tmp_path_factory.mktemp("sea"), ocean_scene())


class Parts(HTMLParser):
    """Tags of a page, and the text of each element that has one."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.texts, self.open = [], [], None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.open = tag

    def handle_endtag(self, tag):
        self.open = None

    def handle_data(self, text):
        self.texts.append((self.open, text))

    def of(self, tag):
        return ["".join(text for where, text in self.texts if where == tag)]


# what stands in it


def test_no_text_can_end_its_script_or_head(sea):
    parts = Parts(sea.read_text("utf-8"))
    names = [name for name, _ in parts.tags]
    assert names.count("script") == 2
    assert names.count("title") == names.count("body") == names.count("main") == 1
    assert parts.of("title") == [TITLE]
    assert not any(name.startswith("on") for _, attributes in parts.tags for name in attributes)


def test_the_page_loads_nothing_from_outside(sea):
    text = sea.read_text("utf-8")
    assert set(re.findall(r"(?:https?:)?//[\w.]+\w[^\s\"']*", re.sub(r"(?m)^\s*//.*$|; // .*$", "", text))) == {
        "http://www.w3.org/2000/svg"
    }
    for tag, attributes in Parts(text).tags:
        assert not {"src", "srcset", "action", "data", "ping"} & set(attributes), tag
        assert attributes.get("href", "data:,") == "data:,"
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|import|eval|innerHTML|url)\b\s*\(?", text)
    assert "default-src 'none'" in POLICY.search(text)[0]


def held(file):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', file.read_text("utf-8"))
    return strict_json(text)


def test_it_holds_the_route(sea):
    data, scene = held(sea), ocean_scene()
    path = plot.placed(scene.path, scene.problem)
    assert data["title"] == TITLE
    assert data["said"] == "8 legs, 20 h"
    assert data["departs"] == scene.problem.departs.timestamp() * 1000
    for leg, kept in zip(path.legs, data["legs"], strict=True):
        rows = np.column_stack([kept[name] for name in ("t", "x", "y", "depth")]) * [1, 1, 1, -1]
        np.testing.assert_allclose(rows, leg.trajectory, atol=0.051)
        assert kept["heading"] == pytest.approx(leg.compass, abs=0.01)
        assert kept["glide"] == pytest.approx(np.degrees(leg.glide_angle), abs=0.01)
    (west, east, south, north), [columns, rows] = data["box"], data["current"]["cells"]
    i, j = 40, 7
    x, y = west + (i + 0.5) / columns * (east - west), south + (j + 0.5) / rows * (north - south)
    for level, depth in enumerate(data["current"]["depths"]):
        u, v = plot.sample_field(scene.flow, x, y, -depth, scene.problem.departure)
        kept = [data["current"][name][0][level][j * columns + i] for name in "uv"]
        np.testing.assert_allclose(kept, [1e3 * u, 1e3 * v], atol=0.51)
    columns, rows = data["seabed"]["cells"]
    for (x, y), depth in ((PLACES["LAND"], 0), (PLACES["SEA"], None)):
        k = int((y - south) / (north - south) * rows) * columns + int((x - west) / (east - west) * columns)
        assert data["seabed"]["depth"][k] == depth or (depth is None and data["seabed"]["depth"][k] > 1000)


def test_a_box_without_land_or_degrees(tmp_path):
    data = held(written(tmp_path, box_scene(), "Box", fronts=None, depths=None))
    assert data["lonlat"] is data["seabed"] is data["fronts"] is data["departs"] is None
    assert data["unit"] == {"size": 1.0, "name": "m"}
    assert data["current"]["depths"] == [0, 100, 200, 300]


def test_a_long_route_is_thinned_and_keeps_its_ends(tmp_path):
    scene = box_scene()
    scene.path = replace(scene.path, legs=scene.path.legs * 900)
    data = held(written(tmp_path, scene, fronts=None, depths=None))
    assert len(data["legs"]) == 8100
    assert {len(leg["t"]) for leg in data["legs"]} == {4}
    for leg, kept in zip(scene.path.legs[:9], data["legs"], strict=False):
        np.testing.assert_allclose([kept["x"][0], kept["x"][-1]], leg.trajectory[[0, -1], 1], atol=0.051)


def test_same_input_same_page(sea, tmp_path):
    assert written(tmp_path, ocean_scene()).read_bytes() == sea.read_bytes()


def test_numbers_that_json_does_not_have_are_a_bug():
    with pytest.raises(ValueError, match="JSON"):
        page_text({"a": float("nan")}, "")


# what a browser makes of it

WATCH = """<script>
document.addEventListener("securitypolicyviolation", (event) => console.error(`policy: ${event.blockedURI}`));
</script>
"""


def browse(page, folder, size="1200,900"):
    """What a browser has of a page after three seconds: its document, the console's lines, hosts asked for."""
    file, log = folder / "browsed.html", folder / "net.json"
    file.write_text(page, "utf-8")
    # whatever asks for a host is noted, and gets no answer
    where = [f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}", f"--window-size={size}"]
    block = "--host-resolver-rules=MAP * ~NOTFOUND"
    command = [BROWSER, *QUIET, *where, block, "--dump-dom", file.as_uri()]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    hosts = set(re.findall(r'"url":"https?://([^/":]+)', log.read_text("utf-8", "replace")))
    console = [line for line in ended.stderr.splitlines() if "CONSOLE" in line]
    return SimpleNamespace(dom=ended.stdout, console=console, hosts={h for h in hosts if not h.endswith(OWN)})


needs_browser = pytest.mark.skipif(BROWSER is None, reason="there is no chromium or chrome")


@pytest.fixture(scope="module")
def browsed(sea, tmp_path_factory):
    places = "".join(f"const {name} = {list(at)};\n" for name, at in PLACES.items())
    driver = f"<script>\n{places}{DRIVER.read_text('utf-8')}</script>"
    page = sea.read_text("utf-8").replace("<style>", f"{WATCH}<style>", 1).replace("</body>", f"{driver}</body>")
    seen = browse(page, tmp_path_factory.mktemp("browser"))
    (text,) = re.findall(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL) or [None]
    assert text, f"the page did not come to its end: {seen.console}"
    return SimpleNamespace(**vars(seen), said=json.loads(html.unescape(text)))


@needs_browser
def test_no_error_and_no_request(browsed):
    assert not browsed.console
    assert not browsed.hosts
    assert not browsed.said["resources"]
    assert browsed.said["title"] == browsed.said["heading"] == TITLE


@needs_browser
def test_the_watch_sees_errors_and_requests(tmp_path):
    image = '<img src="http://page.invalid/a.png"><script>throw new Error("boom")</script>'
    loose = browse(f"<!DOCTYPE html><body>{image}</body>", tmp_path)
    assert loose.hosts == {"page.invalid"}
    assert "boom" in "".join(loose.console)


@needs_browser
def test_the_policy_stops_what_would_leave(sea, tmp_path):
    text = sea.read_text("utf-8").replace("<main>", '<main><img src="http://page.invalid/a.png">')
    seen = browse(text, tmp_path)
    assert not seen.hosts
    assert "page.invalid" in "".join(seen.console)


@needs_browser
def test_route_and_profile_are_drawn(browsed):
    said = browsed.said
    for pieces, frame in ((said["track"], said["map"]), (said["profile"], said["side"])):
        assert {int(piece["leg"]) for piece in pieces} == set(range(8))
        assert len({piece["stroke"] for piece in pieces}) > 60  # one colour for each time
        boxes = np.array([piece["box"] for piece in pieces])
        assert (boxes[:, 2:] - boxes[:, :2]).max(axis=1).min() > 0.1
        assert (boxes[:, :2] >= np.array(frame[:2]) - 4).all()
        assert (boxes[:, 2:] <= np.array(frame[2:]) + 4).all()
    extent = np.ptp(np.array([piece["box"] for piece in said["profile"]])[:, [0, 2]])
    assert extent > 0.85 * (said["side"][2] - said["side"][0])
    assert said["ground"] == 0  # the seabed lies too deep to be shown with it
    assert said["land"][:3] == [0xA3, 0x9C, 0x92]
    assert said["sea"] != said["land"]
    assert said["shallow"][0] != said["shallow"][1] == [0xD6, 0xD2, 0xCB, 255]  # at 0 m, at 400 m
    assert said["width"][0] <= said["width"][1]


@needs_browser
def test_fronts_are_where_they_are_reached(browsed):
    """Circles about the start, as `arrivals` has it."""
    scene = ocean_scene()
    far = np.hypot(*(scene.position - scene.path.start)[:, :2].T).max()
    assert [hours for hours, _ in browsed.said["fronts"]] == [6, 12, 18, 24, 30]
    for hours, parts in browsed.said["fronts"]:
        x, y = np.array(parts).reshape(-1, 2).T
        radius = np.hypot(x - scene.path.start[0], y - scene.path.start[1])
        np.testing.assert_allclose(radius, hours / 30.0 * far, rtol=0.02)


@needs_browser
def test_the_slider_moves_map_and_profile(browsed):
    said, path = browsed.said, ocean_scene().path
    time = 0.43 * path.travel_time
    x, y, z = (np.interp(time, path.trajectory[:, 0], path.trajectory[:, k]) for k in (1, 2, 3))
    facts = said["slid"]
    assert said["leg"].startswith(f"Leg {int(0.43 * 8) + 1} of 8")
    assert said["clock"] == facts["Date"] == "2024-11-21 02:36 UTC"
    assert facts["Time"] == "8.60 h"
    assert float(facts["Depth"].removesuffix(" m")) == pytest.approx(-z, abs=1.0)
    assert degrees(facts["Place"]) == pytest.approx([y / 1e5 + 38.0, x / 1e5 - 18.5], abs=2e-4)
    assert float(said["cursor"][0]) == pytest.approx(0.0, abs=1e-6)
    left, right = said["side"][0], said["side"][2]
    share = (float(said["cursor"][1]) - 52.0) / (right - left - 62.0)
    assert share == pytest.approx(0.43, abs=1e-3)


def degrees(text):
    """Latitude and longitude as the page writes them; what follows them is left out."""
    found = re.findall(r"([\d.]+)°([NSEW])", text)
    return [float(number) * (-1 if letter in "SW" else 1) for number, letter in found]


@needs_browser
def test_pointers_choose_legs_and_move_the_map(browsed):
    said, leg = browsed.said, ocean_scene().path.legs[5]
    title, facts, marked = said["hovered"]
    assert title.startswith("Leg 6 of 8")
    assert marked
    assert facts["Heading"] == f"{leg.compass:.1f}°"
    assert facts["Glide angle"] == f"{np.degrees(leg.glide_angle):.1f}°"
    assert facts["Depths"] == f"{-leg.start[2]:.0f} to {-leg.end[2]:.0f} m"
    assert facts["Takes"] == f"{leg.duration / 3600:.2f} h"
    leaves = ocean_scene().problem.departs + timedelta(seconds=leg.depart)
    assert facts["Departs"] == f"{leaves:%Y-%m-%d %H:%M} UTC"
    text, x, y = said["readout"]
    assert degrees(text) == pytest.approx([y / 1e5 + 38.0, x / 1e5 - 18.5], abs=2e-4)
    assert [row.partition(":")[0] for row in said["rows"]] == [f"Leg {n} of 8" for n in range(1, 9)]
    assert said["touched"].startswith("Leg 3 of 8")
    assert said["dragged"][0].startswith("Leg 8 of 8")
    assert float(said["dragged"][1]) == pytest.approx(1000.0)
    factor, *place = said["zoomed"]
    assert factor == pytest.approx(np.exp(0.0015 * 300))
    assert place == pytest.approx(said["still"])
    assert said["panned"] == pytest.approx([0.0, 0.0], abs=1e-6)


@needs_browser
def test_light_and_dark(browsed):
    theme, land, stroke = browsed.said["dark"]
    assert theme == "dark"
    assert land[:3] == [0x4D, 0x48, 0x42]
    assert stroke != browsed.said["track"][0]["stroke"]


PHONE = """<!DOCTYPE html><body style="margin:0">
<iframe id="phone" style="width:375px;height:720px;border:0" srcdoc="{page}"></iframe>
<script>
setTimeout(() => {{
  const inner = document.getElementById("phone").contentDocument;
  const out = document.createElement("pre"), said = {{}};
  for (const id of ["map", "side", "facts", "closer"]) {{
    const box = inner.getElementById(id).getBoundingClientRect();
    said[id] = [box.left, box.top, box.right, box.bottom];
  }}
  said.width = inner.documentElement.scrollWidth;
  said.track = inner.querySelectorAll("#track path").length;
  said.ground = inner.querySelector("#profile .ground").getAttribute("d");
  out.id = "said";
  out.textContent = JSON.stringify(said);
  document.body.append(out);
}}, 300);
</script></body>"""


@needs_browser
def test_a_phone_shows_it_in_one_column(tmp_path):
    scene = ocean_scene()
    ground = np.minimum(scene.terrain.bottom, 0.0) * 0.5 - 1.0
    scene.terrain = scene.terrain._replace(bottom=ground, ground=ground)
    file = written(tmp_path, scene)
    seen = browse(PHONE.format(page=html.escape(file.read_text("utf-8"))), tmp_path)
    said = json.loads(html.unescape(re.findall(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL)[0]))
    assert said["width"] <= 375
    assert said["track"] > 60
    assert said["map"][2] - said["map"][0] > 340
    assert said["map"][3] - said["map"][1] > 220
    assert said["map"][3] <= said["side"][1] < said["side"][3] <= said["facts"][1]
    left, top, right, bottom = said["closer"]
    assert min(right - left, bottom - top) >= 40  # for a thumb
    assert not seen.console
    x, y = np.array(re.findall(r"[\d.]+", said["ground"]), float).reshape(-1, 2).T
    assert x.min() < 60 < 300 < x.max()
    kept = [(leg["t"], leg["seabed"]) for leg in held(file)["legs"]]
    time, seabed = (np.concatenate(some) for some in zip(*kept, strict=True))
    assert seabed.max() < 800
    # the outline begins and ends at the bottom of the panel, and follows the seabed in between
    expected = np.polynomial.Polynomial.fit(seabed, y[1:-1], 1)
    np.testing.assert_allclose(expected(seabed), y[1:-1], atol=0.01)
    np.testing.assert_allclose(np.interp(time, [0.0, time[-1]], [x[1], x[-2]]), x[1:-1], atol=0.01)
    assert expected.deriv()(0.0) > 0


PLAY = """<script>
setTimeout(() => {
  const said = [], line = () => at("plan").getAttribute("d"), label = () => at("play").getAttribute("aria-label");
  said.push([chosen.time, label(), line(), getComputedStyle(at("plan-key")).display]);
  at("play").click();
  play(1000);
  play(1000 + 12000);
  said.push([chosen.time, label(), line()]);
  at("play").click();
  play(30000);
  said.push([chosen.time, label()]);
  at("play").click();
  play(1000);
  play(1000 + 60000);
  said.push([chosen.time, label()]);
  const out = document.createElement("pre");
  out.id = "said";
  out.textContent = JSON.stringify(said);
  document.body.append(out);
}, 300);
</script>"""


@needs_browser
def test_a_run_plays_with_the_plan_of_its_time(tmp_path):
    """All of it in 24 seconds; a second touch stops it, and so does its end."""
    scene = ocean_scene()
    total = scene.path.travel_time
    ways = np.array([[0.0, 0.0], [1000.0, 2000.0]]), np.array([[500.0, 0.0], [-700.0, 300.0], [0.0, 100.0]])
    replay = Replay("run 3, replan: arrived", [(0.0, ways[0]), (0.4 * total, ways[1])])
    text = written(tmp_path, scene, fronts=None, replay=replay).read_text("utf-8")
    seen = browse(text.replace("</body>", f"{PLAY}</body>"), tmp_path)
    assert not seen.console
    (found,) = re.findall(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL)
    begin, middle, stopped, end = json.loads(html.unescape(found))
    assert begin == [0, "Play", "M0 0L1000 2000", "flex"]
    assert middle == [pytest.approx(total / 2), "Stop", "M500 0L-700 300L0 100"]
    assert stopped == [middle[0], "Play"]
    assert end == [pytest.approx(total), "Play"]
    assert "run 3, replan: arrived" in seen.dom
