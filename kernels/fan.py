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
from .control import angle_of_vertical_speed, control_towards, vertical_speed
from .flight import FLIGHT_ROWS, LANE_LEFT, advance, fly_to, hangar, place, rest
from .flow import Array, Numbers, cell_size, max_rise, rises
from .motion import LANE_T, LANE_W, LANE_X, LANE_Y, LANE_Z, LANES
from .patch import (
    BENT,
    BENT_SHARE,
    LANDING_COLUMNS,
    MAX_LEVELS,
    Cell,
    Guesses,
    Nodes,
    Slab,
    any_wanted_around,
    complete_corners,
    fill_patch,
    guess_in_patch,
    hold_corners,
    landed_corners,
    longer,
    wants_halving,
)
from .place import Place

VERTEX_ANGLE, VERTEX_HEADING, VERTEX_THROUGH = range(3)
"""Columns of a vertex: its control's magnitude of the angle and heading [rad]; how many levels it flies to."""
CELL_ROW, CELL_COLUMN, CELL_SIZE, CELL_LEVELS = range(4)
"""Columns of a cell: its first corner and its size on the lattice, its levels as bits."""
CORNERS = 9
"""Vertices of a cell that is halved: three by three."""
FAN_VERTEX, FAN_LEVEL = FLIGHT_ROWS, FLIGHT_ROWS + 1
"""Rows of a lane beyond `flight`'s: its vertex, and the level that it flies to."""
FAN_ROWS = FLIGHT_ROWS + 2
BACK_AGAIN = 0.01
"""In a flow that rises a fan of nodes at any depth has a level this far [m] beyond its origin: a control that is
carried the other way at first comes back there, far from the origin."""
IN_TIME = 1.0 + 1e-9
"""A level counts as reached in time up to this multiple of the horizon."""


class FlowMap(NamedTuple):
    """Exact steering: a fan of `angles` x `headings` controls.

    Its cells are halved once, and `generations` times more at most.
    """

    angles: int
    headings: int
    generations: int


class Launch(NamedTuple):
    """The place and time at which the controls of a fan start, their direction, and their steps `dt` [s].

    In a flow that rises a control flies for `longest` [s] at most. `use`: on which ladder, if the flow has two.
    """

    origin: Place
    direction: int
    dt: float
    longest: float
    use: int


class Sweep(NamedTuple):
    """A fan that is looked into: its launch, the `task` that it is for, how far it goes.

    Within `horizon` [s], and to no node that lies further than `deepest` [m]. With `backward`, back in time:
    over the nodes that may reach the origin.
    """

    launch: Launch
    task: int
    backward: bool
    deepest: float
    horizon: float


class Levels(NamedTuple):
    """Levels from a fan's origin on: heights [m], and the layers of nodes. Layer k ends at level k."""

    height: Array
    layer: Numbers


class Mesh(NamedTuple):
    """A fan's vertices, on the finest lattice that there may be.

    `rows` (angles,) the glide angles [rad] of the coarsest mesh, `unit` the size of its cells on the lattice;
    `lattice` says which vertex lies where, -1 where none does; `vertex` (at least all, 3), `landing` (at least
    all, LANDING_COLUMNS levels): the landing at each level.
    """

    rows: Array
    unit: int
    lattice: NDArray[np.int32]
    vertex: Array
    landing: Array


class Look(NamedTuple):
    """What a look into the cells of a fan needs; `patches` (3, 6, 3) and `corners` (CORNERS,) are scratch.

    A cell that is bent by more than `bent` [m] is halved.
    """

    nodes: Nodes
    sweep: Sweep
    levels: Levels
    mesh: Mesh
    patches: Array
    corners: Numbers
    bent: float


@kernel
def outward_of(direction, backward):
    """Return the vertical way of a fan: opposite to its direction if it flies back in time."""
    return 1 - direction if backward else direction


@kernel
def layers_outward(bins, z, outward, deepest, heights, layers):
    """The bins' levels from z outward, as far as `deepest` [m]: heights and layers; returns how many."""
    count = 0
    total = bins.levels.size
    for n in range(total):
        m = n if outward == 1 else total - 1 - n
        level = bins.levels[m]
        if (level <= z) if outward == 1 else (level >= z):
            continue
        heights[count] = level
        layers[count] = m - 1 if outward == 1 and not bins.aligned else m
        count += 1
        if (level >= deepest) if outward == 1 else (level <= deepest):
            break
    return count


@making
def levels_in_reach(medium, bins, sweep):
    """Return the levels that a fan may reach within its horizon."""
    polar, direction, z = medium.polar, sweep.launch.direction, sweep.launch.origin.z
    heights, layers = np.empty(MAX_LEVELS + 1), np.empty(MAX_LEVELS + 1, np.int64)
    outward = outward_of(direction, sweep.backward)
    count = layers_outward(bins, z, outward, sweep.deepest, heights, layers)
    fastest = vertical_speed(polar, direction, polar.steepest[direction]) + max_rise(medium.flow)
    furthest = fastest * sweep.horizon * IN_TIME
    while count > 1 and abs(heights[count - 2] - z) > furthest:
        count -= 1
    if rises(medium.flow) and not bins.aligned and count > 0 and abs(heights[0] - z) > 2.0 * BACK_AGAIN:
        for n in range(count, 0, -1):
            heights[n], layers[n] = heights[n - 1], layers[n - 1]
        heights[0] = z + (2.0 * outward - 1.0) * BACK_AGAIN
        count += 1
    return Levels(heights[:count], layers[:count])


@inlined
def is_extra(levels, k):
    """Return whether level k is the one that a flow that rises adds beside the origin."""
    return k == 0 and levels.layer.size > 1 and levels.layer[0] == levels.layer[1]


@kernel
def fan_rows(polar, direction, slowest, rows):
    """Glide angles of the coarsest mesh's rows, rising, into `rows`; False where no level is in reach.

    From the shallowest with the vertical speed `slowest` [m/s], which reaches a level in time, in even ratios of
    the vertical speed: so a row that just misses a level in time is late by one ratio at most.
    """
    shallow = angle_of_vertical_speed(polar, direction, slowest)
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
def _launch(medium, launch, heights, vertex, one, lanes, n):
    """Start lane n with the control of a vertex, to the first level."""
    c = control_towards(medium.polar, launch.direction, vertex[one, VERTEX_ANGLE], vertex[one, VERTEX_HEADING])
    place(lanes, n, launch.origin, c)
    lanes[FAN_VERTEX, n], lanes[FAN_LEVEL, n] = one, 0.0
    time = (heights[0] - launch.origin.z) / c.w
    fly_to(medium.flow, lanes, n, heights[0], time, launch.longest, launch.dt, launch.use)


@kernel
def land_on_levels(medium, launch, heights, vertex, landing, first, last, lanes):
    """Fly the controls of vertices first..last - 1 through levels, `heights` [m], into rows of `landing`.

    `vertex` and `landing` as in Mesh. Levels against the control's direction fly it back in time, to where it
    would have left to land at the origin: in a steady flow the flow map's inverse.
    """
    following = first
    flying = 0
    for n in range(LANES):
        rest(lanes, n)
        if following < last:
            _launch(medium, launch, heights, vertex, following, lanes, n)
            following += 1
            flying += 1
    while flying > 0:
        advance(medium.flow, lanes)
        for n in range(LANES):
            if lanes[LANE_LEFT, n] > 0.0:
                continue
            one, level = int(lanes[FAN_VERTEX, n]), int(lanes[FAN_LEVEL, n])
            landed = LANDING_COLUMNS * level
            since = abs(lanes[LANE_T, n] - launch.origin.t)
            landing[one, landed], landing[one, landed + 1] = lanes[LANE_X, n], lanes[LANE_Y, n]
            landing[one, landed + 2] = since if lanes[LANE_X, n] == lanes[LANE_X, n] else math.nan
            if level + 1 < vertex[one, VERTEX_THROUGH]:
                lanes[LANE_Z, n] = heights[level]
                lanes[FAN_LEVEL, n] = level + 1
                time = (heights[level + 1] - heights[level]) / lanes[LANE_W, n]
                left = max(launch.longest - since, launch.dt)
                fly_to(medium.flow, lanes, n, heights[level + 1], time, left, launch.dt, launch.use)
            elif following < last:
                _launch(medium, launch, heights, vertex, following, lanes, n)
                following += 1
            else:
                rest(lanes, n)
                flying -= 1


@entry_point()
def landings(medium, launch, height, angle, heading):
    """Return the places x, y (n, 2) [m] where controls `angle` (n,), `heading` (n,) [rad] reach a height [m]."""
    vertex = np.ones((angle.size, 3))
    vertex[:, VERTEX_ANGLE], vertex[:, VERTEX_HEADING] = angle, heading
    landing = np.empty((angle.size, LANDING_COLUMNS))
    first = np.int64(0)
    land_on_levels(medium, launch, np.array([height]), vertex, landing, first, angle.size, hangar(FAN_ROWS))
    return landing[:, :2].copy()


@making
def coarsest_mesh(steering, rows, levels):
    """Return a mesh without vertices."""
    unit = 2 << steering.generations
    lattice = np.full(((rows.size - 1) * unit + 1, steering.headings * unit), -1, np.int32)
    return Mesh(rows, unit, lattice, np.empty((512, 3)), np.empty((512, LANDING_COLUMNS * levels)))


@kernel
def coarsest_cells(medium, bins, sweep, levels, mesh, cells):
    """Write the cells of the coarsest mesh, each with its levels, into `cells`; return their number."""
    direction, z = sweep.launch.direction, sweep.launch.origin.z
    rise = max_rise(medium.flow)
    count = 0
    for i in range(mesh.rows.size - 1):
        # a cell takes part where its steeper row is in time; the other flies on for a ratio longer
        fastest = vertical_speed(medium.polar, direction, mesh.rows[i + 1]) + rise
        furthest = fastest * sweep.horizon * IN_TIME
        through = 0
        while through < levels.height.size and abs(levels.height[through] - z) <= furthest:
            through += 1
        if not bins.aligned:
            # nodes between levels: one more, to interpolate
            through = min(through + 1, levels.height.size)
        for j in range(0, mesh.lattice.shape[1], mesh.unit):
            cell = cells[count]
            cell[CELL_ROW], cell[CELL_COLUMN], cell[CELL_SIZE] = i * mesh.unit, j, mesh.unit
            cell[CELL_LEVELS] = (1 << through) - 1
            count += 1
    return count


@kernel
def corner_of(mesh, cell, corner):
    """Return the place on the lattice of a corner of a halved cell; headings wrap around."""
    half = cell[CELL_SIZE] // 2
    return cell[CELL_ROW] + corner // 3 * half, (cell[CELL_COLUMN] + corner % 3 * half) % mesh.lattice.shape[1]


@kernel
def add_vertices(mesh, cell, new, count):
    """Add the missing vertices of a halved cell and return the count; those from `new` on have not flown yet."""
    top = 0
    while (cell[CELL_LEVELS] >> top) > 0:
        top += 1
    for corner in range(CORNERS):
        i, j = corner_of(mesh, cell, corner)
        one = mesh.lattice[i, j]
        if one < 0:
            mesh.lattice[i, j] = count
            row = min(i // mesh.unit, mesh.rows.size - 2)
            share = i / mesh.unit - row
            mesh.vertex[count, VERTEX_ANGLE] = (1.0 - share) * mesh.rows[row] + share * mesh.rows[row + 1]
            mesh.vertex[count, VERTEX_HEADING] = j * (2.0 * math.pi / mesh.lattice.shape[1])
            mesh.vertex[count, VERTEX_THROUGH] = top
            count += 1
        elif one >= new:
            mesh.vertex[one, VERTEX_THROUGH] = max(mesh.vertex[one, VERTEX_THROUGH], top)
    return count


@kernel
def controls_of_quarter(mesh, cell, quarter, corners):
    """Return the controls of a quarter of a cell."""
    half, turn = cell[CELL_SIZE] // 2, 2.0 * math.pi / mesh.lattice.shape[1]
    low, left = quarter // 2, quarter % 2
    angle = mesh.vertex[corners[3 * low], VERTEX_ANGLE]
    da = mesh.vertex[corners[3 * low + 3], VERTEX_ANGLE] - angle
    return Cell(angle, (cell[CELL_COLUMN] + left * half) * turn, da, half * turn)


@inlined
def fill_patches(look, quarter, k):
    """A quarter's patch at level k and, where nodes lie between levels, at the one before, or at the origin."""
    landing, corners, patches = look.mesh.landing, look.corners, look.patches
    low, left = quarter // 2, quarter % 2
    fill_patch(landing, corners, low, left, k, patches[0])
    if look.nodes.bins.aligned:
        return
    if k > 0:
        fill_patch(landing, corners, low, left, k - 1, patches[1])
    else:
        origin = look.sweep.launch.origin
        patches[1, :, 0], patches[1, :, 1] = origin.x, origin.y
        patches[1, :, 2] = 0.0
        patches[1, 4:] = 0.0


@kernel
def complete_patches(look, quarter, k):
    """Continue a quarter's patches to corners that have not landed; return whether all have a place."""
    landing, corners, patches = look.mesh.landing, look.corners, look.patches
    low, left = quarter // 2, quarter % 2
    if not complete_corners(landing, corners, low, left, k, patches[0]):
        return False
    if look.nodes.bins.aligned or k == 0:
        return True
    return complete_corners(landing, corners, low, left, k - 1, patches[1])


@inlined
def look_into_quarter(look, cell, quarter, may_halve, rows, count):
    """Guesses for the nodes under a quarter of a cell, as `guess_in_patch` has them.

    Not at levels where it is too bent for a guess, if it may be halved: returns those, as bits, and the count.
    """
    controls = controls_of_quarter(look.mesh, cell, quarter, look.corners)
    levels, z = look.levels, look.sweep.launch.origin.z
    bent = 0
    for k in range(levels.height.size):
        if not (cell[CELL_LEVELS] >> k) & 1 or is_extra(levels, k):
            continue
        fill_patches(look, quarter, k)
        landed = landed_corners(look.patches[0])
        if landed < 4:  # a flow that rises carries some of its controls away
            if not look.nodes.bins.aligned:
                # it may turn them back within the layer
                landed = hold_corners(look.patches)
            if may_halve and landed > 0 and any_wanted_around(look.nodes, levels.layer[k], look.patches):
                bent |= 1 << k
                continue
            if landed < 4 and not complete_patches(look, quarter, k):
                continue
        if may_halve and wants_halving(look.nodes, levels.layer[k], look.patches, look.bent):
            bent |= 1 << k
            continue
        slab = Slab(levels.layer[k], levels.height[k - 1] if k > 0 else z, levels.height[k])
        count = guess_in_patch(look.nodes, slab, z, controls, look.patches, look.sweep.task, rows, count)
    return bent, count


@kernel
def look_into_cell(look, cell, may_halve, quarters, rows, count):
    """Look into the quarters of a cell; those that are too bent into `quarters` (4, 4).

    Returns how many of them there are, and of guesses.
    """
    for corner in range(CORNERS):
        i, j = corner_of(look.mesh, cell, corner)
        look.corners[corner] = look.mesh.lattice[i, j]
    half = cell[CELL_SIZE] // 2
    waiting = 0
    for quarter in range(4):
        bent, count = look_into_quarter(look, cell, quarter, may_halve, rows, count)
        if bent:
            quarters[waiting, CELL_ROW] = cell[CELL_ROW] + quarter // 2 * half
            quarters[waiting, CELL_COLUMN] = cell[CELL_COLUMN] + quarter % 2 * half
            quarters[waiting, CELL_SIZE], quarters[waiting, CELL_LEVELS] = half, bent
            waiting += 1
    return waiting, count


@inlined
def look_into_cells(look, cells, first, last, may_halve, guesses):
    """Look into cells first..last - 1: (cells, how many there are now, guesses).

    Quarters that are too bent join the cells, to be halved in their turn.
    """
    rows, known = guesses
    waiting = last
    for c in range(first, last):
        if waiting + 4 > cells.shape[0]:
            cells = longer(cells, waiting + 4)
        more, count = look_into_cell(look, cells[c], may_halve, cells[waiting : waiting + 4], rows, known)
        if count >= rows.shape[0]:
            rows = longer(rows, count + 1)
            more, count = look_into_cell(look, cells[c], may_halve, cells[waiting : waiting + 4], rows, known)
        waiting, known = waiting + more, count
    return cells, waiting, Guesses(rows, known)


@inlined
def fan_guesses(medium, steering, nodes, sweep, guesses, lanes):
    """First guesses for the wanted nodes that a sweep may pass over, added to the guesses that are there.

    One generation of cells after another: their vertices fly, then their quarters are looked into.
    """
    levels = levels_in_reach(medium, nodes.bins, sweep)
    launch, reached = sweep.launch, levels.height.size
    if reached == 0:
        return guesses
    rows = np.empty(steering.angles)
    # between levels, the nodes of the first layer may lie as near as they like
    nearest = abs(levels.height[0] - launch.origin.z) if nodes.bins.aligned else 0.0
    slowest = nearest / sweep.horizon - max_rise(medium.flow)
    if not fan_rows(medium.polar, launch.direction, slowest, rows):
        return guesses
    mesh = coarsest_mesh(steering, rows, reached)
    cells = np.empty((rows.size * steering.headings, 4), np.int64)
    patches, corners = np.empty((3, 6, 3)), np.empty(CORNERS, np.int64)
    waiting = coarsest_cells(medium, nodes.bins, sweep, levels, mesh, cells)
    done, vertices, generation = 0, 0, 0
    bent = max(BENT, BENT_SHARE * cell_size(medium.flow))
    while done < waiting:
        most = vertices + CORNERS * (waiting - done)
        vertex, landing = longer(mesh.vertex, most), longer(mesh.landing, most)
        mesh = Mesh(rows, mesh.unit, mesh.lattice, vertex, landing)
        new = vertices
        for c in range(done, waiting):
            vertices = add_vertices(mesh, cells[c], new, vertices)
        land_on_levels(medium, launch, levels.height, vertex, landing, new, vertices, lanes)
        look = Look(nodes, sweep, levels, mesh, patches, corners, bent)
        first, done = done, waiting
        may_halve = generation < steering.generations
        cells, waiting, guesses = look_into_cells(look, cells, first, done, may_halve, guesses)
        generation += 1
    return guesses
