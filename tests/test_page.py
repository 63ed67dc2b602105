"""The page of a route: whole in itself; in a real browser it draws, and answers its controls."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from small import command, scenario_file

pytest.importorskip("matplotlib")

BROWSER = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--enable-logging=stderr",
    "--virtual-time-budget=4000", "--window-size=1000,1000",
)  # fmt: skip
browser = pytest.mark.skipif(BROWSER is None, reason="no chromium or chrome on the path")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("page")


@pytest.fixture
def page(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    if not Path("route.html").exists():
        scenario_file(place)
        for words in (
            ("build", "small.toml", "-o", "road.h5"),
            ("query", "road.h5", "-o", "path.json"),
            ("plot", "road.h5", "path.json", "-o", "route.html"),
        ):
            assert command(capsys, *words).code == 0
    return Path("route.html").read_text()


def data(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL).group(1))


def test_the_page_needs_nothing_else(page):
    assert not re.search(r"https?://|//cdn|@import|src=|url\(", page)
    assert "default-src 'none'" in page
    found, path = data(page), json.loads(Path("path.json").read_text())
    assert len(found["legs"]) == len(path["legs"])
    assert found["route"]["t"][-1] == pytest.approx(path["travel_time_s"], abs=0.1)
    ends = path["legs"][-1]["trajectory"][-1]
    assert [found["route"][name][-1] for name in ("x", "y")] == pytest.approx(ends[1:3], abs=0.1)
    assert len(found["land"]["cells"]) == found["land"]["rows"] * found["land"]["columns"]
    assert found["currents"][0]["fastest"] > 0.2


def test_a_title_cannot_break_out(page, capsys):
    shutil.copy("road.h5", "<img src=x onerror=alert(1)>.h5")
    assert command(capsys, "plot", "<img src=x onerror=alert(1)>.h5", "path.json", "-o", "odd.html").code == 0
    text = Path("odd.html").read_text()
    assert "<img" not in text
    assert data(text)["title"].startswith("<img")


def run(*arguments):
    profile = Path("profile").absolute()
    done = subprocess.run(
        [BROWSER, *FLAGS, f"--user-data-dir={profile}", *arguments], capture_output=True, text=True, timeout=90
    )
    shutil.rmtree(profile, ignore_errors=True)
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert not said, said
    return done.stdout


@browser
def test_a_browser_draws_it(page):
    from matplotlib.image import imread

    run("--screenshot=shot.png", Path("route.html").absolute().as_uri())
    shot = imread("shot.png")[..., :3]
    bright = shot.max(axis=-1) - shot.min(axis=-1) > 0.4  # the route's colours, and nothing else
    rows = np.flatnonzero(bright.any(axis=1))
    assert bright.sum() > 1500
    assert rows[-1] - rows[0] > 500  # on the map, and in the profile below it


@browser
def test_its_controls_answer_in_a_browser(page):
    steps = """
    const out = [], note = () => out.push(document.getElementById("said").textContent);
    note();
    const bar = document.getElementById("time");
    bar.value = 1000;
    bar.dispatchEvent(new Event("input"));
    note();
    const before = view.scale;
    document.getElementById("map").dispatchEvent(new WheelEvent("wheel", { deltaY: -400, cancelable: true }));
    out.push(view.scale / before);
    document.getElementById("fit").click();
    out.push(view.scale / before);
    document.getElementById("depth").value = "1";
    document.getElementById("depth").dispatchEvent(new Event("change"));
    const box = document.getElementById("map").getBoundingClientRect();
    const x = box.left + across(R.x[0], box.width), y = box.top + down(R.y[0], box.height);
    document.getElementById("map").dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y }));
    note();
    out.push(document.getElementById("place").textContent);
    document.body.dataset.out = JSON.stringify(out);
    """
    Path("driven.html").write_text(page.replace("</body>", f"<script>{steps}</script></body>"))
    dom = run("--dump-dom", Path("driven.html").absolute().as_uri())
    out = json.loads(re.search(r'data-out="(.*?)"', dom).group(1).replace("&quot;", '"'))
    legs = len(data(page)["legs"])
    assert f"leg 1 of {legs}" in out[0]
    assert f"leg {legs} of {legs}" in out[1]
    assert out[2] == pytest.approx(np.e, rel=1e-6)
    assert out[3] == pytest.approx(1.0)
    assert f"leg 1 of {legs}" in out[4]
    assert out[5].startswith("-190 m")


def test_what_cannot_be_a_page(page, capsys):
    said = command(capsys, "plot", "road.h5", "-o", "road.html")
    assert (said.code, "give its path file" in said.err) == (2, True)


def test_the_chart_with_fronts(page, capsys):
    assert command(capsys, "plot", "road.h5", "path.json", "-o", "chart.png", "--fronts", "0.05").code == 0
    first = Path("chart.png").read_bytes()
    command(capsys, "plot", "road.h5", "path.json", "-o", "chart.png", "--fronts", "0.05")
    assert Path("chart.png").read_bytes() == first
    for hours, words in (("0", "more than 0 h"), ("0.0001", "choose more hours"), ("nan", "more than 0 h")):
        said = command(capsys, "plot", "road.h5", "path.json", "-o", "chart.png", "--fronts", hours)
        assert (said.code, words in said.err) == (2, True), said.err
