"""The problems that peers are given, as files that each of them can read, and how their answers are judged."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from problems_gyre import MIDDLE, gyres

from glider_stream.evaluation.level_set import bound
from glider_stream.evaluation.suite import references
from glider_stream.scenario import read_scenario
from glider_stream.water.frame import LocalFrame

Measure = Callable[[dict[str, Any]], dict[str, Any]]
Judge = Callable[[dict[str, dict[str, Any]]], Measure]
Made = tuple[dict[str, Any], Judge]

RUNS = 5
SURFACE = ("surface, current that stays", "surface, current that swings")
LEGS = ("seed-box", "rankine")

PARTICLES, LASTING, STEP = 10_000, 6 * 3600.0, 300.0
"""Particles of the drift, and its time and step [s]."""
ALONG, AROUND, DEEPEST = 4, 4, 150.0
"""Particles start where a file has water this many cells around, and not deeper than this [m]."""

WEST, EAST, SOUTH, NORTH, CELL = 17.95, 18.55, 37.85, 38.15, 0.01
"""The file of the gyres [degrees]."""
HOURS, START, GOAL = 97, (18.06, 37.95), (18.44, 38.05)
"""The times of the file of gyres that swing, and the ends of the route."""


@contextmanager
def whole(file: Path) -> Iterator[Path]:
    """Where to write, so that `file` is there only when it is written to its end."""
    part = file.with_name(f"part-{file.name}")
    yield part
    part.replace(file)


def make(name: str, currents: Path, folder: Path) -> Made:
    """The job of a problem, and what judges the answers to it."""
    (folder / "problems").mkdir(exist_ok=True)
    if name == "drift":
        return drift(currents, folder / "problems")
    if name in SURFACE:
        return surface(name, folder / "problems")
    return legs(name)


def drift(currents: Path, folder: Path) -> Made:
    """Particles of fixed depth in the real file: where they are after six hours."""
    import xarray as xr

    starts, twice = folder / "starts.csv", folder / "twice.nc"
    if not (starts.exists() and twice.exists()):
        data = xr.open_dataset(currents).load()
        water = np.isfinite(data["uo"].values[0]).all(axis=0, where=(data["depth"].values < 200.0)[:, None, None])
        near = range(-AROUND, AROUND + 1)
        for i in near:
            water = water & np.roll(np.isfinite(data["uo"].values[0, 25]), i, 0)
        wide = np.all([np.roll(water, (i, j), (0, 1)) for i in near for j in near], axis=0)
        wide[:ALONG], wide[-ALONG:], wide[:, :ALONG], wide[:, -ALONG:] = (False,) * 4
        row, column = np.nonzero(wide)
        random = np.random.default_rng(0)
        cell = random.integers(0, row.size, PARTICLES)
        lat, lon = data["latitude"].values, data["longitude"].values
        at = random.uniform(-0.5, 0.5, (2, PARTICLES)) * np.array([[lon[1] - lon[0]], [lat[1] - lat[0]]])
        depth = random.uniform(1.0, DEEPEST, PARTICLES)
        table = np.column_stack([lon[column[cell]] + at[0], lat[row[cell]] + at[1], depth])
        with whole(starts) as part:
            np.savetxt(part, table, "%.9f", ",", header="lon,lat,depth", comments="")
        later = data.assign_coords(time=data["time"] + np.timedelta64(1, "D"))
        with whole(twice) as part:
            xr.concat([data, later], "time", data_vars="minimal").to_netcdf(part, engine="h5netcdf")
    job = {"starts": str(starts), "currents": str(currents), "twice": str(twice), "runs": RUNS}
    return job | {"lasting_s": LASTING, "step_s": STEP}, _judge_drift


def _judge_drift(answers: dict[str, dict[str, Any]]) -> Measure:
    ours = answers.get("glider-stream", {})

    def measure(found: dict[str, Any]) -> dict[str, Any]:
        evaluations = PARTICLES * LASTING / STEP * 4
        rate = [evaluations / one for one in found["processor_s"]]
        result: dict[str, Any] = {
            "evaluations_per_s": {"median": float(np.median(rate)), "low": min(rate), "high": max(rate)}
        }
        if "ends" in ours:
            apart = _metres(np.array(found["ends"], float), np.array(ours["ends"], float))
            shown = np.nan_to_num(apart, nan=np.inf)
            result["metres_from_ours"] = {"median": float(np.median(shown)), "most": float(shown.max())}
        return result

    return measure


def _metres(a: Any, b: Any) -> Any:
    """Metres between places (2, n) [degrees]."""
    from pyproj import Geod

    return Geod(ellps="WGS84").inv(*a, *b)[2]


def surface(name: str, folder: Path) -> Made:
    """A vehicle of constant speed at the surface: from one gyre across the other."""
    import xarray as xr

    swings = name == SURFACE[1]
    file = folder / f"gyre-{'swings' if swings else 'stays'}.nc"
    lon, lat = np.arange(WEST, EAST + 1e-9, CELL), np.arange(SOUTH, NORTH + 1e-9, CELL)
    hours = np.arange(HOURS if swings else 1)
    if not file.exists():
        time = np.datetime64("2024-11-20T00:00:00", "ns") + hours * np.timedelta64(1, "h")
        grid = np.meshgrid(3600.0 * hours, lat, lon, indexing="ij")
        u, v = gyres(grid[2], grid[1], grid[0], swings)
        dims = ("time", "latitude", "longitude")
        told = {"units": "m s-1"}
        fields = {
            "uo": (dims, u, told | {"standard_name": "eastward_sea_water_velocity"}),
            "vo": (dims, v, told | {"standard_name": "northward_sea_water_velocity"}),
        }
        axes = {
            "time": ("time", time),
            "latitude": ("latitude", lat, {"units": "degrees_north", "standard_name": "latitude"}),
            "longitude": ("longitude", lon, {"units": "degrees_east", "standard_name": "longitude"}),
        }
        with whole(file) as part:
            xr.Dataset(fields, axes).to_netcdf(part, engine="h5netcdf")
    scenario = read_scenario("ionian", _settings(file, swings))
    problem = scenario.problem()
    speed = float(problem.evaluator.polar.best_horizontal.max())
    known = bound(problem, 2)
    job = {"file": str(file), "runs": RUNS, "speed": speed, "start": START, "goal": GOAL}
    job |= {"settings": _settings(file, swings), "swings": swings}
    own = {"arrival_s": known.time, "error_s": known.error}

    def judge(answers: dict[str, dict[str, Any]]) -> Measure:
        level = answers.get("hj_reachability", {})

        def measure(found: dict[str, Any]) -> dict[str, Any]:
            result = {"told_s": found["route_s"], "our_level_set": own}
            flown = _flown(found["way"], speed, swings) if "way" in found else found["route_s"]
            result |= {"route_s": flown}
            if "route_s" in level:
                least = level["route_s"]
                result |= {
                    "over_level_set": flown / least,
                    "level_set_error": abs(level["coarser_s"] / least - 1.0),
                }
            return result

        return measure

    return job, judge


def _settings(file: Path, swings: bool) -> list[str]:
    epoch = ["flow.epoch=2024-11-20T00:00:00"] if swings else []
    return [
        *epoch, f"flow.file={file}",
        "domain.lon=[18.0,18.5]", "domain.lat=[37.9,38.1]", "domain.depth=[0.0,200.0]",
        "sampling.depths=[0.0,200.0]", "neighbours.limit=64", "integration.steps=60",
        f"query.start=[{START[0]},{START[1]},0.0]", f"query.goal=[{GOAL[0]},{GOAL[1]},0.0]",
    ]  # fmt: skip


def _flown(way: list[list[float]], speed: float, swings: bool) -> float:
    """The time [s] in which a vehicle of constant speed follows places (n, 2) [degrees]; inf if it cannot."""
    frame = LocalFrame(*MIDDLE)
    x, y = frame.to_local(*np.array(way, float).T)
    now = 0.0
    for ax, ay, bx, by in zip(x[:-1], y[:-1], x[1:], y[1:], strict=True):
        length = float(np.hypot(bx - ax, by - ay))
        parts = max(1, int(length / 20.0))
        for part in range(parts if length > 0 else 0):
            share = (part + 0.5) / parts
            lon, lat = frame.to_lonlat(ax + share * (bx - ax), ay + share * (by - ay))
            u, v = gyres(lon, lat, now, swings)
            along = (u * (bx - ax) + v * (by - ay)) / length
            across = (v * (bx - ax) - u * (by - ay)) / length
            if abs(across) >= speed or along + np.sqrt(speed**2 - across**2) <= 0:
                return float("inf")
            now += length / parts / float(along + np.sqrt(speed**2 - across**2))
    return now


def legs(name: str) -> Made:
    """A problem of the suite, for planners that use this project's legs."""
    reference = references()[name]

    def judge(answers: dict[str, dict[str, Any]]) -> Measure:
        def measure(found: dict[str, Any]) -> dict[str, Any]:
            times = [np.inf if one is None else one for one in found["routes_s"]]
            middle = {"median": float(np.median(times)), "low": min(times), "high": max(times)}
            known = {key: value if np.isfinite(value) else None for key, value in middle.items()}
            assert reference.seconds is not None
            over = None if known["median"] is None else known["median"] / reference.seconds
            found_of = f"{sum(np.isfinite(times))} of {len(times)}"
            told = {"reference_s": reference.seconds, "bound_s": reference.bound}
            return {"routes_s": known, "found": found_of, "over_level_set": over, **told}

        return measure

    return {"scenario": name, "runs": RUNS}, judge
