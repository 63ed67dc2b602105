"""Refinement: the control line's best candidates as first guesses of exact legs."""

import math

import numpy as np

from .cache import entry_point, kernel, making
from .connect import begin_pair, pair_at
from .control import direction_of
from .edges import NO_HIT, STATUS
from .fan import FAN_ROWS, VERTEX_ANGLE, VERTEX_HEADING, VERTEX_THROUGH, Launch, land_on_levels
from .flight import hangar
from .flow import LEGS
from .patch import (
    GUESS_ANGLE,
    GUESS_COLUMNS,
    GUESS_HEADING,
    GUESS_INVERSE,
    GUESS_NODE,
    GUESS_OUTSIDE,
    GUESS_TASK,
    GUESS_TIME,
    LANDING_COLUMNS,
    Guesses,
    longer,
)
from .reach import (
    FOUND_EDGE,
    FOUND_NODE,
    FOUND_TASK,
    TASK_COLUMNS,
    TASK_DEADLINE,
    TASK_DIRECTION,
    TASK_ORIGIN,
    Points,
    horizon_of,
    polish,
)
from .steer import AIM_ROWS, FLOWN

TILT = 1e-3
"""A control is changed by this much [rad] to measure the derivatives of the flow map."""
MAX_LEAP = 1.0
"""A candidate whose first Newton step is longer [rad] is no guess: beyond lie 0.2 % of the edges."""


@kernel
def tilted(polar, direction, controls, count, vertex):
    """Each candidate control, and two beside it of another angle and another heading: rows of `vertex`."""
    for n in range(count):
        angle, heading = controls[n]
        tilt = TILT if angle + TILT <= polar.steepest[direction] else -TILT
        for m in range(3):
            vertex[3 * n + m, VERTEX_ANGLE] = angle + (tilt if m == 1 else 0.0)
            vertex[3 * n + m, VERTEX_HEADING] = heading + (TILT if m == 2 else 0.0)
            vertex[3 * n + m, VERTEX_THROUGH] = 1


@kernel
def nearest_of_its_branch(landing, count, n, x, y):
    """Return whether candidate n lands nearer to (x, y) than its neighbours on the same branch of the line."""
    miss = math.hypot(landing[3 * n, 0] - x, landing[3 * n, 1] - y)
    for other in (n - 2, n + 2):
        if 0 <= other < count and math.hypot(landing[3 * other, 0] - x, landing[3 * other, 1] - y) < miss:
            return False
    return True


@kernel
def guess_of(vertex, landing, n, goal, guess):
    """Write candidate n and the flow map's derivatives into a row as a first guess; False if it is no guess."""
    at, a, h = 3 * n, 3 * n + 1, 3 * n + 2
    da = vertex[a, VERTEX_ANGLE] - vertex[at, VERTEX_ANGLE]
    dh = vertex[h, VERTEX_HEADING] - vertex[at, VERTEX_HEADING]
    x_a, y_a = (landing[a, 0] - landing[at, 0]) / da, (landing[a, 1] - landing[at, 1]) / da
    x_h, y_h = (landing[h, 0] - landing[at, 0]) / dh, (landing[h, 1] - landing[at, 1]) / dh
    det = x_a * y_h - x_h * y_a
    off_x, off_y = goal.x - landing[at, 0], goal.y - landing[at, 1]
    leap = max(abs(y_h * off_x - x_h * off_y), abs(x_a * off_y - y_a * off_x))
    if not leap < MAX_LEAP * abs(det):
        return False
    guess[GUESS_OUTSIDE], guess[GUESS_TIME] = 0.0, landing[at, 2]
    guess[GUESS_ANGLE], guess[GUESS_HEADING] = vertex[at, VERTEX_ANGLE], vertex[at, VERTEX_HEADING]
    guess[GUESS_INVERSE], guess[GUESS_INVERSE + 1] = y_h / det, -x_h / det
    guess[GUESS_INVERSE + 2], guess[GUESS_INVERSE + 3] = -y_a / det, x_a / det
    return True


@making
def guesses_on_line(vertex, landing, candidates, goal, task, node, guesses):
    """Add first guesses from landed candidates to the guesses that exist."""
    rows, count = guesses
    rows = longer(rows, count + candidates)
    for n in range(candidates):
        near = nearest_of_its_branch(landing, candidates, n, goal.x, goal.y)
        if near and guess_of(vertex, landing, n, goal, rows[count]):
            rows[count, GUESS_TASK], rows[count, GUESS_NODE] = task, node
            count += 1
    return Guesses(rows, count)


@making
def candidate_guesses(medium, steering, pairs, edges, first, last, lanes):
    """First guesses for the pairs of source[first:last]: the candidates of each, flown to its goal's depth.

    Source n has tasks 2 (n - first), which dives, and the next one, which climbs.
    """
    controls = np.empty((steering.candidates, 2))
    vertex, landing = np.empty((3 * steering.candidates, 3)), np.empty((3 * steering.candidates, LANDING_COLUMNS))
    level, begin = np.empty(1), np.int64(0)
    guesses = Guesses(np.empty((256, GUESS_COLUMNS)), 0)
    for n in range(first, last):
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            pair = pair_at(pairs, n, k)
            count = begin_pair(medium, steering, pair, controls, edges[k])
            direction = direction_of(pair)
            tilted(medium.polar, direction, controls, count, vertex)
            level[0] = pair.goal.z
            launch = Launch(pair.start, direction, medium.integration.dt, FLOWN * horizon_of(medium), LEGS)
            land_on_levels(medium, launch, level, vertex, landing, begin, 3 * count, lanes)
            task = 2 * (n - first) + direction
            guesses = guesses_on_line(vertex, landing, count, pair.goal, task, pairs.target[k], guesses)
    return guesses


@making
def tasks_of(medium, pairs, first, last):
    """A dive and a climb of each of source[first:last], within the horizon."""
    tasks = np.zeros((2 * (last - first), TASK_COLUMNS))
    for n in range(tasks.shape[0]):
        tasks[n, TASK_ORIGIN], tasks[n, TASK_DIRECTION] = pairs.source[first + n // 2], n % 2
        tasks[n, TASK_DEADLINE] = horizon_of(medium)
    return tasks


@entry_point(nogil=True)
def refine_nodes(medium, steering, pairs, edges, first, last):
    """The cheapest exact legs that the candidate controls lead to, for the pairs of source[first:last].

    Arguments and outcomes as in `connect_nodes`.
    """
    lanes = hangar(max(AIM_ROWS, FAN_ROWS))
    guesses = candidate_guesses(medium, steering, pairs, edges, first, last, lanes)
    points = Points(pairs.position, pairs.departure, False, pairs.indptr, pairs.target)
    rows = polish(medium, pairs.position, points, tasks_of(medium, pairs, first, last), guesses, lanes)
    # rows come by task and node, targets in any order
    nodes = pairs.position.shape[0]
    key = rows[:, FOUND_TASK] * nodes + rows[:, FOUND_NODE]
    for n in range(first, last):
        for k in range(pairs.indptr[n], pairs.indptr[n + 1]):
            task = 2.0 * (n - first) + direction_of(pair_at(pairs, n, k))
            wanted = task * nodes + pairs.target[k]
            at = np.searchsorted(key, wanted)
            if edges[k, STATUS] == NO_HIT and at < key.size and key[at] == wanted:
                edges[k] = rows[at, FOUND_EDGE:]
