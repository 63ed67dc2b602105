"""Flows: the current (u, v, w) [m/s] at (x, y, z) [m] and time t [s]; w is upward, and zero in most flows.

A flow is a NamedTuple; `velocity(flow, x, y, z, t)` reads its horizontal part, `current` all of it. They dispatch
on the tuple's class, at compile time inside kernels: what each class can do stands in ABILITIES. The last field
of every class is its `extent`; a class with a vertical part has `max_rise` before it.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cache import entry_point, in_kernels, inlined, kernel
from .interpolate import pair_between, row_between

JUST_BELOW = 1.0 - 2.0**-52
"""A factor just below 1: it puts the last point of a grid into the cell before that point."""

ROUNDING = 1e-9
"""A quick look at a box is this much stricter, in grid indices, than a look at a place, which is rounded."""

ON_RUNG = 1e-6
"""A flight that is this near [m] to a rung has reached it."""
NEARLY = 1.0 + 1e-6
"""A flight whose end lies beyond the next rung by less than this share of a step ends with that step."""
LEGS, FANS = 0, 1
"""The two ladders of a flow."""

Array = NDArray[np.float64]
Index = NDArray[np.uintp]
Slot = tuple[np.uintp, float]
"""The number of a level or time of a grid, and the weight of the next one."""
Numbers = NDArray[np.int64]
"""Numbers of nodes and pairs, and the positions where rows begin."""


class Extent(NamedTuple):
    """The box [m] and the time span [s] in which a flow is known.

    And an upper bound `max_speed` [m/s] of its speed there, and `length_scale` [m], over which it varies.
    """

    x_lo: float
    x_hi: float
    y_lo: float
    y_hi: float
    t_lo: float
    t_hi: float
    max_speed: float
    length_scale: float


class Ladder(NamedTuple):
    """The heights at which steps end in a file's currents, its rungs: between them the currents bend little.

    `rungs` (2, levels + 1, 2) [m]: for legs, and for fans; from below the lowest level, above it, ..., above the
    last one: the next rung downward and upward. A step of a leg lasts `longest` [s] at most, or as
    an even step if that is longer; 0 where there is no ladder, and steps are even. The bends that its steps pass
    over move a leg's end by `shift` [m^2/s] over its vertical speed at most.
    """

    rungs: Array
    longest: float
    shift: float


NO_LADDER = Ladder(np.zeros((2, 0, 2)), 0.0, 0.0)
"""The ladder of a flow in which all steps are even."""


class Uniform(NamedTuple):
    """The same current everywhere: u, v [m/s]."""

    u: float
    v: float
    extent: Extent


class Vortices(NamedTuple):
    """A sum of Gaussian vortices with a Gaussian depth profile; arrays of shape (n,)."""

    x: Array
    y: Array
    radius: Array
    speed: Array
    depth: Array
    thickness: Array
    extent: Extent


class Gyre(NamedTuple):
    """Shadden's double gyre, steady where epsilon is 0; a single gyre is half of it."""

    x_origin: float
    y_origin: float
    length: float
    amplitude: float
    epsilon: float
    period: float
    extent: Extent


class Rankine(NamedTuple):
    """A Rankine vortex: solid rotation within `radius` [m], 1/r outside, `speed` [m/s] at the rim."""

    x: float
    y: float
    radius: float
    speed: float
    extent: Extent


class Jet(NamedTuple):
    """A uniform jet along x: `speed` [m/s] within `width` [m] about `y`, still water outside."""

    y: float
    width: float
    speed: float
    extent: Extent


class MovingVortices(NamedTuple):
    """Vortices whose centres move evenly; arrays of shape (n,). `x`, `y` [m] are the places at t = 0."""

    x: Array
    y: Array
    radius: Array
    speed: Array
    depth: Array
    thickness: Array
    drift_x: Array
    drift_y: Array
    extent: Extent


class TidalJet(NamedTuple):
    """A jet along x that turns with the tide: `speed` [m/s] in the middle at time `peak` [s]."""

    y: float
    width: float
    speed: float
    period: float
    peak: float
    extent: Extent


class Grid(NamedTuple):
    """A steady field on a regular grid, trilinear: values (levels, nx, ny, 2) [m/s], z upward.

    `level_speed` (levels,) [m/s]: the greatest speed at each level; `level_carry` its integral over height.
    """

    values: Array
    level_speed: Array
    level_carry: Array
    per_x: float
    per_y: float
    z_first: float
    per_z: float
    extent: Extent


class OceanGrid(NamedTuple):
    """A field on a mapped grid with its own levels and times, linear in each.

    values (times, levels, ni, nj, 2) [m/s]; levels [m] rising, held beyond the ends; times [s] rising.
    `index_map` (mx, my, 2) holds the fractional grid indices (i, j) at regular points of the local frame,
    spaced 1/per_x, 1/per_y [m] from (x_lo, y_lo): bilinear between them, so that the file's own grid is
    read without resampling. `level_slot` and `time_slot` hold, for even slots of z and t, the last index
    at or below the slot's start; a slot is never wider than the smallest spacing.
    """

    values: Array
    levels: Array
    level_slot: Index
    slots_per_z: float
    times: Array
    time_slot: Index
    slots_per_t: float
    index_map: Array
    per_x: float
    per_y: float
    ladder: Ladder
    extent: Extent


class Upwelling(NamedTuple):
    """A current u, v, w [m/s] that stretches: u falls by `stretch` [1/s] along x from `x` on, w grows with z."""

    u: float
    v: float
    w: float
    x: float
    stretch: float
    max_rise: float
    extent: Extent


class Rolls(NamedTuple):
    """Cells that turn about axes along y, side by side along x, and move along x at `drift` [m/s].

    w = -`w` cos(k (x - `x` - drift t)) sin(m z), with `across` k and `down` m [1/m]; u by continuity.
    """

    x: float
    w: float
    across: float
    down: float
    drift: float
    max_rise: float
    extent: Extent


class Abc(NamedTuple):
    """The flow of Arnold, Beltrami and Childress: `a`, `b`, `c` [m/s], waves of `number` [1/m]."""

    a: float
    b: float
    c: float
    number: float
    max_rise: float
    extent: Extent


class RisingGrid(NamedTuple):
    """A `Grid` with a vertical part: values (levels, nx, ny, 4) [m/s], which are u, v, w and nothing."""

    values: Array
    per_x: float
    per_y: float
    z_first: float
    per_z: float
    max_rise: float
    extent: Extent


class RisingOceanGrid(NamedTuple):
    """An `OceanGrid` with a vertical part: values (times, levels, ni, nj, 4) [m/s], u, v, w and nothing.

    `levels` [m] are those of u and v and those of w together: linear between, each part is read as on its own.
    """

    values: Array
    levels: Array
    level_slot: Index
    slots_per_z: float
    times: Array
    time_slot: Index
    slots_per_t: float
    index_map: Array
    per_x: float
    per_y: float
    max_rise: float
    extent: Extent


Level = Uniform | Vortices | MovingVortices | Gyre | Rankine | Jet | TidalJet | Grid | OceanGrid
Rising = Upwelling | Rolls | Abc | RisingGrid | RisingOceanGrid
Flow = Level | Rising


def _uniform(flow, x, y, z, t):
    return flow.u, flow.v


def _vortices(flow, x, y, z, t):
    u = 0.0
    v = 0.0
    for n in range(flow.x.size):
        dx = x - flow.x[n]
        dy = y - flow.y[n]
        radius = flow.radius[n]
        dz = (-z - flow.depth[n]) / flow.thickness[n]
        # psi = s R sqrt(e) exp(-r^2 / 2R^2) exp(-dz^2);  u = d psi/dy, v = -d psi/dx
        spin = flow.speed[n] / radius * math.exp(0.5 - 0.5 * (dx * dx + dy * dy) / (radius * radius) - dz * dz)
        u -= spin * dy
        v += spin * dx
    return u, v


def _moving_vortices(flow, x, y, z, t):
    u = 0.0
    v = 0.0
    for n in range(flow.x.size):
        dx = x - flow.x[n] - t * flow.drift_x[n]
        dy = y - flow.y[n] - t * flow.drift_y[n]
        radius = flow.radius[n]
        dz = (-z - flow.depth[n]) / flow.thickness[n]
        spin = flow.speed[n] / radius * math.exp(0.5 - 0.5 * (dx * dx + dy * dy) / (radius * radius) - dz * dz)
        u -= spin * dy
        v += spin * dx
    return u, v


def _gyre(flow, x, y, z, t):
    # psi = A sin(pi f(x, t)) sin(pi y), f = a x^2 + (1 - 2a) x, a = epsilon sin(2 pi t / T); u = -d psi/dy
    a = flow.epsilon * math.sin(2.0 * math.pi * t / flow.period)
    along = (x - flow.x_origin) / flow.length
    across = math.pi * (y - flow.y_origin) / flow.length
    f = math.pi * (a * along + 1.0 - 2.0 * a) * along
    u = -math.pi * flow.amplitude * math.sin(f) * math.cos(across)
    v = math.pi * flow.amplitude * math.cos(f) * math.sin(across) * (2.0 * a * (along - 1.0) + 1.0)
    return u, v


def _rankine(flow, x, y, z, t):
    dx = x - flow.x
    dy = y - flow.y
    spin = flow.speed * flow.radius / max(flow.radius * flow.radius, dx * dx + dy * dy)
    return -spin * dy, spin * dx


def _jet(flow, x, y, z, t):
    inside = abs(y - flow.y) <= 0.5 * flow.width
    return flow.speed if inside else 0.0, 0.0


def _tidal_jet(flow, x, y, z, t):
    # u = s cos(2 pi (t - peak) / T) exp(-(2 (y - y_0) / width)^2)
    off = 2.0 * (y - flow.y) / flow.width
    return flow.speed * math.cos(2.0 * math.pi * (t - flow.peak) / flow.period) * math.exp(-off * off), 0.0


@inlined
def _cell(at, count):
    """Return the cell below a fractional index, kept within the grid, and the weight of its upper end."""
    # NaN (a step that left the grid) must not become an address: the comparisons send it to 0
    held = at if at > 0.0 else 0.0
    last = (count - 1.0) * JUST_BELOW
    held = held if held < last else last
    below = np.intp(held)
    return np.uintp(below), held - below


@inlined
def _slot(at, points, slots, slots_per_unit):
    """Return the same as `_cell` for uneven points: an even slot leads to the cell, a comparison decides."""
    last = np.intp(points.size) - 1
    held = at if at > points[0] else points[0]
    held = held if held < points[last] else points[last]
    slot = np.uintp(min(np.intp((held - points[0]) * slots_per_unit), np.intp(slots.size) - 1))
    below = np.intp(slots[slot])
    below = min(below + (1 if held >= points[np.uintp(below + 1)] else 0), last - 1)
    start = points[np.uintp(below)]
    return np.uintp(below), (held - start) / (points[np.uintp(below + 1)] - start)


def _grid(flow, x, y, z, t):
    values = flow.values
    k, c = _cell((z - flow.z_first) * flow.per_z, values.shape[0])
    i, a = _cell((x - flow.extent.x_lo) * flow.per_x, values.shape[1])
    j, b = _cell((y - flow.extent.y_lo) * flow.per_y, values.shape[2])
    return pair_between(values, (k, i, j), (c, a, b))


@inlined
def grid_index(index_map, x, y, x_lo, y_lo, per_x, per_y):
    """Return fractional grid indices (i, j) at (x, y) [m], from a map that `OceanGrid` describes."""
    p, a = _cell((x - x_lo) * per_x, index_map.shape[0])
    q, b = _cell((y - y_lo) * per_y, index_map.shape[1])
    return pair_between(index_map, (p, q), (a, b))


@kernel
def index_ranges(index_map, x_lo, x_hi, y_lo, y_hi, from_x, from_y, per_x, per_y):
    """Return the least and greatest fractional indices in a box [m]: i_lo, i_hi, j_lo, j_hi; see `grid_index`.

    Between the map's points the indices are bilinear, so they are greatest and least at corners of the pieces
    into which these points cut the box.
    """
    p_last, q_last = index_map.shape[0] - 1.0, index_map.shape[1] - 1.0
    p_lo, p_hi = min(max((x_lo - from_x) * per_x, 0.0), p_last), min(max((x_hi - from_x) * per_x, 0.0), p_last)
    q_lo, q_hi = min(max((y_lo - from_y) * per_y, 0.0), q_last), min(max((y_hi - from_y) * per_y, 0.0), q_last)
    i_lo, i_hi, j_lo, j_hi = math.inf, -math.inf, math.inf, -math.inf
    at_p, next_p = p_lo, math.floor(p_lo) + 1.0
    while True:
        p, a = _cell(at_p, index_map.shape[0])
        at_q, next_q = q_lo, math.floor(q_lo) + 1.0
        while True:
            q, b = _cell(at_q, index_map.shape[1])
            i, j = pair_between(index_map, (p, q), (a, b))
            i_lo, i_hi, j_lo, j_hi = min(i_lo, i), max(i_hi, i), min(j_lo, j), max(j_hi, j)
            if at_q >= q_hi:
                break
            at_q, next_q = min(next_q, q_hi), next_q + 1.0
        if at_p >= p_hi:
            break
        at_p, next_p = min(next_p, p_hi), next_p + 1.0
    return i_lo, i_hi, j_lo, j_hi


def _index_on_map(flow, x, y):
    return grid_index(flow.index_map, x, y, flow.extent.x_lo, flow.extent.y_lo, flow.per_x, flow.per_y)


def _on_levels(flow, z):
    return _slot(z, flow.levels, flow.level_slot, flow.slots_per_z)


def _on_times(flow, t):
    return _slot(t, flow.times, flow.time_slot, flow.slots_per_t)


def _at_index(flow, at_i, at_j, level, time):
    values = flow.values
    i, a = _cell(at_i, values.shape[2])
    j, b = _cell(at_j, values.shape[3])
    (k, c), (n, d) = level, time
    return pair_between(values, (n, k, i, j), (d, c, a, b))


def _at_index_once(flow, at_i, at_j, level):
    values = flow.values
    i, a = _cell(at_i, values.shape[2])
    j, b = _cell(at_j, values.shape[3])
    k, c = level
    return pair_between(values, (np.uintp(0), k, i, j), (c, a, b))


def _ocean_grid(flow, x, y, z, t):
    at_i, at_j = index_on_map(flow, x, y)
    return at_index(flow, at_i, at_j, on_levels(flow, z), on_times(flow, t))


def _upwelling(flow, x, y, z, t):
    return flow.u - flow.stretch * (x - flow.x), flow.v, flow.w + flow.stretch * z


def _rolls(flow, x, y, z, t):
    # psi = -(w / k) sin(k x') sin(m z), u = -d psi/dz, w = d psi/dx
    along = flow.across * (x - flow.x - flow.drift * t)
    below = flow.down * z
    u = flow.w * flow.down / flow.across * math.sin(along) * math.cos(below)
    return u, 0.0, -flow.w * math.cos(along) * math.sin(below)


def _abc(flow, x, y, z, t):
    kx, ky, kz = flow.number * x, flow.number * y, flow.number * z
    u = flow.a * math.sin(kz) + flow.c * math.cos(ky)
    v = flow.b * math.sin(kx) + flow.a * math.cos(kz)
    return u, v, flow.c * math.sin(ky) + flow.b * math.cos(kx)


def _rising_grid(flow, x, y, z, t):
    values = flow.values
    k, c = _cell((z - flow.z_first) * flow.per_z, values.shape[0])
    i, a = _cell((x - flow.extent.x_lo) * flow.per_x, values.shape[1])
    j, b = _cell((y - flow.extent.y_lo) * flow.per_y, values.shape[2])
    u, v, w, _ = row_between(values, (k, i, j), (c, a, b))
    return u, v, w


def _rising_ocean_grid(flow, x, y, z, t):
    values = flow.values
    at_i, at_j = grid_index(flow.index_map, x, y, flow.extent.x_lo, flow.extent.y_lo, flow.per_x, flow.per_y)
    i, a = _cell(at_i, values.shape[2])
    j, b = _cell(at_j, values.shape[3])
    k, c = _slot(z, flow.levels, flow.level_slot, flow.slots_per_z)
    n, d = _slot(t, flow.times, flow.time_slot, flow.slots_per_t)
    u, v, w, _ = row_between(values, (n, k, i, j), (d, c, a, b))
    return u, v, w


def _across(flow, x, y, z, t):
    u, v, _ = current(flow, x, y, z, t)
    return u, v


def _level_current(flow, x, y, z, t):
    u, v = velocity(flow, x, y, z, t)
    return u, v, 0.0


def _in_box(flow, x, y, t):
    known = flow.extent
    return known.x_lo <= x <= known.x_hi and known.y_lo <= y <= known.y_hi and known.t_lo <= t <= known.t_hi


def _in_ocean_grid(flow, x, y, t):
    known = flow.extent
    i, j = grid_index(flow.index_map, x, y, known.x_lo, known.y_lo, flow.per_x, flow.per_y)
    in_box = known.x_lo <= x <= known.x_hi and known.y_lo <= y <= known.y_hi and known.t_lo <= t <= known.t_hi
    return in_box and 0.0 <= i <= flow.values.shape[2] - 1 and 0.0 <= j <= flow.values.shape[3] - 1


def _box_in_box(flow, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi):
    return _in_extent(flow.extent, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi)


@kernel
def _in_extent(known, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi):
    across = known.x_lo <= x_lo and x_hi <= known.x_hi and known.y_lo <= y_lo and y_hi <= known.y_hi
    return across and known.t_lo <= t_lo and t_hi <= known.t_hi


def _box_in_ocean_grid(flow, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi):
    known = flow.extent
    if not _in_extent(known, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi):
        return False
    i_lo, i_hi, j_lo, j_hi = index_ranges(
        flow.index_map, x_lo, x_hi, y_lo, y_hi, known.x_lo, known.y_lo, flow.per_x, flow.per_y
    )
    i_last, j_last = flow.values.shape[2] - 1 - ROUNDING, flow.values.shape[3] - 1 - ROUNDING
    return min(i_lo, j_lo) >= ROUNDING and i_hi <= i_last and j_hi <= j_last


def _steady_carry(flow, z):
    return flow.extent.max_speed * z


def _grid_carry(flow, z):
    at = (z - flow.z_first) * flow.per_z
    k, c = _cell(at, flow.level_speed.size)
    low, high = flow.level_speed[k], flow.level_speed[k + np.uintp(1)]
    beyond = at - (k + c)
    speed = high if beyond > 0.0 else low
    return flow.level_carry[k] + (c * (low + 0.5 * c * (high - low)) + beyond * speed) / flow.per_z


def _yes(flow):
    return True


def _no(flow):
    return False


def _is_of_one_time(flow):
    return flow.extent.t_lo == -math.inf


def _cell_size(flow):
    return flow.extent.length_scale


def _no_index(flow, x, y):
    return math.nan, math.nan


def _not_at_index(flow, at_i, at_j, level, time):
    return math.nan, math.nan


def _not_at_index_once(flow, at_i, at_j, level):
    return math.nan, math.nan


def _on_none(flow, at):
    return np.uintp(0), math.nan


def _none(flow):
    return 0.0


def _has_ladder(flow):
    return flow.ladder.longest > 0.0


def _no_step(flow, use, z, w, left, longest):
    return left


def _step_to_rung(flow, use, z, w, left, longest):
    levels, way = flow.levels, w * left
    beyond = z + math.copysign(ON_RUNG, way)
    below, _ = _slot(beyond, levels, flow.level_slot, flow.slots_per_z)
    layer = below + np.uintp(1)
    layer = layer if beyond >= levels[0] else np.uintp(0)
    layer = layer if beyond < levels[np.uintp(levels.size - 1)] else np.uintp(levels.size)
    span = abs((flow.ladder.rungs[use, layer, np.uintp(1 if way > 0.0 else 0)] - z) / w)
    # without vertical speed the time to a rung is infinite, or NaN at the rung itself
    span = span if span * NEARLY < abs(left) else abs(left)
    span = span if span <= longest else span / math.ceil(span / longest)
    return math.copysign(span, left)


def _own_longest(flow):
    return flow.ladder.longest


def _max_rise(flow):
    return flow.max_rise


def _no_cycle(flow):
    return 0.0


def _no_return(flow):
    return math.inf


def _gyre_cycle(flow):
    return flow.period if flow.epsilon != 0.0 else 0.0


def _tidal_cycle(flow):
    return flow.period


def _rolls_cycle(flow):
    return abs(2.0 * math.pi / (flow.across * flow.drift)) if flow.drift != 0.0 else 0.0


def _ocean_cycle(flow):
    # a file of one time has no first and last time
    return 0.0 if math.isinf(flow.extent.t_lo) else math.inf


class Abilities(NamedTuple):
    """The functions of one class of flow; they have the names of the public functions."""

    velocity: Callable[..., Any]
    contains: Callable[..., Any] = _in_box
    contains_box: Callable[..., Any] = _box_in_box
    carry: Callable[..., Any] = _steady_carry
    cycle: Callable[..., float] = _no_cycle
    current: Callable[..., Any] = _level_current
    rises: Callable[..., Any] = _no
    max_rise: Callable[..., Any] = _none
    cell_size: Callable[..., Any] = _none
    is_mapped: Callable[..., Any] = _no
    has_one_time: Callable[..., Any] = _no
    index_on_map: Callable[..., Any] = _no_index
    on_levels: Callable[..., Any] = _on_none
    on_times: Callable[..., Any] = _on_none
    at_index: Callable[..., Any] = _not_at_index
    at_index_once: Callable[..., Any] = _not_at_index_once
    has_ladder: Callable[..., Any] = _no
    step_to_rung: Callable[..., Any] = _no_step
    longest_step: Callable[..., Any] = _none


def _rising(current: Callable[..., Any], **others: Callable[..., Any]) -> Abilities:
    return Abilities(_across, current=current, rises=_yes, max_rise=_max_rise, **others)


ABILITIES: dict[type, Abilities] = {
    Uniform: Abilities(_uniform),
    Vortices: Abilities(_vortices),
    MovingVortices: Abilities(_moving_vortices, cycle=_no_return),
    Gyre: Abilities(_gyre, cycle=_gyre_cycle),
    Rankine: Abilities(_rankine),
    Jet: Abilities(_jet),
    TidalJet: Abilities(_tidal_jet, cycle=_tidal_cycle),
    Grid: Abilities(_grid, carry=_grid_carry),
    OceanGrid: Abilities(
        _ocean_grid,
        contains=_in_ocean_grid,
        contains_box=_box_in_ocean_grid,
        cycle=_ocean_cycle,
        cell_size=_cell_size,
        is_mapped=_yes,
        has_one_time=_is_of_one_time,
        index_on_map=_index_on_map,
        on_levels=_on_levels,
        on_times=_on_times,
        at_index=_at_index,
        at_index_once=_at_index_once,
        has_ladder=_has_ladder,
        step_to_rung=_step_to_rung,
        longest_step=_own_longest,
    ),
    Upwelling: _rising(_upwelling),
    Rolls: _rising(_rolls, cycle=_rolls_cycle),
    Abc: _rising(_abc),
    RisingGrid: _rising(_rising_grid),
    RisingOceanGrid: _rising(
        _rising_ocean_grid, contains=_in_ocean_grid, contains_box=_box_in_ocean_grid, cycle=_ocean_cycle
    ),
}


def velocity(flow: Flow, x: float, y: float, z: float, t: float) -> tuple[float, float]:
    """Return the current (u, v) [m/s] along x and y of the local frame, at (x, y, z) [m] and t [s]."""
    return ABILITIES[type(flow)].velocity(flow, x, y, z, t)


def current(flow: Flow, x: float, y: float, z: float, t: float) -> tuple[float, float, float]:
    """Return the current (u, v, w) [m/s] at (x, y, z) [m] and t [s]; w is upward."""
    return ABILITIES[type(flow)].current(flow, x, y, z, t)


def rises(flow: Flow) -> bool:
    """Return whether the flow's class has a vertical part; kernels know it when they are compiled."""
    return ABILITIES[type(flow)].rises(flow)


def max_rise(flow: Flow) -> float:
    """Return an upper bound of the vertical part |w| [m/s]: 0 in a flow without one."""
    return ABILITIES[type(flow)].max_rise(flow)


def cell_size(flow: Flow) -> float:
    """Return the size [m] of the cells of a file's grid, within which its current is smooth; else 0."""
    return ABILITIES[type(flow)].cell_size(flow)


def is_mapped(flow: Flow) -> bool:
    """Return whether `velocity` is `index_on_map`, then `at_index`; kernels know it when they are compiled."""
    return ABILITIES[type(flow)].is_mapped(flow)


def has_one_time(flow: Flow) -> bool:
    """Return whether a mapped flow comes from a file of one time, so that `at_index_once` reads it faster."""
    return ABILITIES[type(flow)].has_one_time(flow)


def index_on_map(flow: Flow, x: float, y: float) -> tuple[float, float]:
    """Return the fractional indices of a place [m] on a mapped flow's grid."""
    return ABILITIES[type(flow)].index_on_map(flow, x, y)


def on_levels(flow: Flow, z: float) -> Slot:
    """Return the level of a mapped flow at or below a height [m], and the weight of the next one."""
    return ABILITIES[type(flow)].on_levels(flow, z)


def on_times(flow: Flow, t: float) -> Slot:
    """Return the time of a mapped flow at or before a time [s], and the weight of the next one."""
    return ABILITIES[type(flow)].on_times(flow, t)


def at_index(flow: Flow, at_i: float, at_j: float, level: Slot, time: Slot) -> tuple[float, float]:
    """Return the current (u, v) [m/s] of a mapped flow at fractional indices, between levels and times."""
    return ABILITIES[type(flow)].at_index(flow, at_i, at_j, level, time)


def at_index_once(flow: Flow, at_i: float, at_j: float, level: Slot) -> tuple[float, float]:
    """Return `at_index` of a flow that `has_one_time`: the same bits, without a look at its times."""
    return ABILITIES[type(flow)].at_index_once(flow, at_i, at_j, level)


def has_ladder(flow: Flow) -> bool:
    """Return whether steps end at the flow's own heights; see `Ladder`."""
    return ABILITIES[type(flow)].has_ladder(flow)


def step_to_rung(flow: Flow, use: Any, z: float, w: float, left: float, longest: float) -> float:
    """Return the next step [s] of a flight at z [m] with w [m/s] and `left` [s] to go, on a flow's ladder.

    Of the ladder for LEGS or FANS. What takes longer than `longest` [s] is cut into equal steps. Below 0 where
    `left` is.
    """
    return ABILITIES[type(flow)].step_to_rung(flow, use, z, w, left, longest)


def longest_step(flow: Flow) -> float:
    """Return the `longest` step [s] of the flow's ladder; 0 without a ladder."""
    return ABILITIES[type(flow)].longest_step(flow)


def contains(flow: Flow, x: float, y: float, t: float) -> bool:
    """Return whether the flow is known at (x, y) [m] and time t [s]."""
    return ABILITIES[type(flow)].contains(flow, x, y, t)


def contains_box(
    flow: Flow, x_lo: float, x_hi: float, y_lo: float, y_hi: float, t_lo: float, t_hi: float
) -> bool:
    """Return whether the flow is surely known in a whole box [m, s]; a quick check before an exact one."""
    return ABILITIES[type(flow)].contains_box(flow, x_lo, x_hi, y_lo, y_hi, t_lo, t_hi)


def carry(flow: Flow, z: float) -> float:
    """The integral over height, up to z [m], of an upper bound of the current at each height [m^2/s].

    A path that passes from z_1 to z_2 at a vertical speed w is carried no further by the flow than
    |carry(z_2) - carry(z_1)| / |w|.
    """
    return ABILITIES[type(flow)].carry(flow, z)


_PUBLIC = (velocity, current, rises, max_rise, contains, contains_box, carry)
_ON_MAPS = (cell_size, is_mapped, has_one_time, index_on_map, on_levels, on_times, at_index, at_index_once)
_ON_LADDERS = (has_ladder, step_to_rung, longest_step)
for _ability in (*_PUBLIC, *_ON_MAPS, *_ON_LADDERS):
    in_kernels(_ability, {kind: getattr(can, _ability.__name__) for kind, can in ABILITIES.items()})


def by_rise(level: Callable[..., Any], rising: Callable[..., Any]) -> dict[type, Callable[..., Any]]:
    """Return a table for `in_kernels`: one function for flows without a vertical part, one for the others.

    Only the one that a flow needs is compiled.
    """
    return {kind: rising if can.rises is _yes else level for kind, can in ABILITIES.items()}


def cycle(flow: Flow) -> float:
    """Return after which time [s] the flow is the same again: 0 if it is steady, inf if it never is.

    Only Python code asks this.
    """
    return ABILITIES[type(flow)].cycle(flow)


def ladder_in(flow: Flow) -> Ladder:
    """Return the ladder of a flow, or NO_LADDER."""
    ladder: Ladder = getattr(flow, "ladder", NO_LADDER)
    return ladder


def on_even_steps(flow: Flow) -> Flow:
    """Return the flow without a ladder."""
    return flow._replace(ladder=NO_LADDER) if isinstance(flow, OceanGrid) else flow


def same_steps(flow: Flow, other: Flow) -> bool:
    """Return whether legs in two flows have the same steps."""
    mine, its = ladder_in(flow), ladder_in(other)
    return mine.longest == its.longest and np.array_equal(mine.rungs, its.rungs)


def fields_of(flow: tuple[Any, ...]) -> dict[str, Any]:
    """Return the fields of a flow or a terrain by name, with those of its extent, but not its ladder.

    A ladder follows from the values.
    """
    fields: dict[str, Any] = flow._asdict()  # type: ignore[attr-defined]
    fields.pop("ladder", None)
    extent = fields.pop("extent", None)
    return fields if extent is None else fields | extent._asdict()


@kernel
def mean_velocity(flow, x, y, z_from, z_to, t):
    """Return the 2.5-D flow of a pair: the mean of the currents at its two depths [m/s]."""
    u_from, v_from = velocity(flow, x, y, z_from, t)
    u_to, v_to = velocity(flow, x, y, z_to, t)
    return 0.5 * (u_from + u_to), 0.5 * (v_from + v_to)


@entry_point(nogil=True)
def sample_lines(flow, x, y, z, t, uv, first, last):
    """Write `velocity` at time t on the mesh of x, y, z into uv (z, x, y, 2), lines first..last - 1 along y."""
    for n in range(first, last):
        k, i = n // x.size, n % x.size
        for j in range(y.size):
            uv[k, i, j] = velocity(flow, x[i], y[j], z[k], t)


@entry_point()
def velocities(flow, x, y, z, t):
    """Return `velocity` at many points for Python code: x, y, z, t have shape (n,), the result (n, 2) [m/s]."""
    uv = np.empty((x.size, 2))
    for n in range(x.size):
        uv[n] = velocity(flow, x[n], y[n], z[n], t[n])
    return uv


@entry_point()
def currents(flow, x, y, z, t):
    """Return `current` at many points for Python code: x, y, z, t have shape (n,), the result (n, 3) [m/s]."""
    uvw = np.empty((x.size, 3))
    for n in range(x.size):
        uvw[n] = current(flow, x[n], y[n], z[n], t[n])
    return uvw


@entry_point(nogil=True)
def sample_rising_lines(flow, x, y, z, t, uvw, first, last):
    """Write `current` at time t on the mesh of x, y, z into uvw (z, x, y, 4), as `sample_lines` does."""
    for n in range(first, last):
        k, i = n // x.size, n % x.size
        for j in range(y.size):
            u, v, w = current(flow, x[i], y[j], z[k], t)
            uvw[k, i, j] = u, v, w, 0.0
