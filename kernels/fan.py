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

NODE, ANGLE, HEADING, OUTSIDE, INVERSE = range(5)
"""Columns of a guess: node, glide angle and heading [rad], how far outside its cell, in the cell's own units,
and from INVERSE on d(angle, heading) / d(x, y), row by row."""
GUESS_COLUMNS = 8
ANGLES, HEADINGS, LEVELS = 4, 6, 8
"""Columns of a cell: its four vertices, then its two angles, its two headings, its levels as bits."""
CELL_COLUMNS = 9
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


@njit
def fan_rows(steering, polar, direction, rises, horizon, rows):
    """Glide angles of the base mesh's rows, rising, into `rows`; their number, 0 where no level is in reach.

    `rises` [m]: how far each level lies above or below. Even steps over the angles that reach the first
    level, and the shallowest that reaches some of the others.
    """
    shallow = angle_of_vertical_speed(polar, direction, rises[0] / horizon)
    if math.isnan(shallow):
        return 0
    steep = polar.steepest[direction]
    filled = steering.angles
    for n in range(filled):
        rows[n] = shallow + (steep - shallow) * n / (steering.angles - 1)
    extra = min(HORIZON_ROWS, rises.size - 1)
    for n in range(extra):
        angle = angle_of_vertical_speed(polar, direction, rises[1 + n * (rises.size - 1) // extra] / horizon)
        place = filled
        while place > 0 and rows[place - 1] > angle:
            place -= 1
        if math.isnan(angle) or place == 0 or angle - rows[place - 1] < 1e-9:
            continue
        if place < filled and rows[place] - angle < 1e-9:
            continue
        for m in range(filled, place, -1):
            rows[m] = rows[m - 1]
        rows[place] = angle
        filled += 1
    return filled if steep > shallow else 0


@njit
def land_on_levels(flow, polar, direction, x, y, z, t, levels, vertex, first, last, dt, landing, lanes):
    """Fly the controls of vertices first..last - 1 from (x, y, z) at t through `levels`, into rows of `landing`.

    `vertex` (n, 3): glide angle, heading, and through how many levels; `landing` (n, 2 levels): x, y at each.
    Levels against the control's direction fly it back in time, to where it would have left to land at
    (x, y, z): in a steady flow the flow map's inverse.
    """
    for begin in range(first, last, LANES):
        most = 0
        for n in range(LANES):
            one = min(begin + n, last - 1)
            speed = glide_speed(polar, direction, vertex[one, 0])
            along = speed * math.cos(vertex[one, 0])
            lanes[U, n] = along * math.cos(vertex[one, 1])
            lanes[V, n] = along * math.sin(vertex[one, 1])
            lanes[W, n] = (2.0 * direction - 1.0) * speed * math.sin(vertex[one, 0])
            lanes[X, n], lanes[Y, n], lanes[Z, n], lanes[T, n] = x, y, z, t
            most = max(most, int(vertex[one, 2]))
        height = z
        for level in range(most):
            rise = levels[level] - height
            steps = 1
            for n in range(LANES):
                one = min(begin + n, last - 1)
                # a lane beyond its own levels stands still
                lanes[H, n] = rise / lanes[W, n] if level < vertex[one, 2] else 0.0
                steps = max(steps, math.ceil(abs(lanes[H, n]) / dt))
            for n in range(LANES):
                lanes[H, n] /= steps
            for _ in range(steps):
                rk4_lanes(flow, lanes)
            height = levels[level]
            for n in range(LANES):
                lanes[Z, n] = height
                if begin + n < last and level < vertex[begin + n, 2]:
                    landing[begin + n, 2 * level] = lanes[X, n]
                    landing[begin + n, 2 * level + 1] = lanes[Y, n]


@njit(inline="always")
def _bin_range(low, high, origin, per_bin, count):
    first = int(min(max((low - origin) * per_bin, 0.0), count - 1.0))
    last = int(min(max((high - origin) * per_bin, 0.0), count - 1.0))
    return first, last


@njit
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
def longer(rows):
    """The rows, and as many empty ones."""
    grown = np.empty((2 * rows.shape[0], rows.shape[1]))
    for n in range(rows.shape[0]):
        for m in range(rows.shape[1]):
            grown[n, m] = rows[n, m]
    return grown


@njit
def _corners(landing, cell, level, x, y, image):
    """Landings of the cell's corners at a level and at the one before it; the rectangle about them."""
    for c in range(4):
        vertex = int(cell[c])
        for m in range(2):
            image[0, c, m] = landing[vertex, 2 * level + m]
            image[1, c, m] = landing[vertex, 2 * level - 2 + m] if level > 0 else (x if m == 0 else y)


@njit
def _around(bins, image):
    """The rectangle about the cell's images: x_lo, x_hi, y_lo, y_hi [m]."""
    x_lo, x_hi, y_lo, y_hi = math.inf, -math.inf, math.inf, -math.inf
    for c in range(4):
        for end in range(1 if bins.aligned else 2):
            x_lo, x_hi = min(x_lo, image[end, c, 0]), max(x_hi, image[end, c, 0])
            y_lo, y_hi = min(y_lo, image[end, c, 1]), max(y_hi, image[end, c, 1])
    return x_lo, x_hi, y_lo, y_hi


@njit
def guess_in_cell(bins, layer, start, end, position, wanted, z, image, cell, guesses, count):
    """First guesses for the wanted nodes under one cell; returns (guesses, count).

    `image` (3, 4, 2): landings of the controls (a0, h0), (a0, h1), (a1, h0), (a1, h1) at the layer's `end` and
    at its `start` [m]; the third is scratch.
    """
    corners, before, at = image[0], image[1], image[2]
    x_lo, x_hi, y_lo, y_hi = _around(bins, image)
    room = MARGIN * max(x_hi - x_lo, y_hi - y_lo)
    i_first, i_last = _bin_range(x_lo - room, x_hi + room, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = _bin_range(y_lo - room, y_hi + room, bins.y_lo, bins.per_bin, bins.ny)
    da = cell[ANGLES + 1] - cell[ANGLES]
    dh = cell[HEADINGS + 1] - cell[HEADINGS]
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
                        guesses = longer(guesses)
                    count += 1
                best = outside
                # the triangle's own legs are -da, -dh long in the upper one
                sign = 1.0 - 2.0 * upper
                ga = sign * da / det
                gh = sign * dh / det
                guess = guesses[count - 1]
                guess[NODE] = node
                guess[ANGLE] = cell[ANGLES + upper] + sign * s * da
                guess[HEADING] = cell[HEADINGS + upper] + sign * r * dh
                guess[OUTSIDE] = outside
                guess[INVERSE] = ga * (at[q, 1] - at[o, 1])
                guess[INVERSE + 1] = -ga * (at[q, 0] - at[o, 0])
                guess[INVERSE + 2] = -gh * (at[p, 1] - at[o, 1])
                guess[INVERSE + 3] = gh * (at[p, 0] - at[o, 0])
    return guesses, count


@njit(inline="always")
def _bend(landing, a, b, middle, level):
    """How far [m] a landing lies from the middle of two others."""
    x = landing[middle, 2 * level] - 0.5 * (landing[a, 2 * level] + landing[b, 2 * level])
    y = landing[middle, 2 * level + 1] - 0.5 * (landing[a, 2 * level + 1] + landing[b, 2 * level + 1])
    return math.sqrt(x * x + y * y)


@njit
def _folded(c):
    """Whether the two triangles of a cell are turned opposite ways."""
    low = (c[2, 0] - c[0, 0]) * (c[1, 1] - c[0, 1]) - (c[1, 0] - c[0, 0]) * (c[2, 1] - c[0, 1])
    high = (c[1, 0] - c[3, 0]) * (c[2, 1] - c[3, 1]) - (c[2, 0] - c[3, 0]) * (c[1, 1] - c[3, 1])
    return low * high <= 0.0


@njit
def wants_halving(bins, layer, position, wanted, image, bend):
    """Whether a cell bent by `bend` [m], or folded, has a wanted node within the bend or the fold's reach."""
    folded = _folded(image[0])
    if bend <= BENT and not folded:
        return False
    x_lo, x_hi, y_lo, y_hi = _around(bins, image)
    room = max(bend, 0.25 * max(x_hi - x_lo, y_hi - y_lo)) if folded else bend
    return any_wanted(bins, layer, position, wanted, x_lo - room, x_hi + room, y_lo - room, y_hi + room)


@njit
def fan_guesses(
    flow, polar, steering, bins, position, wanted, direction, backward, x, y, z, t, deepest, dt, horizon, lanes
):  # fmt: skip
    """First guesses for the wanted nodes that (x, y, z) may reach within `horizon` [s], one vertical direction.

    `wanted` (nodes,), all where it is empty; none lies further than `deepest` [m]. With `backward`, those
    that may reach it, and the controls that they would take. Returns (guesses, count).
    """
    guesses = np.empty((256, GUESS_COLUMNS))
    count = np.int64(0)  # not a literal: what takes it is compiled once
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
    rows = np.empty(steering.angles + HORIZON_ROWS)
    rises = np.abs(levels - z)
    if not bins.aligned:
        # the nodes of the first layer may lie as near as they like
        rises[0] = 0.0
    row_count = fan_rows(steering, polar, direction, rises, horizon, rows)
    if row_count == 0:
        return guesses, count
    columns = steering.headings
    vertices = row_count * columns
    vertex = np.empty((4 * vertices, 3))
    landing = np.empty((4 * vertices, 2 * reached))
    for i in range(row_count):
        furthest = vertical_speed(polar, direction, rows[i]) * horizon * (1.0 + 1e-9)
        through = 0
        while through < reached and abs(levels[through] - z) <= furthest:
            through += 1
        for j in range(columns):
            vertex[i * columns + j, 0] = rows[i]
            vertex[i * columns + j, 1] = 2.0 * math.pi * j / columns
            # nodes between levels: one more, to interpolate
            vertex[i * columns + j, 2] = through if bins.aligned else min(through + 1, reached)
    first = np.int64(0)
    land_on_levels(flow, polar, direction, x, y, z, t, levels, vertex, first, vertices, dt, landing, lanes)

    image = np.empty((3, 4, 2))
    cell = np.empty(CELL_COLUMNS)
    cells = np.empty((256, CELL_COLUMNS))
    waiting = 0
    for i in range(row_count - 1):
        for j in range(columns):
            base_cell(rows, columns, i, j, cell)
            bits = 0
            for k in range(int(min(vertex[i * columns, 2], vertex[(i + 1) * columns, 2]))):
                _corners(landing, cell, k, x, y, image)
                bend = base_bend(landing, vertex, rows, row_count, columns, i, j, k)
                if steering.generations > 0 and wants_halving(bins, layers[k], position, wanted, image, bend):
                    bits |= 1 << k
                else:
                    start = levels[k - 1] if k > 0 else z
                    guesses, count = guess_in_cell(
                        bins, layers[k], start, levels[k], position, wanted, z, image, cell, guesses, count
                    )
            if bits:
                if waiting == cells.shape[0]:
                    cells = longer(cells)
                cell[LEVELS] = bits
                cells[waiting] = cell
                waiting += 1
    generation = 0
    done = 0
    while done < waiting:
        generation += 1
        last = waiting
        while vertices + 5 * (last - done) > vertex.shape[0]:
            vertex, landing = longer(vertex), longer(landing)
        for c in range(done, last):
            middles(cells[c], vertex, vertices + 5 * (c - done))
        new = vertices + 5 * (last - done)
        land_on_levels(flow, polar, direction, x, y, z, t, levels, vertex, vertices, new, dt, landing, lanes)
        for c in range(done, last):
            mid = vertices + 5 * (c - done)
            bits = int(cells[c, LEVELS])
            for child in range(4):
                quarter(cells[c], mid, child, cell)
                left = 0
                for k in range(reached):
                    if not (bits >> k) & 1:
                        continue
                    _corners(landing, cell, k, x, y, image)
                    # halving a cell quarters its bend
                    bend = 0.25 * bend_of(landing, cells[c], mid, k)
                    if generation < steering.generations and wants_halving(
                        bins, layers[k], position, wanted, image, bend
                    ):
                        left |= 1 << k
                    else:
                        start = levels[k - 1] if k > 0 else z
                        guesses, count = guess_in_cell(
                            bins, layers[k], start, levels[k], position, wanted, z, image, cell, guesses, count
                        )
                if left:
                    if waiting == cells.shape[0]:
                        cells = longer(cells)
                    cell[LEVELS] = left
                    cells[waiting] = cell
                    waiting += 1
        vertices = new
        done = last
    return guesses, count


@njit
def base_cell(rows, columns, i, j, cell):
    """Cell (i, j) of the base mesh, between rows i, i + 1 and columns j, j + 1."""
    right = (j + 1) % columns
    cell[0], cell[1] = i * columns + j, i * columns + right
    cell[2], cell[3] = cell[0] + columns, cell[1] + columns
    cell[ANGLES], cell[ANGLES + 1] = rows[i], rows[i + 1]
    cell[HEADINGS], cell[HEADINGS + 1] = 2.0 * math.pi * j / columns, 2.0 * math.pi * (j + 1) / columns


@njit
def base_bend(landing, vertex, rows, row_count, columns, i, j, k):
    """The bend [m] of a base cell, from second differences along its sides and its twist."""
    bend = 0.0
    step = rows[i + 1] - rows[i]
    for row in (i, i + 1):
        for side in (j, (j + 1) % columns):
            here = row * columns + side
            before, after = row * columns + (side - 1) % columns, row * columns + (side + 1) % columns
            bend = max(bend, 0.25 * _bend(landing, before, after, here, k))
            up, down = here + columns, here - columns
            if 0 < row < row_count - 1 and k < vertex[down, 2]:
                # rows are uneven: the second derivative times half a step squared, over two
                low, high = rows[row] - rows[row - 1], rows[row + 1] - rows[row]
                x = (landing[up, 2 * k] - landing[here, 2 * k]) / high
                x -= (landing[here, 2 * k] - landing[down, 2 * k]) / low
                y = (landing[up, 2 * k + 1] - landing[here, 2 * k + 1]) / high
                y -= (landing[here, 2 * k + 1] - landing[down, 2 * k + 1]) / low
                bend = max(bend, math.sqrt(x * x + y * y) / (low + high) * step * step / 4.0)
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    x = landing[a, 2 * k] - landing[b, 2 * k] - landing[c, 2 * k] + landing[d, 2 * k]
    y = landing[a, 2 * k + 1] - landing[b, 2 * k + 1] - landing[c, 2 * k + 1] + landing[d, 2 * k + 1]
    return max(bend, 0.25 * math.hypot(x, y))


@njit
def middles(cell, vertex, mid):
    """Controls that halve a cell, into vertices from `mid`: (a0, hm), (am, h0), (am, hm), (am, h1), (a1, hm)."""
    through = 0
    while (int(cell[LEVELS]) >> through) > 0:
        through += 1
    for m in range(5):
        a = 0.0 if m == 0 else (1.0 if m == 4 else 0.5)
        h = 0.0 if m == 1 else (1.0 if m == 3 else 0.5)
        vertex[mid + m, 0] = (1.0 - a) * cell[ANGLES] + a * cell[ANGLES + 1]
        vertex[mid + m, 1] = (1.0 - h) * cell[HEADINGS] + h * cell[HEADINGS + 1]
        vertex[mid + m, 2] = through


@njit
def bend_of(landing, cell, mid, k):
    """The bend [m] of a cell whose middles are landed: along its sides and both diagonals."""
    a, b, c, d = int(cell[0]), int(cell[1]), int(cell[2]), int(cell[3])
    sides = max(_bend(landing, a, b, mid, k), _bend(landing, a, c, mid + 1, k))
    sides = max(sides, _bend(landing, b, d, mid + 3, k), _bend(landing, c, d, mid + 4, k))
    return max(sides, _bend(landing, a, d, mid + 2, k), _bend(landing, b, c, mid + 2, k))


@njit
def quarter(parent, mid, child, cell):
    """Quarter `child` of a cell: 0 to 3, in the order of its corners."""
    for c in range(4):
        # rows and columns of the parent's 3 x 3 vertices, whose corners are its own and the rest its middles
        i, j = child // 2 + c // 2, child % 2 + c % 2
        corner = i % 2 == 0 and j % 2 == 0
        cell[c] = parent[i + j // 2] if corner else mid + 2 * i + j - 1
    for m in range(2):
        i, j = child // 2 + m, child % 2 + m
        cell[ANGLES + m] = (1.0 - 0.5 * i) * parent[ANGLES] + 0.5 * i * parent[ANGLES + 1]
        cell[HEADINGS + m] = (1.0 - 0.5 * j) * parent[HEADINGS] + 0.5 * j * parent[HEADINGS + 1]
