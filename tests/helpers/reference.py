"""The naive versions that the kernels are measured against: slow, literal, and written to be read."""

import heapq
import itertools
import math

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

from glider_stream.kernels.cache import entry_point
from glider_stream.kernels.control import candidate_controls, control_towards, direction_of, vertical_speed
from glider_stream.kernels.flow import contains, current, velocity
from glider_stream.kernels.place import Pair, Place

CONNECTED, TIME, COST, ANGLE, HEADING, SPEED, MISS = range(7)


@entry_point()
def literal_edges(flow, polar, steering, integration, position, departure, source, target):
    """Every control, every step, every segment: rows (connected, time, cost, angle, heading, speed, miss).

    Terrain is open water. NaN where nothing hits; of equal costs the first.
    """
    edges = np.full((source.size, 7), np.nan)
    controls = np.empty((steering.candidates, 2))
    dt = integration.dt
    horizon = integration.steps * dt
    for pair in range(source.size):
        x_p, y_p, z_p = position[source[pair]]
        x_q, y_q, z_q = position[target[pair]]
        t = departure[source[pair]]
        edges[pair, 0] = 0.0
        if z_p == z_q or not (contains(flow, x_p, y_p, t) and contains(flow, x_q, y_q, t)):
            continue
        pair_ends = Pair(Place(x_p, y_p, z_p, t), Place(x_q, y_q, z_q, t))
        direction = direction_of(pair_ends)
        slowest = abs(z_q - z_p) / horizon
        if vertical_speed(polar, direction, polar.steepest[direction]) < slowest:
            continue
        count = candidate_controls(steering, flow, polar, pair_ends, slowest, controls)
        cheapest = math.inf
        for n in range(count):
            c = control_towards(polar, direction, controls[n, 0], controls[n, 1])
            x, y, z = x_p, y_p, z_p
            miss, time = math.inf, math.inf
            for step in range(integration.steps):
                now = t + step * dt
                if not contains(flow, x, y, now):
                    break
                u1, v1 = velocity(flow, x, y, z, now)
                u2, v2 = velocity(
                    flow, x + dt / 2 * (u1 + c.u), y + dt / 2 * (v1 + c.v), z + dt / 2 * c.w, now + dt / 2
                )
                u3, v3 = velocity(
                    flow, x + dt / 2 * (u2 + c.u), y + dt / 2 * (v2 + c.v), z + dt / 2 * c.w, now + dt / 2
                )
                u4, v4 = velocity(flow, x + dt * (u3 + c.u), y + dt * (v3 + c.v), z + dt * c.w, now + dt)
                x_next = x + dt * (c.u + (u1 + 2 * u2 + 2 * u3 + u4) / 6)
                y_next = y + dt * (c.v + (v1 + 2 * v2 + 2 * v3 + v4) / 6)
                z_next = z_p + (step + 1) * dt * c.w
                ax, ay, az = x_next - x, y_next - y, z_next - z
                share = ((x_q - x) * ax + (y_q - y) * ay + (z_q - z) * az) / (ax * ax + ay * ay + az * az)
                share = min(max(share, 0.0), 1.0)
                off = math.sqrt(
                    (x + share * ax - x_q) ** 2 + (y + share * ay - y_q) ** 2 + (z + share * az - z_q) ** 2
                )
                if off < miss:
                    miss, time = off, (step + share) * dt
                x, y, z = x_next, y_next, z_next
            if miss < integration.tolerance and 0.0 < time < cheapest:
                cheapest = time
                edges[pair] = (1.0, time, time, c.glide_angle, c.heading, c.speed, miss)
    return edges


def pair_of(p, q, t=0.0):
    """The pair of two points (3,) [m], left at t [s]."""
    return Pair(Place(*p, t), Place(*q, t))


def stream_value(flow, p, q, t=0.0):
    """psi_c of p -> q by adaptive quadrature."""
    (x_p, y_p, z_p), (x_q, y_q, z_q) = p, q
    dx, dy = x_q - x_p, y_q - y_p

    def crossing(s):
        pairs = [velocity(flow, x_p + s * dx, y_p + s * dy, z, t) for z in (z_p, z_q)]
        u, v = np.mean(pairs, axis=0)
        return u * dy - v * dx

    breaks = np.linspace(0, 1, 21)
    return sum(quad(crossing, a, b, epsabs=1e-11, epsrel=1e-11)[0] for a, b in itertools.pairwise(breaks))


def replay(flow, start, through_water, horizon, t=0.0):
    """The path of a constant velocity through water (u, v, w), DOP853; its dense output, s -> (x, y, z)."""
    u, v, w = through_water

    def rate(s, at):
        flow_u, flow_v = velocity(flow, *at, t + s)
        return flow_u + u, flow_v + v, w

    return solve_ivp(
        rate,
        (0.0, horizon),
        start,
        method="DOP853",
        rtol=1e-10,
        atol=1e-8,
        max_step=horizon / 50,
        dense_output=True,
    ).sol


def replay_rising(flow, start, through_water, height, horizon):
    """Where and when a path in a rising flow first reaches a height, by DOP853 with events: x, y, z, t.

    `start` is x, y, z [m] and a departure [s].
    """
    *begin, t = start

    def rate(s, at):
        return np.add(current(flow, *at, t + s), through_water)

    def arrives(s, at):
        return at[2] - height

    arrives.terminal = True
    path = solve_ivp(
        rate, (0.0, horizon), begin, method="DOP853", rtol=1e-12, atol=1e-10, max_step=5.0, events=arrives
    )
    return *path.y_events[0][0], path.t_events[0][0]


def closest_on(path, goal, horizon):
    """Miss [m] and time [s] of a dense path's closest approach to a point."""

    def distance(s):
        return float(np.linalg.norm(path(s) - goal))

    times = np.linspace(0.0, horizon, 2001)
    first = times[np.argmin(np.linalg.norm(path(times).T - goal, axis=1))]
    step = times[1]
    found = minimize_scalar(
        distance,
        bounds=(max(0.0, first - step), min(horizon, first + step)),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return found.fun, found.x


def dijkstra(indptr, target, cost, start):
    """Cost from `start` to every node of a CSR graph."""
    best = np.full(len(indptr) - 1, math.inf)
    best[start] = 0.0
    queue = [(0.0, start)]
    while queue:
        so_far, node = heapq.heappop(queue)
        if so_far > best[node]:
            continue
        for edge in range(indptr[node], indptr[node + 1]):
            there = so_far + cost[edge]
            if there < best[target[edge]]:
                best[target[edge]] = there
                heapq.heappush(queue, (there, target[edge]))
    return best


def squared_distances(position, point):
    """Squared distances [m^2] of nodes (n, 3) from a point (3,)."""
    return ((position - point) ** 2).sum(axis=1)


def nearest(position, point, k):
    """The k nearest nodes at other depths; of equal distances the lower number; rising."""
    squared = squared_distances(position, point)
    others = [n for n in range(len(position)) if position[n, 2] != point[2]]
    return sorted(sorted(others, key=lambda n: (squared[n], n))[:k])


def within(position, point, radius):
    """The nodes at other depths within a radius [m], rising."""
    squared = squared_distances(position, point)
    return [n for n in range(len(position)) if position[n, 2] != point[2] and squared[n] <= radius**2]


def flown(flow, leg, times):
    """Where a leg's trim takes a vehicle (n, 3) [m], `times` (n,) [s] after it began, by scipy's DOP853.

    The current is that at the leg's departure, t = 0: for steady flows.
    """
    along = leg.speed * math.cos(leg.glide_angle)
    through = along * math.cos(leg.heading), along * math.sin(leg.heading)

    def rate(t, at):
        u, v = velocity(flow, *at, 0.0)
        return [u + through[0], v + through[1], leg.speed * math.sin(leg.glide_angle)]

    return solve_ivp(rate, (0, times[-1]), leg.start, "DOP853", times, rtol=1e-9, atol=1e-7, max_step=3.0).y.T
