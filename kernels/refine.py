"""Refinement: the control line's best candidates as first guesses of exact legs."""

import math

import numpy as np

from .cache import entry_point, kernel, making
from .connect import begin_pair
from .control import CLIMB, DIVE
from .edges import NO_HIT
from .fan import FAN_ROWS, THROUGH, land_on_levels
from .flight import hangar
from .patch import ANGLE, GUESS_COLUMNS, HEADING, INVERSE, NODE, OUTSIDE, TASK, longer
from .reach import DEADLINE, DIRECTION, ORIGIN, polish
from .steer import STEER_ROWS

TILT = 1e-3
"""Change of a control [rad] by which the flow map's derivatives are measured."""
MAX_LEAP = 1.0
"""A candidate whose first Newton step is longer [rad] is no guess: beyond lie 0.2 % of the edges."""


@kernel
def tilted(polar, direction, controls, count, vertex):
    """Each candidate control, and two beside it of another angle and another heading: rows of `vertex`."""
    for n in range(count):
        angle, heading = controls[n]
        tilt = TILT if angle + TILT <= polar.steepest[direction] else -TILT
        for m in range(3):
            vertex[3 * n + m, 0] = angle + (tilt if m == 1 else 0.0)
            vertex[3 * n + m, 1] = heading + (TILT if m == 2 else 0.0)
            vertex[3 * n + m, THROUGH] = 1


@kernel
def nearest_of_its_branch(landing, count, n, x, y):
    """Whether candidate n lands nearer to (x, y) than its neighbours on its own branch of the line."""
    miss = math.hypot(landing[3 * n, 0] - x, landing[3 * n, 1] - y)
    for other in (n - 2, n + 2):
        if 0 <= other < count and math.hypot(landing[3 * other, 0] - x, landing[3 * other, 1] - y) < miss:
            return False
    return True


@making
def guesses_on_line(vertex, landing, count, task, node, x, y, guesses, filled):
    """First guesses out of landed candidates; returns (guesses, filled)."""
    for n in range(count):
        if not nearest_of_its_branch(landing, count, n, x, y):
            continue
        a, h = 3 * n + 1, 3 * n + 2
        da, dh = vertex[a, 0] - vertex[3 * n, 0], vertex[h, 1] - vertex[3 * n, 1]
        x_a, y_a = (landing[a, 0] - landing[3 * n, 0]) / da, (landing[a, 1] - landing[3 * n, 1]) / da
        x_h, y_h = (landing[h, 0] - landing[3 * n, 0]) / dh, (landing[h, 1] - landing[3 * n, 1]) / dh
        det = x_a * y_h - x_h * y_a
        off_x, off_y = x - landing[3 * n, 0], y - landing[3 * n, 1]
        leap = max(abs(y_h * off_x - x_h * off_y), abs(x_a * off_y - y_a * off_x))
        if not leap < MAX_LEAP * abs(det):
            continue
        guesses = longer(guesses, filled + 1)
        guess = guesses[filled]
        guess[TASK], guess[NODE], guess[OUTSIDE] = task, node, 0.0
        guess[ANGLE], guess[HEADING] = vertex[3 * n, 0], vertex[3 * n, 1]
        guess[INVERSE], guess[INVERSE + 1] = y_h / det, -x_h / det
        guess[INVERSE + 2], guess[INVERSE + 3] = -y_a / det, x_a / det
        filled += 1
    return guesses, filled


@entry_point(nogil=True)
def refine_nodes(medium, steering, position, departure, source, indptr, target, edges, first, last):
    """The cheapest exact legs that the candidate controls lead to, for all targets of source[first:last].

    Arguments and outcomes as in `connect_nodes`.
    """
    horizon = medium.integration.steps * medium.integration.dt
    lanes = hangar(max(STEER_ROWS, FAN_ROWS))
    controls = np.empty((steering.candidates, 2))
    vertex, landing = np.empty((3 * steering.candidates, 3)), np.empty((3 * steering.candidates, 2))
    level = np.empty(1)
    tasks = np.empty((2 * (last - first), 4))
    guesses = np.empty((256, GUESS_COLUMNS))
    filled = np.int64(0)
    begin = np.int64(0)
    for n in range(first, last):
        p = source[n]
        x, y, z = position[p]
        for direction in range(2):
            task = tasks[2 * (n - first) + direction]
            task[ORIGIN], task[DIRECTION], task[DEADLINE] = p, direction, horizon
        for k in range(indptr[n], indptr[n + 1]):
            count = begin_pair(medium, steering, position, departure, p, target[k], controls, edges[k])
            x_q, y_q, level[0] = position[target[k]]
            direction = CLIMB if level[0] > z else DIVE
            tilted(medium.polar, direction, controls, count, vertex)
            land_on_levels(
                medium.flow, medium.polar, direction, x, y, z, departure[p], level, vertex, begin, 3 * count,
                medium.integration.dt, landing, lanes,
            )  # fmt: skip
            guesses, filled = guesses_on_line(
                vertex, landing, count, 2 * (n - first) + direction, target[k], x_q, y_q, guesses, filled
            )
    rows = polish(medium, position, position, departure, False, tasks, guesses, filled, lanes)
    # rows come by task and node, targets in any order
    key = rows[:, 0] * position.shape[0] + rows[:, 1]
    for n in range(first, last):
        for k in range(indptr[n], indptr[n + 1]):
            climbs = position[target[k], 2] > position[source[n], 2]
            wanted = (2.0 * (n - first) + climbs) * position.shape[0] + target[k]
            at = np.searchsorted(key, wanted)
            if edges[k, 0] == NO_HIT and at < key.size and key[at] == wanted:
                edges[k] = rows[at, 2:]
