"""Roadmaps that no build made."""

import itertools
from dataclasses import replace

import numpy as np

from glider_stream.vehicle.cost import Energy
from helpers.small import roadmap

COST = Energy(hotel=2.0, trim=5.0, volume=300.0, efficiency=((0.0, 0.1), (200.0, 0.3)), density=1025.0)


def random_roadmap(seed, nodes=7):
    """A few nodes at a few depths, with random edges, in the small scenario."""
    rng = np.random.default_rng(seed)
    position = np.column_stack([rng.uniform(-150, 150, (nodes, 2)), rng.choice([0.0, -60.0, -140.0], nodes)])
    pairs = [(a, b) for a, b in itertools.permutations(range(nodes), 2) if position[a, 2] != position[b, 2]]
    pairs = [pair for pair in pairs if rng.random() < 0.6]
    source, target = (np.array([pair[n] for pair in pairs]) for n in range(2))
    time = rng.uniform(20, 400, len(pairs))
    climbs = position[target, 2] > position[source, 2]
    base = roadmap()
    return replace(
        base, position=position, target=target.astype(np.int32), time=time, cost=COST.hotel * time + COST.trim,
        indptr=np.concatenate([[0], np.cumsum(np.bincount(source, minlength=nodes))]),
        glide_angle=np.where(climbs, 0.5, -0.5), heading=0 * time, speed=0 * time + 0.5, miss=0 * time,
    )  # fmt: skip
