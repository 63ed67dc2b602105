"""The flow map of one node: a fan of controls, landed on common depth levels; which targets lie under it.

All controls of a node that share a glide angle and differ in heading land, at a given depth, on a closed
curve; together they cover the node's footprint there. The fan is a mesh over (glide angle, heading); where a
cell's image holds a target, the inverse of the cell's quadratic map is a first guess of the control.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cache import entry_point, inlined, kernel, making
from .control import angle_of_vertical_speed, glide_speed, vertical_speed
from .flight import FLIGHT_ROWS, LEFT, advance, fly_for, hangar, place, rest
from .flow import Array
from .motion import LANES, W, X, Y, Z

Index = NDArray[np.int64]

TASK, NODE, ANGLE, HEADING, OUTSIDE, INVERSE = range(6)
"""Columns of a guess: the task it is for, node, glide angle and heading [rad], how far outside its cell, in the
cell's own units, and from INVERSE on d(angle, heading) / d(x, y), row by row."""
GUESS_COLUMNS = 10
THROUGH = 2
"""Column of a vertex, after its angle and heading: how many levels it flies through."""
ROW, COLUMN, SIZE, LEVELS = range(4)
"""Columns of a cell: its first corner and its size on the lattice, its levels as bits."""
ALONG_ANGLE, ALONG_HEADING = 4, 5
"""Rows of a patch, after the landings of its four corners: its second derivatives, in the cell's own units."""
_VERTEX, _LEVEL = FLIGHT_ROWS, FLIGHT_ROWS + 1
FAN_ROWS = FLIGHT_ROWS + 2
MAX_LEVELS = 32
BENT = 8.0
"""A cell whose middle lies this far [m] from its linear image is halved."""
MARGIN = 0.35
"""A target this far outside a triangle, in its own units, is a guess where none is inside."""


class NodeBins(NamedTuple):
    """Nodes in bins: layers between rising depth `levels` [m], each a grid of square bins.

    Layer s holds the nodes with levels[s] <= z < levels[s + 1]; bin (s, i, j) holds
    `node[first[b]:first[b + 1]]`, b = (s * nx + i) * ny + j. `aligned`: every node lies on a level.
    """

    levels: Array
    aligned: bool
    x_lo: float
    y_lo: float
    per_bin: float
    nx: int
    ny: int
    first: Index
    node: Index


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


@inlined
def _bin_range(low, high, origin, per_bin, count):
    first = int(min(max((low - origin) * per_bin, 0.0), count - 1.0))
    last = int(min(max((high - origin) * per_bin, 0.0), count - 1.0))
    return first, last


@kernel
def any_wanted(bins, layer, position, wanted, x_lo, x_hi, y_lo, y_hi):
    """Whether a wanted node of the layer lies in the rectangle [m]."""
    i_first, i_last = _bin_range(x_lo, x_hi, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = _bin_range(y_lo, y_hi, bins.y_lo, bins.per_bin, bins.ny)
    for i in range(i_first, i_last + 1):
        row = (layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            if not (x_lo <= position[node, 0] <= x_hi and y_lo <= position[node, 1] <= y_hi):
                continue
            if wanted.size == 0 or wanted[node]:
                return True
    return False


@inlined
def _inside(ax, ay, bx, by, cx, cy, x, y):
    """(s, r, det) with (x, y) = a + s (b - a) + r (c - a); det 0 where the triangle is flat."""
    det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if det == 0.0:
        return 0.0, 0.0, 0.0
    s = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / det
    r = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / det
    return s, r, det


@making
def longer(rows, needed):
    """The rows, and empty ones: twice as many, or as many as are needed."""
    if needed <= rows.shape[0]:
        return rows
    grown = np.empty((max(2 * rows.shape[0], needed), rows.shape[1]), rows.dtype)
    grown[: rows.shape[0]] = rows
    return grown


@kernel
def _patch(landing, corners, i, j, level, patch):
    """Quarter (i, j) of a cell at a level: landings of its corners, and its second derivatives.

    `corners` (9,): the vertices of the cell, halved. Of second derivatives the mean of both sides.
    """
    for m in range(2):
        at = 2 * level + m
        for c in range(4):
            patch[c, m] = landing[corners[3 * (i + c // 2) + j + c % 2], at]
        along_angle = 0.0
        along_heading = 0.0
        for side in range(2):
            a, h = j + side, 3 * (i + side)
            ends = landing[corners[a], at] + landing[corners[a + 6], at]
            along_angle += ends - 2.0 * landing[corners[a + 3], at]
            ends = landing[corners[h], at] + landing[corners[h + 2], at]
            along_heading += ends - 2.0 * landing[corners[h + 1], at]
        patch[ALONG_ANGLE, m] = 0.5 * along_angle
        patch[ALONG_HEADING, m] = 0.5 * along_heading


@kernel
def _around(bins, patches):
    """The rectangle about a patch, and about its start where nodes lie between: x_lo, x_hi, y_lo, y_hi [m]."""
    x_lo, x_hi, y_lo, y_hi = math.inf, -math.inf, math.inf, -math.inf
    for end in range(1 if bins.aligned else 2):
        for c in range(4):
            x_lo, x_hi = min(x_lo, patches[end, c, 0]), max(x_hi, patches[end, c, 0])
            y_lo, y_hi = min(y_lo, patches[end, c, 1]), max(y_hi, patches[end, c, 1])
    return x_lo, x_hi, y_lo, y_hi


@kernel
def _bend(p):
    """How far [m] a patch is from flat: the greatest distance of its middle lines from its linear image."""
    x = p[0, 0] - p[1, 0] - p[2, 0] + p[3, 0]
    y = p[0, 1] - p[1, 1] - p[2, 1] + p[3, 1]
    twist = 0.25 * math.sqrt(x * x + y * y)
    along_angle = math.sqrt(p[ALONG_ANGLE, 0] ** 2 + p[ALONG_ANGLE, 1] ** 2) / 8.0
    return max(twist, along_angle, math.sqrt(p[ALONG_HEADING, 0] ** 2 + p[ALONG_HEADING, 1] ** 2) / 8.0)


@kernel
def _folded(p):
    """Whether the two triangles of a patch are turned opposite ways."""
    low = (p[2, 0] - p[0, 0]) * (p[1, 1] - p[0, 1]) - (p[1, 0] - p[0, 0]) * (p[2, 1] - p[0, 1])
    high = (p[1, 0] - p[3, 0]) * (p[2, 1] - p[3, 1]) - (p[2, 0] - p[3, 0]) * (p[1, 1] - p[3, 1])
    return low * high <= 0.0


@kernel
def wants_halving(bins, layer, position, wanted, patches):
    """Whether a patch that is bent or folded has a wanted node within the bend's or the fold's reach."""
    bend = _bend(patches[0])
    folded = _folded(patches[0])
    if bend <= BENT and not folded:
        return False
    x_lo, x_hi, y_lo, y_hi = _around(bins, patches)
    room = max(bend, 0.25 * max(x_hi - x_lo, y_hi - y_lo)) if folded else bend
    return any_wanted(bins, layer, position, wanted, x_lo - room, x_hi + room, y_lo - room, y_hi + room)


@kernel
def _solve(p, x, y, s, r):
    """Newton steps from (s, r) towards the point of a patch's quadratic map that is (x, y).

    Returns s, r and the map's derivatives x_s, x_r, y_s, y_r there; s is along the angle, r along the heading.
    """
    x_s, x_r, y_s, y_r = 0.0, 0.0, 0.0, 0.0
    for step in range(3):
        twist_x = p[3, 0] - p[2, 0] - p[1, 0] + p[0, 0]
        twist_y = p[3, 1] - p[2, 1] - p[1, 1] + p[0, 1]
        x_s = p[2, 0] - p[0, 0] + r * twist_x - (0.5 - s) * p[ALONG_ANGLE, 0]
        y_s = p[2, 1] - p[0, 1] + r * twist_y - (0.5 - s) * p[ALONG_ANGLE, 1]
        x_r = p[1, 0] - p[0, 0] + s * twist_x - (0.5 - r) * p[ALONG_HEADING, 0]
        y_r = p[1, 1] - p[0, 1] + s * twist_y - (0.5 - r) * p[ALONG_HEADING, 1]
        det = x_s * y_r - x_r * y_s
        if step == 2 or det == 0.0:
            break
        a, h = 0.5 * s * (1.0 - s), 0.5 * r * (1.0 - r)
        off_x = p[0, 0] + s * (p[2, 0] - p[0, 0]) + r * (p[1, 0] - p[0, 0]) + s * r * twist_x - x
        off_y = p[0, 1] + s * (p[2, 1] - p[0, 1]) + r * (p[1, 1] - p[0, 1]) + s * r * twist_y - y
        off_x -= a * p[ALONG_ANGLE, 0] + h * p[ALONG_HEADING, 0]
        off_y -= a * p[ALONG_ANGLE, 1] + h * p[ALONG_HEADING, 1]
        s -= (y_r * off_x - x_r * off_y) / det
        r -= (x_s * off_y - y_s * off_x) / det
    return s, r, x_s, x_r, y_s, y_r


@making
def guess_in_patch(
    bins, layer, start, end, position, wanted, z, patches, task, angle, da, heading, dh, guesses, count
):
    """First guesses for the wanted nodes under a patch of (angle, heading) + (da, dh); returns (guesses, count).

    `patches` (3, 6, 2): the patch at the layer's `end` and at its `start` [m]; the third is scratch.
    """
    x_lo, x_hi, y_lo, y_hi = _around(bins, patches)
    room = MARGIN * max(x_hi - x_lo, y_hi - y_lo)
    i_first, i_last = _bin_range(x_lo - room, x_hi + room, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = _bin_range(y_lo - room, y_hi + room, bins.y_lo, bins.per_bin, bins.ny)
    p = patches[0] if bins.aligned else patches[2]
    for i in range(i_first, i_last + 1):
        row = (layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            x, y = position[node, 0], position[node, 1]
            if x < x_lo - room or x > x_hi + room or y < y_lo - room or y > y_hi + room:
                continue
            f = (position[node, 2] - start) / (end - start)
            if position[node, 2] == z or f < 0.0 or f > 1.0 or not (wanted.size == 0 or wanted[node]):
                continue
            if not bins.aligned:
                for c in range(6):
                    for m in range(2):
                        p[c, m] = patches[1, c, m] + f * (patches[0, c, m] - patches[1, c, m])
            # lower triangle at corner 0, upper one at corner 3, their legs along angle and heading
            s, r, low = _inside(p[0, 0], p[0, 1], p[2, 0], p[2, 1], p[1, 0], p[1, 1], x, y)
            outside = max(0.0, -s, -r, s + r - 1.0) if low != 0.0 else math.inf
            back_s, back_r, high = _inside(p[3, 0], p[3, 1], p[1, 0], p[1, 1], p[2, 0], p[2, 1], x, y)
            beyond = max(0.0, -back_s, -back_r, back_s + back_r - 1.0) if high != 0.0 else math.inf
            if beyond < outside:
                s, r, outside = 1.0 - back_s, 1.0 - back_r, beyond
            if outside > MARGIN:
                continue
            s_2, r_2, x_s, x_r, y_s, y_r = _solve(p, x, y, s, r)
            if abs(s_2 - s) + abs(r_2 - r) < 1.0:
                s, r = s_2, r_2
            else:
                x_s, x_r, y_s, y_r = p[2, 0] - p[0, 0], p[1, 0] - p[0, 0], p[2, 1] - p[0, 1], p[1, 1] - p[0, 1]
            det = x_s * y_r - x_r * y_s
            if det == 0.0:
                continue
            guesses = longer(guesses, count + 1)
            guess = guesses[count]
            guess[TASK], guess[NODE], guess[OUTSIDE] = task, node, outside
            guess[ANGLE], guess[HEADING] = angle + s * da, heading + r * dh
            guess[INVERSE], guess[INVERSE + 1] = da * y_r / det, -da * x_r / det
            guess[INVERSE + 2], guess[INVERSE + 3] = -dh * y_s / det, dh * x_s / det
            count += 1
    return guesses, count


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
                    _patch(landing, corners, low, left_of, k, patches[0])
                    if not bins.aligned:
                        if k > 0:
                            _patch(landing, corners, low, left_of, k - 1, patches[1])
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
