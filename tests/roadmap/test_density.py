"""How dense a roadmap is: known lattices, directions that are counted, when it warns."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from glider_stream.roadmap.density import Density, density_of

ANGLE = math.radians(45.0)


def lattice(step, heights, ways):
    """Nodes every `step` [m] at some heights, and edges to a ring in `ways` directions from the middle one."""
    x, y, z = np.meshgrid(np.arange(20) * step, np.arange(20) * step, heights, indexing="ij")
    nodes = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    turn = np.arange(ways) * (2 * math.pi / ways) + 0.01
    ring = np.column_stack([step * np.cos(turn), step * np.sin(turn), np.full(ways, heights[1] - heights[0])])
    middle = len(nodes)
    position = np.vstack([nodes, nodes[0], nodes[0] + ring])
    indptr = np.zeros(len(position) + 1, np.int64)
    indptr[middle + 1 :] = ways
    target = middle + 1 + np.arange(ways)
    return SimpleNamespace(position=position, indptr=indptr, targets=lambda edges: target[edges])


@pytest.mark.parametrize("step", [50.0, 200.0])
def test_spacing_is_told_in_lengths_of_a_leg(step):
    dense = density_of(lattice(step, (-100.0, 0.0), 8), ANGLE)
    assert dense.spacing == pytest.approx(step, rel=0.2)
    assert dense.legs == pytest.approx(dense.spacing / 100.0)


def test_a_coarse_roadmap_and_one_of_few_directions_are_warned_of():
    assert Density(20.0, 80.0, 0.8).warning == ""
    assert Density(20.0, 160.0, 1.6).warning.startswith(
        "nodes lie 1.6 legs apart, more than 1.15: a query finds a slower route"
    )
    assert Density(8.4, 80.0, 0.8).warning.startswith("legs leave a node in 8 directions of 36, fewer than 9")
    assert Density(8.6, 80.0, 0.8).warning == ""  # shown as 9
    told = "nodes 80 m apart at a depth, 0.80 legs; legs in 20 of 36 directions from a node"
    assert str(Density(20.0, 80.0, 0.8)) == told
