"""The least time of any route by hj_reachability: the front of all places that the vehicle can have reached.

V(., 0) is the time tau [s] that the vehicle needs from the start in still water, without a tip: a front begun
within tau arrives at t. From the start itself it takes t + tau / (1 + m / speed) at least, m the greatest current
there. Grids of 500 and 250 m; tau [s] is 12 times that, so their difference tells the error of the start too;
the goal's value is cubic between nodes.
"""

import math
import os

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import hj_reachability as hj
import jax.numpy as jnp
import numpy as np
from harness import JOB, answer, timed
from hj_reachability.boundary_conditions import extrapolate_away_from_zero
from problems_gyre import gyres, to_lonlat, to_metres
from scipy.ndimage import map_coordinates

SPEED, STEP = JOB["speed"], 600.0
LOW, HIGH = np.array([-24_000.0, -14_000.0]), np.array([24_000.0, 14_000.0])


class Vehicle(hj.dynamics.Dynamics):
    def __init__(self):
        pass

    # the library asks for both, and never calls them, since the Hamiltonian is given
    def __call__(self, state, control, disturbance, time):
        raise NotImplementedError

    optimal_control_and_disturbance = __call__

    def hamiltonian(self, state, time, value, grad_value):
        return state[2] * grad_value[0] + state[3] * grad_value[1] + SPEED * jnp.hypot(*grad_value)

    def partial_max_magnitudes(self, state, time, value, grad_value_box):
        return jnp.abs(state[2:4]) + SPEED


def arrival(spacing):
    tau, soft = 12.0 * spacing, 6.0 * spacing
    shape = tuple(int(n) for n in 1 + (HIGH - LOW) / spacing)
    sides = (extrapolate_away_from_zero,) * 2
    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(hj.sets.Box(LOW, HIGH), shape, sides)
    nodes = np.stack(
        np.meshgrid(*(np.linspace(*e) for e in zip(LOW, HIGH, shape, strict=True)), indexing="ij"), -1
    )
    lon, lat = to_lonlat(nodes[..., 0], nodes[..., 1])
    start, goal = np.array(to_metres(*JOB["start"])), np.array(to_metres(*JOB["goal"]))
    still = np.linalg.norm(nodes - start, axis=-1) / SPEED
    near = np.hypot(*(one[still < tau] for one in gyres(lon, lat, 0.0, JOB["swings"]))).max()
    vehicle, values, now, left = Vehicle(), jnp.asarray(np.hypot(still, soft) - soft), 0.0, math.inf
    settings = hj.SolverSettings.with_accuracy("very_high")
    while left > tau:
        uv = np.stack(gyres(lon, lat, now + STEP / 2, JOB["swings"]), axis=-1)
        moving = grid.replace(states=jnp.concatenate([grid.states, jnp.asarray(uv)], axis=-1))
        values = hj.step(settings, vehicle, moving, now, values, now + STEP, progress_bar=False)
        place = ((goal - LOW) / (HIGH - LOW) * (np.array(shape) - 1))[:, None]
        value = float(map_coordinates(np.asarray(values, float), place, mode="nearest")[0])
        before, left = left, math.sqrt(max(value + soft, soft) ** 2 - soft**2)
        now += STEP
    touched = now - STEP * (tau - left) / (before - left)
    return touched + tau / (1.0 + near / SPEED)


coarse = arrival(500.0)
fine, seconds = timed(lambda: arrival(250.0))
answer("hj_reachability", seconds, route_s=fine, coarser_s=coarse)
