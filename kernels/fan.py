"""The flow map of one node: a fan of controls, landed on common depth levels; which targets lie under it.

All controls of a node that share a glide angle and differ in heading land, at a given depth, on a closed
curve; together they cover the node's footprint there. The fan is a mesh over (glide angle, heading); where a
cell's image holds a target, the inverse of the cell's linear map is a first guess of the control.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .control import angle_of_vertical_speed, glide_speed, vertical_speed
from .flow import Array
from .motion import LANES, H, T, U, V, W, X, Y, Z, rk4_lanes

Index = NDArray[np.int64]

MAX_LEVELS = 32
HORIZON_ROWS = 4
"""Levels whose shallowest possible glide is a row of the mesh."""
BENT = 4.0
"""A cell whose middle lies this far [m] from its linear image is refined."""
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
    """Exact steering: a fan of `angles` x `headings` controls, cells halved `generations` times at most."""

    angles: int
    headings: int
    generations: int


@njit
def fan_levels(bins, z, direction, deepest, levels):
    """The bins' levels from z outward: heights into `levels`; their number. `deepest`: as far as they go."""
    count = 0
    total = bins.levels.size
    for n in range(total):
        level = bins.levels[n] if direction == 1 else bins.levels[total - 1 - n]
        beyond = level > z if direction == 1 else level < z
        if not beyond:
            continue
        levels[count] = level
        count += 1
        if (level >= deepest) if direction == 1 else (level <= deepest):
            break
    return count


@njit
def fan_rows(steering, polar, direction, z, levels, count, horizon, rows):
    """Glide angles of the base mesh's rows, rising, into `rows`; their number, 0 where no level is in reach.

    Even steps over the angles that reach the first level, and the shallowest that reaches some of the others.
    """
    shallow = angle_of_vertical_speed(polar, direction, abs(levels[0] - z) / horizon)
    if math.isnan(shallow):
        return 0
    steep = polar.steepest[direction]
    for n in range(steering.angles):
        rows[n] = shallow + (steep - shallow) * n / (steering.angles - 1)
    filled = steering.angles
    extra = min(HORIZON_ROWS, count - 1)
    for n in range(extra):
        level = levels[1 + n * (count - 1) // extra]
        angle = angle_of_vertical_speed(polar, direction, abs(level - z) / horizon)
        if not math.isnan(angle):
            rows[filled] = angle
            filled += 1
    rows[:filled].sort()
    kept = 1
    for n in range(1, filled):
        if rows[n] > rows[kept - 1] + 1e-9:
            rows[kept] = rows[n]
            kept += 1
    return kept


@njit
def land_on_levels(
    flow, polar, direction, x, y, z, t, levels, angle, heading, first, last, depth, dt, landing, lanes
):
    """Fly controls first..last - 1 from (x, y, z) through `levels`; landings into `landing` (n, levels, 2).

    `depth[n]`: how many levels control n is flown through. Levels against the control's direction fly it back
    in time, to where it would have left to land at (x, y, z): in a steady flow the flow map's inverse.
    """
    for begin in range(first, last, LANES):
        through = 0
        for n in range(LANES):
            one = min(begin + n, last - 1)
            speed = glide_speed(polar, direction, angle[one])
            along = speed * math.cos(angle[one])
            lanes[U, n] = along * math.cos(heading[one])
            lanes[V, n] = along * math.sin(heading[one])
            lanes[W, n] = (2.0 * direction - 1.0) * speed * math.sin(angle[one])
            lanes[X, n], lanes[Y, n], lanes[Z, n], lanes[T, n] = x, y, z, t
            through = max(through, depth[one])
        height = z
        for level in range(through):
            rise = levels[level] - height
            steps = 1
            for n in range(LANES):
                one = min(begin + n, last - 1)
                # a lane beyond its own depth stands still
                lanes[H, n] = rise / lanes[W, n] if level < depth[one] else 0.0
                steps = max(steps, math.ceil(abs(lanes[H, n]) / dt))
            for n in range(LANES):
                lanes[H, n] /= steps
            for _ in range(steps):
                rk4_lanes(flow, lanes)
            height = levels[level]
            for n in range(LANES):
                lanes[Z, n] = height
                if begin + n < last and level < depth[begin + n]:
                    landing[begin + n, level, 0] = lanes[X, n]
                    landing[begin + n, level, 1] = lanes[Y, n]


class Slab(NamedTuple):
    """The nodes between two heights [m] of a fan, `start` where it comes from: `layer` of the bins."""

    layer: int
    start: float
    end: float


@njit(inline="always")
def _bin_range(low, high, origin, per_bin, count):
    first = int(min(max((low - origin) * per_bin, 0.0), count - 1.0))
    last = int(min(max((high - origin) * per_bin, 0.0), count - 1.0))
    return first, last


@njit
def any_wanted(bins, slab, position, wanted, x_lo, x_hi, y_lo, y_hi):
    """Whether a wanted node of the slab lies in the rectangle [m]."""
    i_first, i_last = _bin_range(x_lo, x_hi, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = _bin_range(y_lo, y_hi, bins.y_lo, bins.per_bin, bins.ny)
    for i in range(i_first, i_last + 1):
        row = (slab.layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            if wanted[node] and x_lo <= position[node, 0] <= x_hi and y_lo <= position[node, 1] <= y_hi:
                return True
    return False


@njit(inline="always")
def _inside(ax, ay, bx, by, cx, cy, x, y):
    """(s, r, det) with (x, y) = a + s (b - a) + r (c - a); det 0 where the triangle is flat."""
    det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if det == 0.0:
        return 0.0, 0.0, 0.0
    s = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / det
    r = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / det
    return s, r, det


@njit
def guess_in_cell(bins, slab, position, wanted, image, angles, headings, guesses, count):
    """First guesses for the wanted nodes under one cell; returns (guesses, count).

    `image` (3, 4, 2): landings of the controls (a0, h0), (a0, h1), (a1, h0), (a1, h1) at the slab's end and at
    its start; the third is scratch. A row of `guesses`: node, angle, heading, how far outside the cell, and
    d(angle, heading) / d(x, y).
    """
    corners, before, at = image[0], image[1], image[2]
    x_lo = min(corners[0, 0], corners[1, 0], corners[2, 0], corners[3, 0])
    x_hi = max(corners[0, 0], corners[1, 0], corners[2, 0], corners[3, 0])
    y_lo = min(corners[0, 1], corners[1, 1], corners[2, 1], corners[3, 1])
    y_hi = max(corners[0, 1], corners[1, 1], corners[2, 1], corners[3, 1])
    if not bins.aligned:
        x_lo = min(x_lo, before[0, 0], before[1, 0], before[2, 0], before[3, 0])
        x_hi = max(x_hi, before[0, 0], before[1, 0], before[2, 0], before[3, 0])
        y_lo = min(y_lo, before[0, 1], before[1, 1], before[2, 1], before[3, 1])
        y_hi = max(y_hi, before[0, 1], before[1, 1], before[2, 1], before[3, 1])
    room = MARGIN * max(x_hi - x_lo, y_hi - y_lo)
    i_first, i_last = _bin_range(x_lo - room, x_hi + room, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = _bin_range(y_lo - room, y_hi + room, bins.y_lo, bins.per_bin, bins.ny)
    da = angles[1] - angles[0]
    dh = headings[1] - headings[0]
    for i in range(i_first, i_last + 1):
        row = (slab.layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            if not wanted[node]:
                continue
            x, y = position[node, 0], position[node, 1]
            if x < x_lo - room or x > x_hi + room or y < y_lo - room or y > y_hi + room:
                continue
            f = (position[node, 2] - slab.start) / (slab.end - slab.start)
            if not 0.0 < f <= 1.0:
                continue
            for c in range(4):
                for m in range(2):
                    at[c, m] = before[c, m] + f * (corners[c, m] - before[c, m])
            best = math.inf
            for upper in range(2):
                # lower triangle at (a0, h0), upper one at (a1, h1), their legs along angle and heading
                o = 3 * upper
                p = 2 - upper
                q = 1 + upper
                s, r, det = _inside(at[o, 0], at[o, 1], at[p, 0], at[p, 1], at[q, 0], at[q, 1], x, y)
                outside = max(0.0, -s, -r, s + r - 1.0)
                if det == 0.0 or outside > MARGIN or outside >= best:
                    continue
                if best == math.inf:
                    if count == guesses.shape[0]:
                        longer = np.empty((2 * count, 8))
                        longer[:count] = guesses
                        guesses = longer
                    count += 1
                best = outside
                sign = 1.0 - 2.0 * upper
                angle = angles[upper] + sign * s * da
                heading = headings[upper] + sign * r * dh
                # the triangle's own legs are -da, -dh long in the upper one
                ga = sign * da / det
                gh = sign * dh / det
                guesses[count - 1, 0] = node
                guesses[count - 1, 1] = angle
                guesses[count - 1, 2] = heading
                guesses[count - 1, 3] = outside
                guesses[count - 1, 4] = ga * (at[q, 1] - at[o, 1])
                guesses[count - 1, 5] = -ga * (at[q, 0] - at[o, 0])
                guesses[count - 1, 6] = -gh * (at[p, 1] - at[o, 1])
                guesses[count - 1, 7] = gh * (at[p, 0] - at[o, 0])
    return guesses, count


@njit(inline="always")
def _bend(landing, a, b, middle, level):
    """How far [m] a landing lies from the middle of two others."""
    x = landing[middle, level, 0] - 0.5 * (landing[a, level, 0] + landing[b, level, 0])
    y = landing[middle, level, 1] - 0.5 * (landing[a, level, 1] + landing[b, level, 1])
    return math.hypot(x, y)


@njit
def _corners(landing, cell, level, x, y, corners, before):
    for c in range(4):
        corners[c, 0] = landing[cell[c], level, 0]
        corners[c, 1] = landing[cell[c], level, 1]
        before[c, 0] = landing[cell[c], level - 1, 0] if level > 0 else x
        before[c, 1] = landing[cell[c], level - 1, 1] if level > 0 else y


@njit
def _turned(c):
    """Whether the cell is folded: its two triangles are turned opposite ways."""
    low = (c[2, 0] - c[0, 0]) * (c[1, 1] - c[0, 1]) - (c[1, 0] - c[0, 0]) * (c[2, 1] - c[0, 1])
    high = (c[1, 0] - c[3, 0]) * (c[2, 1] - c[3, 1]) - (c[2, 0] - c[3, 0]) * (c[1, 1] - c[3, 1])
    return low * high <= 0.0


@njit
def _wants_halving(bins, slab, position, wanted, corners, before, bend):
    """Whether a cell bent by `bend` [m], or folded, has a wanted node within the bend or the fold's reach."""
    x_lo = min(corners[:, 0].min(), before[:, 0].min() if not bins.aligned else math.inf)
    x_hi = max(corners[:, 0].max(), before[:, 0].max() if not bins.aligned else -math.inf)
    y_lo = min(corners[:, 1].min(), before[:, 1].min() if not bins.aligned else math.inf)
    y_hi = max(corners[:, 1].max(), before[:, 1].max() if not bins.aligned else -math.inf)
    folded = _turned(corners)
    if bend <= BENT and not folded:
        return False
    room = max(bend, 0.25 * max(x_hi - x_lo, y_hi - y_lo)) if folded else bend
    return any_wanted(bins, slab, position, wanted, x_lo - room, x_hi + room, y_lo - room, y_hi + room)


@njit
def fan_guesses(
    flow,
    polar,
    steering,
    bins,
    position,
    wanted,
    direction,
    backward,
    x,
    y,
    z,
    t,
    deepest,
    dt,
    horizon,
    lanes,
):
    """First guesses for the wanted nodes that a node at (x, y, z) may reach in one vertical direction.

    The wanted nodes lie no further than `deepest` [m]. With `backward`, those that may reach it, and the
    controls that they would take. Returns (guesses, count), rows as `guess_in_cell` has them.
    """
    guesses = np.empty((256, 8))
    count = 0
    levels = np.empty(MAX_LEVELS)
    outward = 1 - direction if backward else direction
    reached = fan_levels(bins, z, outward, deepest, levels)
    if reached == 0:
        return guesses, count
    levels = levels[:reached]
    rows = np.empty(steering.angles + HORIZON_ROWS)
    row_count = fan_rows(steering, polar, direction, z, levels, reached, horizon, rows)
    if row_count < 2:
        return guesses, count
    columns = steering.headings
    slack = 0 if bins.aligned else 1
    capacity = 4 * row_count * columns
    angle = np.empty(capacity)
    heading = np.empty(capacity)
    depth = np.empty(capacity, np.int64)
    landing = np.empty((capacity, reached, 2))
    vertices = row_count * columns
    for i in range(row_count):
        fastest = vertical_speed(polar, direction, rows[i]) * horizon * (1.0 + 1e-9)
        through = 0
        while through < reached and abs(levels[through] - z) <= fastest:
            through += 1
        for j in range(columns):
            angle[i * columns + j] = rows[i]
            heading[i * columns + j] = 2.0 * math.pi * j / columns
            depth[i * columns + j] = min(through + slack, reached)
    land_on_levels(
        flow, polar, direction, x, y, z, t, levels, angle, heading, 0, vertices, depth, dt, landing, lanes
    )

    image = np.empty((3, 4, 2))
    corners, before = image[0], image[1]
    cell = np.empty(4, np.int64)
    angles = np.empty(2)
    headings = np.empty(2)
    slabs = [_slab(bins, outward, z, levels, k) for k in range(reached)]
    # cells to halve: corners, base angle and heading, generation by generation; levels as bits
    queue = np.empty((256, 4), np.int64)
    span = np.empty((256, 4))
    todo = np.zeros(256, np.int64)
    waiting = 0
    for i in range(row_count - 1):
        for j in range(columns):
            right = (j + 1) % columns
            cell[0] = i * columns + j
            cell[1] = i * columns + right
            cell[2] = cell[0] + columns
            cell[3] = cell[1] + columns
            angles[0], angles[1] = rows[i], rows[i + 1]
            headings[0] = 2.0 * math.pi * j / columns
            headings[1] = 2.0 * math.pi * (j + 1) / columns
            bits = 0
            for k in range(min(depth[cell[0]], depth[cell[2]])):
                _corners(landing, cell, k, x, y, corners, before)
                bend = _base_bend(landing, rows, row_count, columns, depth, i, j, k)
                if steering.generations > 0 and _wants_halving(
                    bins, slabs[k], position, wanted, corners, before, bend
                ):
                    bits |= 1 << k
                else:
                    guesses, count = guess_in_cell(
                        bins, slabs[k], position, wanted, image, angles, headings, guesses, count
                    )
            if bits:
                queue, span, todo, waiting = _push(queue, span, todo, waiting, cell, angles, headings, bits)
    generation = 0
    first = 0
    while first < waiting:
        generation += 1
        last = waiting
        new = vertices
        need = vertices + 5 * (last - first)
        if need > angle.size:
            angle, heading, depth, landing = _grown(angle, heading, depth, landing, 2 * need)
        for c in range(first, last):
            through = 0
            while (todo[c] >> through) > 0:
                through += 1
            a_mid = 0.5 * (span[c, 0] + span[c, 1])
            h_mid = 0.5 * (span[c, 2] + span[c, 3])
            # middles: (a0, hm), (am, h0), (am, hm), (am, h1), (a1, hm)
            for m in range(5):
                angle[new + m] = span[c, 0] if m == 0 else (span[c, 1] if m == 4 else a_mid)
                heading[new + m] = span[c, 2] if m == 1 else (span[c, 3] if m == 3 else h_mid)
                depth[new + m] = through
            new += 5
        land_on_levels(
            flow,
            polar,
            direction,
            x,
            y,
            z,
            t,
            levels,
            angle,
            heading,
            vertices,
            new,
            depth,
            dt,
            landing,
            lanes,
        )
        for c in range(first, last):
            mid = vertices + 5 * (c - first)
            v = queue[c].copy()
            lines = span[c].copy()
            bits_of = np.zeros(4, np.int64)
            for k in range(reached):
                if not (todo[c] >> k) & 1:
                    continue
                bend = max(
                    _bend(landing, v[0], v[1], mid, k),
                    _bend(landing, v[0], v[2], mid + 1, k),
                    _bend(landing, v[0], v[3], mid + 2, k),
                    _bend(landing, v[1], v[2], mid + 2, k),
                    _bend(landing, v[1], v[3], mid + 3, k),
                    _bend(landing, v[2], v[3], mid + 4, k),
                )
                for child in range(4):
                    _child(v, lines, mid, child, cell, angles, headings)
                    _corners(landing, cell, k, x, y, corners, before)
                    # halving a cell quarters its bend
                    if generation < steering.generations and _wants_halving(
                        bins, slabs[k], position, wanted, corners, before, 0.25 * bend
                    ):
                        bits_of[child] |= 1 << k
                    else:
                        guesses, count = guess_in_cell(
                            bins,
                            slabs[k],
                            position,
                            wanted,
                            image,
                            angles,
                            headings,
                            guesses,
                            count,
                        )
            for child in range(4):
                if bits_of[child]:
                    _child(v, lines, mid, child, cell, angles, headings)
                    queue, span, todo, waiting = _push(
                        queue, span, todo, waiting, cell, angles, headings, bits_of[child]
                    )
        vertices = new
        first = last
    return guesses, count


@njit
def _slab(bins, outward, z, levels, k):
    start = levels[k - 1] if k > 0 else z
    layer = int(np.searchsorted(bins.levels, levels[k]))
    if outward == 1 and not bins.aligned:
        layer -= 1
    return Slab(layer, start, levels[k])


@njit
def _base_bend(landing, rows, row_count, columns, depth, i, j, k):
    """The bend [m] of a base cell, from second differences along its sides and its twist."""
    bend = 0.0
    for row in (i, i + 1):
        here = row * columns
        for side in (j, (j + 1) % columns):
            bend = max(
                bend,
                0.25 * _bend(landing, here + (side - 1) % columns, here + (side + 1) % columns, here + side, k),
            )
    for side in (j, (j + 1) % columns):
        for row in (i, i + 1):
            up = (row + 1) * columns + side
            down = (row - 1) * columns + side
            if 0 < row < row_count - 1 and k < depth[down]:
                # rows are uneven: the second derivative times half a step squared, over two
                low, high = rows[row] - rows[row - 1], rows[row + 1] - rows[row]
                here = row * columns + side
                step = rows[i + 1] - rows[i]
                second = np.empty(2)
                for m in range(2):
                    second[m] = (
                        2.0
                        * (
                            (landing[up, k, m] - landing[here, k, m]) / high
                            - (landing[here, k, m] - landing[down, k, m]) / low
                        )
                        / (low + high)
                    )
                bend = max(bend, math.hypot(second[0], second[1]) * step * step / 8.0)
    right = (j + 1) % columns
    a, b = i * columns + j, i * columns + right
    c, d = a + columns, b + columns
    x = landing[a, k, 0] - landing[b, k, 0] - landing[c, k, 0] + landing[d, k, 0]
    y = landing[a, k, 1] - landing[b, k, 1] - landing[c, k, 1] + landing[d, k, 1]
    return max(bend, 0.25 * math.hypot(x, y))


@njit
def _child(v, lines, mid, child, cell, angles, headings):
    """Quarter `child` of a cell: its corners, angles and headings."""
    a_mid = 0.5 * (lines[0] + lines[1])
    h_mid = 0.5 * (lines[2] + lines[3])
    if child == 0:
        cell[0], cell[1], cell[2], cell[3] = v[0], mid, mid + 1, mid + 2
    elif child == 1:
        cell[0], cell[1], cell[2], cell[3] = mid, v[1], mid + 2, mid + 3
    elif child == 2:
        cell[0], cell[1], cell[2], cell[3] = mid + 1, mid + 2, v[2], mid + 4
    else:
        cell[0], cell[1], cell[2], cell[3] = mid + 2, mid + 3, mid + 4, v[3]
    angles[0], angles[1] = (lines[0], a_mid) if child < 2 else (a_mid, lines[1])
    headings[0], headings[1] = (lines[2], h_mid) if child % 2 == 0 else (h_mid, lines[3])


@njit
def _push(queue, span, todo, waiting, cell, angles, headings, bits):
    if waiting == todo.size:
        longer_queue = np.empty((2 * waiting, 4), np.int64)
        longer_span = np.empty((2 * waiting, 4))
        longer_todo = np.zeros(2 * waiting, np.int64)
        longer_queue[:waiting] = queue
        longer_span[:waiting] = span
        longer_todo[:waiting] = todo
        queue, span, todo = longer_queue, longer_span, longer_todo
    queue[waiting] = cell
    span[waiting, 0], span[waiting, 1] = angles[0], angles[1]
    span[waiting, 2], span[waiting, 3] = headings[0], headings[1]
    todo[waiting] = bits
    return queue, span, todo, waiting + 1


@njit
def _grown(angle, heading, depth, landing, size):
    used = angle.size
    longer_angle = np.empty(size)
    longer_heading = np.empty(size)
    longer_depth = np.empty(size, np.int64)
    longer_landing = np.empty((size, landing.shape[1], 2))
    longer_angle[:used] = angle
    longer_heading[:used] = heading
    longer_depth[:used] = depth
    longer_landing[:used] = landing
    return longer_angle, longer_heading, longer_depth, longer_landing
