"""The flow map of one node: a fan of controls, landed on common depth levels; which targets lie under it.

All controls of a node that share a glide angle and differ in heading land, at a given depth, on a closed
curve; together they cover the node's footprint there. The fan is a mesh over (glide angle, heading); where a
cell's image holds a target, the inverse of the cell's quadratic map is a first guess of the control.
"""

import math
from typing import NamedTuple

import numpy as np

from .cache import entry_point, kernel, making
from .control import angle_of_vertical_speed, glide_speed, vertical_speed
from .flight import FLIGHT_ROWS, LEFT, advance, fly_for, hangar, place, rest
from .motion import LANES, W, X, Y, Z
from .patch import MAX_LEVELS, fill_patch, guess_in_patch, longer, wants_halving

THROUGH = 2
"""Column of a vertex, after its angle and heading: how many levels it flies through."""
ROW, COLUMN, SIZE, LEVELS = range(4)
"""Columns of a cell: its first corner and its size on the lattice, its levels as bits."""
_VERTEX, _LEVEL = FLIGHT_ROWS, FLIGHT_ROWS + 1
FAN_ROWS = FLIGHT_ROWS + 2


class FlowMap(NamedTuple):
    """Exact steering: a fan of `angles` x `headings` controls.

    Its cells are halved once, and `generations` times more at most.
    """

    angles: int
    headings: int
    generations: int


@kernel
def layers_outward(bins, z, outward, deepest, levels, layers):
    """The bins' levels from z outward, as far as `deepest` [m]: heights and layers; returns how many.

    Layer k holds the nodes between level k - 1, at first z, and level k.
    """
    count = 0
    total = bins.levels.size
    for n in range(total):
        m = n if outward == 1 else total - 1 - n
        level = bins.levels[m]
        if (level <= z) if outward == 1 else (level >= z):
            continue
        levels[count] = level
        layers[count] = m - 1 if outward == 1 and not bins.aligned else m
        count += 1
        if (level >= deepest) if outward == 1 else (level <= deepest):
            break
    return count


@kernel
def fan_rows(polar, direction, nearest, horizon, rows):
    """Glide angles of the coarsest mesh's rows, rising, into `rows`; False where no level is in reach.

    From the shallowest that rises or sinks `nearest` [m] within the horizon [s], in even ratios of the vertical
    speed: so a row that just misses a level in time is late by one ratio at most.
    """
    shallow = angle_of_vertical_speed(polar, direction, nearest / horizon)
    steep = polar.steepest[direction]
    if not shallow < steep:
        return False
    slow, fast = vertical_speed(polar, direction, shallow), vertical_speed(polar, direction, steep)
    last = rows.size - 1
    rows[0], rows[last] = shallow, steep
    for n in range(1, last):
        rows[n] = angle_of_vertical_speed(polar, direction, slow * (fast / slow) ** (n / last))
    return True


@kernel
def land_on_levels(flow, polar, direction, x, y, z, t, levels, vertex, first, last, dt, landing, lanes):
    """Fly the controls of vertices first..last - 1 from (x, y, z) at t through `levels`, into rows of `landing`.

    `vertex` (n, 3): glide angle, heading, and THROUGH how many levels; `landing` (n, 2 levels): x, y at each.
    Levels against the control's direction fly it back in time, to where it would have left to land at
    (x, y, z): in a steady flow the flow map's inverse.
    """
    following = first
    flying = 0
    for n in range(LANES):
        rest(lanes, n)
        if following < last:
            _launch(polar, direction, x, y, z, t, levels, vertex, following, dt, lanes, n)
            following += 1
            flying += 1
    while flying > 0:
        advance(flow, lanes)
        for n in range(LANES):
            if lanes[LEFT, n] > 0.0:
                continue
            one, level = int(lanes[_VERTEX, n]), int(lanes[_LEVEL, n])
            landing[one, 2 * level], landing[one, 2 * level + 1] = lanes[X, n], lanes[Y, n]
            if level + 1 < vertex[one, THROUGH]:
                lanes[Z, n] = levels[level]
                lanes[_LEVEL, n] = level + 1
                fly_for(lanes, n, (levels[level + 1] - levels[level]) / lanes[W, n], dt)
            elif following < last:
                _launch(polar, direction, x, y, z, t, levels, vertex, following, dt, lanes, n)
                following += 1
            else:
                rest(lanes, n)
                flying -= 1


@entry_point()
def landings(flow, polar, direction, x, y, z, t, height, angle, heading, dt):
    """Where controls of magnitude `angle` (n,) and `heading` (n,) [rad] land at a height [m]: x, y (n, 2) [m]."""
    vertex = np.ones((angle.size, 3))
    vertex[:, 0], vertex[:, 1] = angle, heading
    landing = np.empty((angle.size, 2))
    first = np.int64(0)
    land_on_levels(
        flow, polar, direction, x, y, z, t, np.array([height]), vertex, first, angle.size, dt, landing,
        hangar(FAN_ROWS),
    )  # fmt: skip
    return landing


@kernel
def _launch(polar, direction, x, y, z, t, levels, vertex, one, dt, lanes, n):
    """Send lane n off with a vertex's control, to the first level."""
    angle, heading = vertex[one, 0], vertex[one, 1]
    speed = glide_speed(polar, direction, angle)
    along = speed * math.cos(angle)
    w = (2.0 * direction - 1.0) * speed * math.sin(angle)
    place(lanes, n, x, y, z, t, along * math.cos(heading), along * math.sin(heading), w)
    lanes[_VERTEX, n], lanes[_LEVEL, n] = one, 0.0
    fly_for(lanes, n, (levels[0] - z) / w, dt)


@making
def fan_guesses(
    medium, steering, bins, position, wanted, task, direction, backward, x, y, z, t, deepest, horizon, dt,
    guesses, count, lanes,
):  # fmt: skip
    """First guesses for the wanted nodes that (x, y, z) may reach within `horizon` [s], one vertical direction.

    `wanted` (nodes,), all where it is empty; none lies further than `deepest` [m]. With `backward`, those
    that may reach it, and the controls that they would take. They follow the `count` guesses that are there;
    returns (guesses, count).
    """
    flow, polar = medium.flow, medium.polar
    levels = np.empty(MAX_LEVELS)
    layers = np.empty(MAX_LEVELS, np.int64)
    outward = 1 - direction if backward else direction
    reached = layers_outward(bins, z, outward, deepest, levels, layers)
    fastest = vertical_speed(polar, direction, polar.steepest[direction]) * horizon * (1.0 + 1e-9)
    while reached > 1 and abs(levels[reached - 2] - z) > fastest:
        reached -= 1
    if reached == 0:
        return guesses, count
    levels = levels[:reached]
    rows = np.empty(steering.angles)
    # between levels, the nodes of the first layer may lie as near as they like
    if not fan_rows(polar, direction, abs(levels[0] - z) if bins.aligned else 0.0, horizon, rows):
        return guesses, count
    row_count = rows.size

    # the finest mesh there may be, as a lattice: which vertex lies where, -1 where none does
    unit = 2 << steering.generations
    lattice = np.full(((row_count - 1) * unit + 1, steering.headings * unit), -1, np.int32)
    turn = 2.0 * math.pi / lattice.shape[1]
    cells = np.empty((row_count * steering.headings, 4), np.int64)
    waiting = 0
    for i in range(row_count - 1):
        # a cell takes part where its steeper row is in time; the other flies on for a ratio longer
        furthest = vertical_speed(polar, direction, rows[i + 1]) * horizon * (1.0 + 1e-9)
        through = 0
        while through < reached and abs(levels[through] - z) <= furthest:
            through += 1
        if not bins.aligned:
            # nodes between levels: one more, to interpolate
            through = min(through + 1, reached)
        for j in range(steering.headings):
            cell = cells[waiting]
            cell[ROW], cell[COLUMN], cell[SIZE], cell[LEVELS] = i * unit, j * unit, unit, (1 << through) - 1
            waiting += 1
    vertex = np.empty((512, 3))
    landing = np.empty((512, 2 * reached))
    corners = np.empty(9, np.int64)
    patches = np.empty((3, 6, 2))
    vertices = 0
    done = 0
    generation = 0
    while done < waiting:
        # halve the cells that wait: their vertices, where they are not there
        last = waiting
        new = vertices
        for c in range(done, last):
            half = cells[c, SIZE] // 2
            top = 0
            while (cells[c, LEVELS] >> top) > 0:
                top += 1
            vertex, landing = longer(vertex, vertices + 9), longer(landing, vertices + 9)
            for corner in range(9):
                i = cells[c, ROW] + corner // 3 * half
                j = (cells[c, COLUMN] + corner % 3 * half) % lattice.shape[1]
                one = lattice[i, j]
                if one < 0:
                    lattice[i, j] = vertices
                    row = min(i // unit, row_count - 2)
                    share = i / unit - row
                    vertex[vertices, 0] = (1.0 - share) * rows[row] + share * rows[row + 1]
                    vertex[vertices, 1] = j * turn
                    vertex[vertices, THROUGH] = top
                    vertices += 1
                elif one >= new:
                    vertex[one, THROUGH] = max(vertex[one, THROUGH], top)
        land_on_levels(flow, polar, direction, x, y, z, t, levels, vertex, new, vertices, dt, landing, lanes)
        # their quarters wait for another generation, or are looked into
        for c in range(done, last):
            half = cells[c, SIZE] // 2
            for corner in range(9):
                j = (cells[c, COLUMN] + corner % 3 * half) % lattice.shape[1]
                corners[corner] = lattice[cells[c, ROW] + corner // 3 * half, j]
            for quarter in range(4):
                low, left_of = quarter // 2, quarter % 2
                still = 0
                angle = vertex[corners[3 * low], 0]
                da = vertex[corners[3 * low + 3], 0] - angle
                for k in range(reached):
                    if not (cells[c, LEVELS] >> k) & 1:
                        continue
                    fill_patch(landing, corners, low, left_of, k, patches[0])
                    if not bins.aligned:
                        if k > 0:
                            fill_patch(landing, corners, low, left_of, k - 1, patches[1])
                        else:
                            patches[1, :, 0], patches[1, :, 1] = x, y
                            patches[1, 4:] = 0.0
                    if generation < steering.generations and wants_halving(
                        bins, layers[k], position, wanted, patches
                    ):
                        still |= 1 << k
                        continue
                    start = levels[k - 1] if k > 0 else z
                    guesses, count = guess_in_patch(
                        bins, layers[k], start, levels[k], position, wanted, z, patches, task, angle, da,
                        (cells[c, COLUMN] + left_of * half) * turn, half * turn, guesses, count,
                    )  # fmt: skip
                if still:
                    cells = longer(cells, waiting + 1)
                    cell = cells[waiting]
                    cell[ROW], cell[COLUMN] = cells[c, ROW] + low * half, cells[c, COLUMN] + left_of * half
                    cell[SIZE], cell[LEVELS] = half, still
                    waiting += 1
        done = last
        generation += 1
    return guesses, count
