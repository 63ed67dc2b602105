"""Sample the legs of a coastal roadmap every 10 m, against the current file and polygons as they are.

    python benchmarks/terrain_legs.py CURRENTS.nc --lon 20.2 20.9 --lat 38.0 38.7

The file's land and bottom are read again with xarray alone, at the nearest point: under its deepest level with
data no leg may pass by less than the clearance, above the middle of the next. Exit code 1 if one does.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
import shapely.geometry
import xarray as xr

from glider_stream import planner
from glider_stream.kernels.edges import Edge
from glider_stream.scenario import read_scenario

CLEARANCE, SPACING = 30.0, 10.0


def main():
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("currents")
    options.add_argument("--lon", type=float, nargs=2, default=(20.2, 20.9))
    options.add_argument("--lat", type=float, nargs=2, default=(38.0, 38.7))
    options.add_argument("--legs", type=int, default=10_000)
    asked = options.parse_args()
    west, east, south, north = *asked.lon, *asked.lat
    middle = (0.3 * west + 0.7 * east, 0.6 * south + 0.4 * north)
    area = shapely.Point(middle).buffer(0.12 * (east - west))
    with tempfile.TemporaryDirectory() as folder:
        zones = Path(folder) / "zones.geojson"
        zones.write_text(json.dumps(shapely.geometry.mapping(area)))
        scenario = read_scenario(
            "ionian",
            [
                f"flow.file={asked.currents}",
                f"domain.lon=[{west},{east}]",
                f"domain.lat=[{south},{north}]",
                f"terrain.clearance={CLEARANCE}",
                f"terrain.keep_out=[{json.dumps(str(zones))}]",
                "sampling.kind=halton",
                "sampling.count=4000",
                "sampling.seed=1",
            ],
        )
        scenario = replace(scenario, query=None)
        problem = scenario.problem()
        road = planner.build(scenario)
    with xr.open_dataset(asked.currents, decode_times=False) as data:
        here = data.isel(time=0) if "time" in data.dims else data
        u = here["uo"].transpose("depth", "latitude", "longitude").values
        depth, lat, lon = (here[name].values.astype(float) for name in ("depth", "latitude", "longitude"))
    wet = np.cumprod(np.isfinite(u), axis=0).sum(axis=0)
    faces = np.append((depth[1:] + depth[:-1]) / 2, 1.5 * depth[-1] - 0.5 * depth[-2])
    bottom = np.where(wet > 0, -faces[wet - 1], 0.0)
    source = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))
    chosen = np.random.default_rng(0).permutation(road.target.size)[: asked.legs]
    worst, points = np.inf, 0
    for n in chosen:
        edge = Edge(
            0, road.time[n], road.cost[n], road.glide_angle[n], road.heading[n], road.speed[n], road.miss[n]
        )
        track = problem.evaluator.trace(road.position[source[n]], edge, problem.departure)[:, 1:]
        far = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(track, axis=0), axis=1))])
        at = np.arange(0, far[-1], SPACING)
        x, y, z = (np.interp(at, far, column) for column in track.T)
        places = problem.to_lonlat(np.stack([x, y, z], axis=-1))
        i = np.abs(lon[:, None] - places[:, 0]).argmin(axis=0)
        j = np.abs(lat[:, None] - places[:, 1]).argmin(axis=0)
        here = bottom[j, i]
        inside = shapely.contains_xy(area, places[:, 0], places[:, 1])
        room = np.where(here < 0, z - here, -np.inf)
        room[inside] = -np.inf
        worst, points = min(worst, float(room.min())), points + at.size
    blocked, found = road.counts["blocked"], len(chosen)
    print(f"{found:,} legs of {road.target.size:,}, {points:,} points; {blocked:,} pairs were blocked")
    print(f"least room above the bottom: {worst:.2f} m, of {CLEARANCE:g} asked for")
    sys.exit(0 if worst >= CLEARANCE and found >= min(asked.legs, road.target.size) else 1)


if __name__ == "__main__":
    main()
