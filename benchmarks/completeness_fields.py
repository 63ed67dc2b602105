"""The fields on which `completeness.py` compares the flow map with brute force."""

import math
from typing import Any

import numpy as np

from glider_stream.kernels.terrain import OpenWater
from glider_stream.roadmap.builder import node_positions
from glider_stream.roadmap.evaluator import Evaluator
from glider_stream.roadmap.steering import FlowMapMethod, IntegrationSettings
from glider_stream.scenario import read_scenario
from glider_stream.vehicle.polar import polar
from glider_stream.vehicle.presets import PRESETS
from glider_stream.water.analytic import (
    Abc,
    DoubleGyre,
    InternalWave,
    Rankine,
    Rolls,
    Upwelling,
    Vortex,
    Vortices,
)
from glider_stream.water.sampled import sample_flow

DEPTHS = (-330.0, 0.0)
BEYOND = "vortices of 4.7 m/s"
"""A field so chaotic that it is held to no bound."""


def random_vortices(seed: int, count: int, speed: float, thickness: tuple[float, float]) -> Any:
    """Vortices over the seed box, of half to all of `speed` [m/s]: the kernel's flow."""
    rng = np.random.default_rng(seed)
    rows = zip(
        *rng.uniform(-550, 550, (2, count)),
        rng.uniform(70, 160, count),
        rng.uniform(0.5, 1.0, count) * speed * rng.choice([-1.0, 1.0], count),
        rng.uniform(0, 300, count),
        rng.uniform(*thickness, count),
        strict=True,
    )
    return Vortices(tuple(Vortex(*row) for row in rows)).kernel(DEPTHS)


def in_grid(flow: Any, spacing: tuple[float, float, float]) -> Any:
    """The flow on a grid wide enough for all paths."""
    return sample_flow(flow, spacing, (-2200.0, 2200.0), (-2200.0, 2200.0), DEPTHS)


def on_levels(seed: int, count: int, half: float, levels: list[float]) -> Any:
    """Nodes (count, 3) [m], random on a few depths."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-half, half, (count, 2)), rng.choice(levels, count)])


def fields() -> dict[str, tuple[Any, float, Evaluator]]:
    """Name -> nodes (n, 3) [m], departure [s], evaluator."""
    box = IntegrationSettings(5.0, 125, 5.0)
    gyre = IntegrationSettings(20.0, 100, 10.0)
    paper, slocum = polar(PRESETS["paper"]), polar(PRESETS["slocum"])

    def judge(flow: Any, glide: Any = paper, integration: Any = box) -> Evaluator:
        return Evaluator(flow, OpenWater(-math.inf), glide, FlowMapMethod(), integration)

    seed_box = read_scenario("seed-box", ["steering.method=flow-map"]).problem()
    rng = np.random.default_rng(5)
    anywhere = rng.uniform([-450, -450, -300], [450, 450, 0], (900, 3))
    four = [0.0, -100.0, -200.0, -300.0]
    gyres = rng.uniform([0, 0], [4000, 2000], (500, 2))
    gyres = np.column_stack([gyres, rng.choice([0.0, -100.0, -200.0], 500)])
    rough = in_grid(random_vortices(23, 14, 1.6, (40, 90)), (15, 15, 10))
    coarse = in_grid(random_vortices(24, 12, 1.0, (50, 150)), (25, 25, 20))
    strong, fierce = (random_vortices(25, 8, speed, (80, 200)) for speed in (1.93, 3.0))  # sums: 3.0, 4.7 m/s
    rankine = Rankine(x_centre=40.0, y_centre=-60.0, radius=180.0, speed=1.0).kernel(DEPTHS)
    steady = DoubleGyre(amplitude=0.15, length=2000.0, epsilon=0.0, period=14400.0).kernel(DEPTHS)
    swinging = DoubleGyre(amplitude=0.15, length=2000.0, epsilon=0.25, period=3600.0).kernel(DEPTHS)
    return {
        "seed box": (node_positions(seed_box), 0.0, seed_box.evaluator),
        "other vortices": (on_levels(1, 900, 450, four), 0.0, judge(random_vortices(21, 10, 0.9, (60, 200)))),
        "nodes at any depth": (anywhere, 0.0, judge(random_vortices(22, 12, 0.9, (40, 120)))),
        "rough vortices, in a grid": (on_levels(2, 900, 450, four), 0.0, judge(rough)),
        "any depth, in a coarse grid": (anywhere, 0.0, judge(coarse)),
        "vortices of 3 m/s": (on_levels(3, 900, 450, four), 0.0, judge(strong)),
        "Rankine vortex, any depth": (anywhere, 0.0, judge(rankine)),
        "double gyre": (gyres, 0.0, judge(steady, slocum, gyre)),
        "double gyre, swinging": (gyres, 1234.0, judge(swinging, slocum, gyre)),
        BEYOND: (on_levels(3, 900, 450, four), 0.0, judge(fierce)),
    }


def rising_fields() -> dict[str, tuple[Any, float, Evaluator]]:
    """The same of flows with a vertical part: up to half of the fastest sink, 0.86 m/s."""
    box = IntegrationSettings(5.0, 125, 5.0)
    paper = polar(PRESETS["paper"])
    four, rng = [0.0, -100.0, -200.0, -300.0], np.random.default_rng(7)
    anywhere = rng.uniform([-450, -450, -300], [450, 450, 0], (900, 3))

    def judge(flow: Any) -> Evaluator:
        return Evaluator(flow, OpenWater(-math.inf), paper, FlowMapMethod(), box)

    cells = Rolls(w=0.43, width=300.0, depth=300.0).kernel(DEPTHS)
    wave = InternalWave(w=0.43, length=400.0, depth=300.0, period=900.0).kernel(DEPTHS)
    chaotic = Abc(0.3, 0.25, 0.18, 500.0).kernel(DEPTHS)
    sides = (-2200.0, 2200.0)
    upwelling = Upwelling(0.1, 0.2, 0.0, stretch=-1.3e-3, x=sides).kernel(DEPTHS)
    return {
        "convection cells": (on_levels(11, 900, 450, four), 0.0, judge(cells)),
        "internal wave": (on_levels(12, 900, 450, four), 321.0, judge(wave)),
        "ABC, any depth": (anywhere, 0.0, judge(chaotic)),
        "upwelling, stretched": (on_levels(13, 900, 450, four), 0.0, judge(upwelling)),
        "cells in a grid": (on_levels(14, 900, 450, four), 0.0, judge(in_grid(cells, (15, 15, 10)))),
    }
