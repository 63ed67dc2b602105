"""Patches of a flow map: the image of a cell of controls at a depth, and the controls of nodes under it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cache import inlined, kernel, making
from .flow import Array, Numbers

GUESS_TASK, GUESS_NODE, GUESS_ANGLE, GUESS_HEADING, GUESS_OUTSIDE, GUESS_INVERSE = range(6)
"""Columns of a guess: the task it is for, node, glide angle and heading [rad], how far outside its cell, in the
cell's own units, and from GUESS_INVERSE on d(angle, heading) / d(x, y), row by row."""
GUESS_TIME = 10
"""How long its leg takes [s], by the flow map: where the flow has no vertical part, the angle says it better."""
GUESS_COLUMNS = 11
LANDING_COLUMNS = 3
"""Of each vertex and level: x, y [m], and the time since the launch [s], NaN where the level is not reached."""
ALONG_ANGLE, ALONG_HEADING = 4, 5
"""Rows of a patch, after the landings of its four corners: its second derivatives, in the cell's own units, 0
where a landing beyond the patch is missing."""
BENT = 8.0
"""A cell whose middle lies this far [m] from its linear image is halved."""
BENT_SHARE = 0.005
"""In a file's grid it may lie as far as this share of a cell of the file: guesses know the bend, and in a part of
such a cell it hardly changes."""
MARGIN = 0.35
"""A target this far outside a triangle, in its own units, is a guess where none is inside."""
BESIDE_LANDED = 50.0
"""A cell of which some corners do not land is halved where a wanted node is this near [m] to those that do."""
MAX_LEVELS = 32
"""A fan lands on at most this many depths, because the levels of a cell are bits of a number."""


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
    first: Numbers
    node: Numbers


class Nodes(NamedTuple):
    """Nodes `position` (n, 3) [m], in bins; `wanted` (n,): those that are looked for, all where it is empty."""

    position: Array
    bins: NodeBins
    wanted: NDArray[np.bool_]


class Guesses(NamedTuple):
    """First guesses of controls: the first `filled` of `rows` (more than those, GUESS_COLUMNS)."""

    rows: Array
    filled: int


class Box(NamedTuple):
    """A rectangle [m]."""

    x_lo: float
    x_hi: float
    y_lo: float
    y_hi: float


class Cell(NamedTuple):
    """Controls from `angle` to `angle` + `da` and from `heading` to `heading` + `dh` [rad]."""

    angle: float
    heading: float
    da: float
    dh: float


class Slab(NamedTuple):
    """The `layer` of nodes between the heights `start` and `end` [m], which a fan passes in this order."""

    layer: int
    start: float
    end: float


@inlined
def bin_range(low, high, origin, per_bin, count):
    """The bins of one axis that hold low..high [m]: the first and the last, the outermost ones at least."""
    first = int(min(max((low - origin) * per_bin, 0.0), count - 1.0))
    last = int(min(max((high - origin) * per_bin, 0.0), count - 1.0))
    return first, last


@inlined
def is_wanted(nodes, node):
    """Return whether a node is wanted."""
    return nodes.wanted.size == 0 or nodes.wanted[node]


@kernel
def any_wanted(nodes, layer, box):
    """Return whether a wanted node of the layer lies in a box."""
    bins, position = nodes.bins, nodes.position
    i_first, i_last = bin_range(box.x_lo, box.x_hi, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = bin_range(box.y_lo, box.y_hi, bins.y_lo, bins.per_bin, bins.ny)
    for i in range(i_first, i_last + 1):
        row = (layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            x, y = position[node, 0], position[node, 1]
            if box.x_lo <= x <= box.x_hi and box.y_lo <= y <= box.y_hi and is_wanted(nodes, node):
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


@inlined
def wider(box, room):
    """Return the box extended by a margin [m] on every side."""
    return Box(box.x_lo - room, box.x_hi + room, box.y_lo - room, box.y_hi + room)


@making
def longer(rows, needed):
    """The rows, and empty ones: twice as many, or as many as are needed."""
    if needed <= rows.shape[0]:
        return rows
    grown = np.empty((max(2 * rows.shape[0], needed), rows.shape[1]), rows.dtype)
    grown[: rows.shape[0]] = rows
    return grown


@kernel
def fill_patch(landing, corners, i, j, level, patch):
    """Quarter (i, j) of a cell at a level: landings of its corners, and its second derivatives.

    `corners` (9,): the vertices of the cell, halved. Of second derivatives the mean of both sides.
    """
    first = LANDING_COLUMNS * level
    for c in range(4):
        patch[c, 2] = landing[corners[3 * (i + c // 2) + j + c % 2], first + 2]
    for m in range(2):
        at = first + m
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
        patch[ALONG_ANGLE, m] = 0.5 * along_angle if along_angle == along_angle else 0.0
        patch[ALONG_HEADING, m] = 0.5 * along_heading if along_heading == along_heading else 0.0


@kernel
def landed_corners(patch):
    """Return how many of a patch's four corners have landed."""
    count = 0
    for c in range(4):
        count += not math.isnan(patch[c, 2])
    return count


@kernel
def hold_corners(patches):
    """Put corners of a patch that have not landed where they were a level before; return how many have one."""
    for c in range(4):
        if math.isnan(patches[0, c, 2]):
            for m in range(3):
                patches[0, c, m] = patches[1, c, m]
    return landed_corners(patches[0])


@kernel
def complete_corners(landing, corners, i, j, level, patch):
    """Continue quarter (i, j) of a halved cell to corners that have not landed; return whether all have a place.

    By the other three corners, or along a side by a vertex beyond.
    """
    landed = 0
    for c in range(4):
        landed |= (not math.isnan(patch[c, 2])) << c
    for c in range(4):
        if landed >> c & 1:
            continue
        beside, along = landed >> (c ^ 1) & 1, landed >> (c ^ 2) & 1
        row, column = i + c // 2, j + c % 2
        for m in range(3):
            at = LANDING_COLUMNS * level + m
            if beside and along and landed >> (3 - c) & 1:
                patch[c, m] = patch[c ^ 1, m] + patch[c ^ 2, m] - patch[3 - c, m]
            elif along and row != 1:
                patch[c, m] = 2.0 * patch[c ^ 2, m] - landing[corners[3 * (2 - row) + column], at]
            elif beside and column != 1:
                patch[c, m] = 2.0 * patch[c ^ 1, m] - landing[corners[3 * row + 2 - column], at]
    return landed_corners(patch) == 4


@kernel
def _around(bins, patches):
    """The box about a patch, and about its start where nodes lie between."""
    x_lo, x_hi, y_lo, y_hi = math.inf, -math.inf, math.inf, -math.inf
    for end in range(1 if bins.aligned else 2):
        for c in range(4):
            x_lo, x_hi = min(x_lo, patches[end, c, 0]), max(x_hi, patches[end, c, 0])
            y_lo, y_hi = min(y_lo, patches[end, c, 1]), max(y_hi, patches[end, c, 1])
    return Box(x_lo, x_hi, y_lo, y_hi)


@kernel
def _bend(p):
    """Return how far [m] a patch is from flat: the greatest distance of its middle lines from a linear image."""
    x = p[0, 0] - p[1, 0] - p[2, 0] + p[3, 0]
    y = p[0, 1] - p[1, 1] - p[2, 1] + p[3, 1]
    twist = 0.25 * math.sqrt(x * x + y * y)
    along_angle = math.sqrt(p[ALONG_ANGLE, 0] ** 2 + p[ALONG_ANGLE, 1] ** 2) / 8.0
    return max(twist, along_angle, math.sqrt(p[ALONG_HEADING, 0] ** 2 + p[ALONG_HEADING, 1] ** 2) / 8.0)


@kernel
def _folded(p):
    """Return whether the two triangles of a patch have opposite orientations."""
    low = (p[2, 0] - p[0, 0]) * (p[1, 1] - p[0, 1]) - (p[1, 0] - p[0, 0]) * (p[2, 1] - p[0, 1])
    high = (p[1, 0] - p[3, 0]) * (p[2, 1] - p[3, 1]) - (p[2, 0] - p[3, 0]) * (p[1, 1] - p[3, 1])
    return low * high <= 0.0


@kernel
def wants_halving(nodes, layer, patches, bent):
    """Whether a patch that is bent by more than `bent` [m] or folded has a wanted node within reach of that."""
    bend = _bend(patches[0])
    folded = _folded(patches[0])
    if bend <= bent and not folded:
        return False
    box = _around(nodes.bins, patches)
    room = max(bend, 0.25 * max(box.x_hi - box.x_lo, box.y_hi - box.y_lo)) if folded else bend
    return any_wanted(nodes, layer, wider(box, room))


@kernel
def any_wanted_around(nodes, layer, patches):
    """Return whether a wanted node lies near those corners of a patch that have landed."""
    p = patches[0]
    box = Box(math.inf, -math.inf, math.inf, -math.inf)
    for c in range(4):
        if not math.isnan(p[c, 2]):
            box = Box(
                min(box.x_lo, p[c, 0]), max(box.x_hi, p[c, 0]), min(box.y_lo, p[c, 1]), max(box.y_hi, p[c, 1])
            )
    size = max(box.x_hi - box.x_lo, box.y_hi - box.y_lo)
    return any_wanted(nodes, layer, wider(box, max(size, BESIDE_LANDED)))


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


@inlined
def _in_triangles(p, x, y):
    """Where (x, y) lies in the nearer of a patch's two triangles: s, r, and how far outside, in its own units."""
    # lower triangle at corner 0, upper one at corner 3, their legs along angle and heading
    s, r, low = _inside(p[0, 0], p[0, 1], p[2, 0], p[2, 1], p[1, 0], p[1, 1], x, y)
    outside = max(0.0, -s, -r, s + r - 1.0) if low != 0.0 else math.inf
    back_s, back_r, high = _inside(p[3, 0], p[3, 1], p[1, 0], p[1, 1], p[2, 0], p[2, 1], x, y)
    beyond = max(0.0, -back_s, -back_r, back_s + back_r - 1.0) if high != 0.0 else math.inf
    if beyond < outside:
        return 1.0 - back_s, 1.0 - back_r, beyond
    return s, r, outside


@kernel
def _guess(p, x, y, cell, rows, at):
    """Write into rows[at] the cell's control that lands on (x, y) by its patch; False if too far outside."""
    s, r, outside = _in_triangles(p, x, y)
    if outside > MARGIN:
        return False
    s_2, r_2, x_s, x_r, y_s, y_r = _solve(p, x, y, s, r)
    if abs(s_2 - s) + abs(r_2 - r) < 1.0:
        s, r = s_2, r_2
    else:
        x_s, x_r, y_s, y_r = p[2, 0] - p[0, 0], p[1, 0] - p[0, 0], p[2, 1] - p[0, 1], p[1, 1] - p[0, 1]
    det = x_s * y_r - x_r * y_s
    if det == 0.0:
        return False
    guess = rows[at]
    guess[GUESS_OUTSIDE] = outside
    steeper, shallower = p[2, 2] + r * (p[3, 2] - p[2, 2]), p[0, 2] + r * (p[1, 2] - p[0, 2])
    guess[GUESS_TIME] = shallower + s * (steeper - shallower)
    guess[GUESS_ANGLE], guess[GUESS_HEADING] = cell.angle + s * cell.da, cell.heading + r * cell.dh
    guess[GUESS_INVERSE], guess[GUESS_INVERSE + 1] = cell.da * y_r / det, -cell.da * x_r / det
    guess[GUESS_INVERSE + 2], guess[GUESS_INVERSE + 3] = -cell.dh * y_s / det, cell.dh * x_s / det
    return True


@kernel
def _blend(patches, share):
    """The third patch, `share` of the way from the second, at a slab's start, to the first, at its end."""
    for c in range(4):
        patches[2, c, 2] = patches[1, c, 2] + share * (patches[0, c, 2] - patches[1, c, 2])
    for c in range(6):
        for m in range(2):
            patches[2, c, m] = patches[1, c, m] + share * (patches[0, c, m] - patches[1, c, m])


@kernel
def guess_in_patch(nodes, slab, z, cell, patches, task, rows, count):
    """First guesses for the wanted nodes under a patch, into `rows` from `count` on; how many there are now.

    Where there is no room they are only counted, and the last row is spoilt. `patches` (3, 6, 3): the cell's
    patch at the slab's end and at its start; the third is scratch. `z` [m] is the height of the fan.
    """
    bins, position = nodes.bins, nodes.position
    p = patches[0 if bins.aligned else 2]
    box = _around(bins, patches)
    box = wider(box, MARGIN * max(box.x_hi - box.x_lo, box.y_hi - box.y_lo))
    i_first, i_last = bin_range(box.x_lo, box.x_hi, bins.x_lo, bins.per_bin, bins.nx)
    j_first, j_last = bin_range(box.y_lo, box.y_hi, bins.y_lo, bins.per_bin, bins.ny)
    for i in range(i_first, i_last + 1):
        row = (slab.layer * bins.nx + i) * bins.ny
        for k in range(bins.first[row + j_first], bins.first[row + j_last + 1]):
            node = bins.node[k]
            x, y, height = position[node, 0], position[node, 1], position[node, 2]
            if x < box.x_lo or x > box.x_hi or y < box.y_lo or y > box.y_hi:
                continue
            share = (height - slab.start) / (slab.end - slab.start)
            if height == z or share < 0.0 or share > 1.0 or not is_wanted(nodes, node):
                continue
            if not bins.aligned:
                _blend(patches, share)
            at = min(count, rows.shape[0] - 1)
            if _guess(p, x, y, cell, rows, at):
                rows[at, GUESS_TASK], rows[at, GUESS_NODE] = task, node
                count += 1
    return count
