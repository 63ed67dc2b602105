"""Routes and waters that several figures draw."""

from datetime import UTC, datetime
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from glider_stream import plot
from glider_stream.kernels.flow import NO_LADDER, Extent, OceanGrid, Vortices
from glider_stream.kernels.terrain import OpenWater, Seabed
from glider_stream.search.path import Leg, Path


def vortices():
    random, n = np.random.default_rng(3), 14
    x, y = random.uniform(-520, 520, (2, n))
    radius = random.uniform(90, 170, n)
    speed = random.uniform(0.6, 1.5, n) * random.choice([-1, 1], n)
    depth, thickness = random.uniform(0, 300, n), random.uniform(150, 320, n)
    box = (-600.0, 600.0, -600.0, 600.0, -np.inf, np.inf)
    return Vortices(x, y, radius, speed, depth, thickness, Extent(*box, 1.9, 100.0))


def zigzag(start, goal, depths, duration, bend, rows=40):
    stops = np.linspace((*start, 0.0), (*goal, 0.0), len(depths))
    stops[1:-1, :2] += np.random.default_rng(5).normal(0, bend, (len(depths) - 2, 2))
    stops[:, 2] = -np.asarray(depths, float)
    each, s = duration / (len(stops) - 1), np.linspace(0, 1, rows)
    legs = []
    for n, (a, b) in enumerate(pairwise(stops)):
        line = a + s[:, None] * (b - a)
        line[:, 0] += bend * 0.6 * np.sin(np.pi * s) * (-1) ** n
        line[:, 1] += bend * 0.6 * np.sin(np.pi * s)
        trajectory = np.column_stack([(n + s) * each, line])
        legs.append(Leg(a, b, 0.4, 0.3, 0.9, n * each, each, 0.1, trajectory))
    return Path(stops[0], stops[-1], duration, tuple(legs))


def box_scene():
    side = (np.arange(16) + 0.5) / 16 * 900 - 450
    mesh = np.meshgrid(side, side, [0.0, -100.0, -200.0, -300.0], indexing="ij")
    position = np.column_stack([m.ravel() for m in mesh])
    lo, hi = np.array([-450.0, -450, -300]), np.array([450.0, 450, 0])
    problem = SimpleNamespace(lo=lo, hi=hi, departure=0.0, to_lonlat=None, departs=None)
    depths = [0, 200, 100, 300, 0, 100, 300, 200, 300, 0]
    path = zigzag((-450, 450), (450, -450), depths, 1500.0, 60.0)
    return SimpleNamespace(
        flow=vortices(), terrain=OpenWater(-np.inf), problem=problem, position=position, path=path
    )


def ocean_scene():
    n, lo, hi = 31, -30e3, 30e3
    i, j = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    bottom = -1500 + 1800 * np.exp(-((i - 0.95) ** 2 + (j - 0.1) ** 2) / 0.08)
    bottom += 1700 * np.exp(-((i - 0.2) ** 2 + (j - 0.55) ** 2) / 0.006)
    values = np.zeros((2, 2, n, n, 2))
    for time in range(2):
        for level, fade in enumerate((0.5, 1.0)):
            a, b = 2 * np.pi * i + 0.3 * time, 2 * np.pi * j
            values[time, level, ..., 0] = 0.3 * fade * np.sin(a) * np.cos(b) + 0.05
            values[time, level, ..., 1] = -0.3 * fade * np.cos(a) * np.sin(b)
    index_map = np.stack([i * (n - 1), j * (n - 1)], axis=-1)
    per, slot, days = (n - 1) / (hi - lo), np.zeros(1, np.uintp), 172800.0
    levels, times = np.array([-500.0, 0.0]), np.array([0.0, days])
    box = (lo, hi, lo, hi, 0.0, days)
    extent = Extent(*box, 0.4, 2e3)
    flow = OceanGrid(
        values, levels, slot, 1 / 500.0, times, slot, 1 / days, index_map, per, per, NO_LADDER, extent
    )
    terrain = Seabed(bottom, 20.0, index_map, per, per, lo, lo, bottom)
    position = np.random.default_rng(1).uniform([lo, lo, -500], [hi, hi, 0], (1500, 3))
    position = position[plot.sample_water(terrain, *position.T)]
    box = {"lo": np.array([lo, lo, -500]), "hi": np.array([hi, hi, 0])}
    box["departs"] = datetime(2024, 11, 20, 18, tzinfo=UTC)
    problem = SimpleNamespace(**box, departure=21600.0, to_lonlat=lambda at: at[:, :2] / 1e5 + [-18.5, 38.0])
    depths = [0, 480, 20, 500, 0, 450, 150, 500, 0]
    path = zigzag((-25e3, -20e3), (22e3, 25e3), depths, 72000.0, 2500.0)
    return SimpleNamespace(flow=flow, terrain=terrain, problem=problem, position=position, path=path)


def arrivals(scene):
    """As if there were no current: how far from the start, at a speed that crosses in the path's time."""
    far = np.hypot(*(scene.position - scene.path.start)[:, :2].T)
    return far / far.max() * 1.5 * scene.path.travel_time
