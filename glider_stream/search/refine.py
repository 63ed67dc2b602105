"""Refinement: adds nodes where they can help, in rounds that become finer, and searches the route again.

The cost from the start to a node plus the cost from the node to the goal, both by legs of one roadmap, is the
least cost of a route through the node. A new node can help only where this sum, known from the nodes around it,
is almost as small as the cost of the best route (informed RRT* and BIT* sample in the same way). Each round
places nodes there, one at a random place of each even cell. It finds the legs between old and new nodes by one
fan for each node, and searches again.

With the clock running, each node is left when it is reached. The legs at these times give the remaining cost.
This is an estimate, because a route may reach the node a little later. The search with the clock finds the route
itself.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path as File
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array, Bools, Index
from ..base.nearest import tree_of
from ..base.settings import require
from ..base.threads import threads
from ..kernels.edges import COST, STATUS, TIME, Edge, Status
from ..kernels.flow import velocities
from ..roadmap.builder import Tally, build_roadmap, find_edges, roadmap_of
from ..roadmap.neighbours import Reachable
from ..roadmap.nodes import YoSampler, jittered
from ..roadmap.pairs import Attached
from ..roadmap.problem import Problem
from ..roadmap.provenance import provenance_of
from ..roadmap.roadmap import EDGE_FIELDS, Edges, Roadmap, in_order
from ..roadmap.store import write_roadmap
from .assembly import RoutePlanner, nodes_at, placed_end
from .layered import SurfacingPlanner
from .least_time import fastest_sink
from .path import Hop, Path, Round
from .query import Planner
from .surfacing import Surfacing
from .time_dependent import ClockPlanner

FINER, COARSEST = 0.6, 0.95
"""The spacing of a round as a share of the spacing before it; the second is the largest share, for rounds that
would otherwise have too many legs."""
WORTH = 0.1
"""The route of a round is polished if it costs at most this share more than the best route."""
WIDEST, NARROWEST = 0.03, 0.003
"""Nodes are placed where a route through them costs at most a share more than the best route. The share is the
gain of the last round, limited to this range."""
MOST_PAIRS = 600_000
"""A round has about this many legs at most. If there would be more, nodes are placed only at the best places."""
FEW_LEGS, OTHERS = 24, 3
"""If a route has at most FEW_LEGS legs, OTHERS more routes of each round are polished, too."""
LEAST_NODES = 1000
"""A round may have at least this many nodes, however many legs they have."""
FEWEST_ROUNDS, MOST_ROUNDS = 2, 12
"""The least and the greatest number of rounds; the least is 2 because the first may gain little by chance."""
LONGEST = 1.3
"""No leg of a round takes longer than this factor times the longest leg of the best route."""
NEAR, NEAR_COUNT = 1.5, 4
"""The values of a new place come from at most NEAR_COUNT nodes that are no further away than NEAR spacings."""
APART = 10.0
"""If nodes stay at the depths where yos turn, these depths lie this many spacings apart, so that none is near
another."""
DOUBT = 0.5
"""The values of a new place may be wrong by the time that a glider needs to cross this many spacings."""
SOURCES_AT_ONCE = 256
"""The legs of this many nodes are found together."""


@dataclass(frozen=True)
class Asked:
    """When refinement ends: after a round that gains less than the share `within`, or after `seconds`.

    At least one of them must be given. A round, except the first, does not begin if it would likely end too late.
    """

    within: float | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        fits = self.within is None or 0 < self.within < 1
        require(fits, f"`within` must be a share between 0 and 1, such as 0.01; got {self.within}")
        fits = self.seconds is None or self.seconds > 0
        require(fits, f"`seconds` must be above 0; got {self.seconds}")
        require(self.within is not None or self.seconds is not None, "refinement needs `within` or `seconds`")


@dataclass(frozen=True)
class Refined:
    """The best route with its rounds; `parts` holds the nodes (n, 3) [m] and the edges of each round."""

    path: Path
    problem: Problem
    roadmap: Roadmap | None
    parts: tuple[tuple[Array, Edges], ...] = ()

    def whole(self) -> Roadmap:
        """Return the roadmap with all added nodes, which stand before the scenario's start and goal.

        Its legs are those of the roadmap and of the rounds. InputError if there is no roadmap to add to, or if
        the legs were found at other times than the departure.
        """
        cure = "build a roadmap, and refine a query of it, in a current that is steady"
        require(self.roadmap is not None and bool(self.parts), f"there is no roadmap to write anew; {cure}")
        assert self.roadmap is not None
        return with_added(self.problem, self.roadmap, self.parts)

    def write(self, file: str | File) -> None:
        """Write the roadmap with all added nodes to a file."""
        write_roadmap(self.whole(), file)


class _Cloud(NamedTuple):
    """Nodes (n, 3) [m], of which the last two are start and goal, and the values of each node.

    `since` (n,) is the cost from the start, `left` (n,) the cost to the goal, `when` (n,) the time [s] at which
    the node is reached.
    """

    position: Array
    since: Array
    left: Array
    when: Array

    def sums(self) -> Array:
        """Return the least cost (n,) of a route through each node."""
        return self.since + self.left


@dataclass
class _Cells:
    """Even cells in which new nodes are placed: `spacing` [m] along x and y, `rise` [m] in depth.

    `levels` [m] are heights at which nodes are placed; if `between`, nodes are also placed between them.
    """

    spacing: float
    rise: float
    levels: Array
    between: bool
    random: np.random.Generator = field(repr=False)

    @classmethod
    def of(cls, problem: Problem, position: Array) -> "_Cells":
        """Make the cells that would give the nodes that exist (n, 3) [m]."""
        levels = np.unique(position[:, 2])
        between = len(levels) > 2 and not isinstance(problem.sampler, YoSampler)
        lo, hi = position.min(axis=0), position.max(axis=0)
        # nodes at any depth count as nodes on some even levels
        depths = len(levels) if len(levels) < len(position) ** (1 / 3) else len(position) ** (1 / 3)
        area = max(float(np.prod(hi[:2] - lo[:2])), 1.0)
        spacing = math.sqrt(area * depths / len(position))
        rise = float(hi[2] - lo[2]) / max(depths - 1, 1)
        ends = np.array([float(problem.lo[2]), min(0.0, float(problem.hi[2]))])
        random = np.random.default_rng([problem.sampler.seed, 19])
        return cls(spacing, max(rise, 1e-6), ends if between else levels, between, random)

    def finer(self, share: float) -> "_Cells":
        """Return the cells of the next round; `share` is their width as a share of the width now."""
        rise = share * self.rise if self.between else self.rise
        return replace(self, spacing=share * self.spacing, rise=rise)

    def scale(self) -> Array:
        """Return the distances along x, y, z (3,) [m] that count as near."""
        return np.array([self.spacing, self.spacing, self.rise / (1.0 if self.between else APART)])

    def places(self, lo: Array, hi: Array) -> Array:
        """Return a random place (n, 3) [m] in each cell of a box."""
        parts = []
        for z in self.levels[(self.levels >= lo[2]) & (self.levels <= hi[2])]:
            flat = jittered(lo[:2], hi[:2], np.array([self.spacing, self.spacing]), self.random)
            parts.append(np.column_stack([flat, np.full(len(flat), z)]))
        if self.between:
            parts.append(jittered(lo, hi, np.array([self.spacing, self.spacing, self.rise]), self.random))
        return np.concatenate(parts)


class Refiner:
    """Makes the rounds of refinement for one route of a problem, which `planner` has found."""

    def __init__(
        self,
        planner: RoutePlanner,
        start: Array,
        goal: Array,
        polish: Callable[[Path], Path] | None = None,
    ) -> None:
        """Prepare the refinement; `polish`, if given, polishes the routes of each round."""
        self.polish = polish
        self.planner, self.problem = planner, replace(planner.problem, slices=())
        self.roadmap = roadmap_under(planner)
        self.start, self.goal = start, goal
        self.clock = planner.assembly.changes and not planner.assembly.frozen

    def refine(self, path: Path, asked: Asked, tell: Callable[[str], None]) -> Refined:
        """Return the best route when refinement ends; it is the polished `path` if no round gains anything."""
        began = time.perf_counter()
        cloud, degree = self._first()
        cells, gain = _Cells.of(self.problem, cloud.position[:-2]), WIDEST
        polish = (lambda route: route) if self.polish is None else self.polish
        best, by_nodes = polish(path), path
        rounds: list[Round] = []
        parts: list[tuple[Array, Edges]] = []
        while len(rounds) < MOST_ROUNDS:
            since = time.perf_counter()
            share = min(max(gain, NARROWEST), WIDEST)
            guess, cells = self._placed(cloud, cells, by_nodes, share, degree)
            problem = self._problem_of(by_nodes)
            edges = self._edges(problem, guess, cells)
            cloud = self._known(problem, guess.position, edges)
            parts.append((guess.position, edges))
            degree = max(1.0, edges.target.size / len(cloud.position))
            found = self._route(problem, cloud, edges, share)
            gain, before = max(0.0, 1 - found.cost / by_nodes.cost), best.cost
            by_nodes = found if found.cost < by_nodes.cost else by_nodes
            for start in self._starts(found, best, cloud, edges):
                polished = polish(start)
                best = polished if polished.cost < best.cost else best
            saved = 1 - best.cost / before
            size = len(cloud.position), int(edges.target.size)
            rounds.append(Round(cells.spacing, *size, best.travel_time, best.cost, saved))
            tell(rounds[-1].told(len(rounds)).strip())
            if asked.within is not None and saved < asked.within and len(rounds) >= FEWEST_ROUNDS:
                break
            last, spent = time.perf_counter() - since, time.perf_counter() - began
            if asked.seconds is not None and spent + last > asked.seconds:
                break
        road = None if self.clock else self.roadmap
        return Refined(replace(best, rounds=tuple(rounds)), self.problem, road, tuple(parts))

    def _starts(self, found: Path, best: Path, cloud: _Cloud, edges: Edges) -> list[Path]:
        """Return the routes of a round to polish: the best one, and if legs are few, also others far from it.

        Polishing finds the best route near its first route, so another first route may give a better result.
        """
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        starts = [found] if found.cost < (1 + WORTH) * best.cost else []
        if not starts or self.polish is None or self.clock or len(found.legs) > FEW_LEGS:
            return starts
        count, (start, goal) = len(cloud.position), np.arange(len(cloud.position))[-2:]
        ways = edges.values[:, 1], (np.repeat(edges.source, edges.degree), edges.target)
        graph = csr_array(ways, shape=(count, count))
        back = dijkstra(graph, indices=[start], return_predecessors=True)[1][0]
        ahead = dijkstra(graph.T.tocsr(), indices=[goal], return_predecessors=True)[1][0]
        near = np.flatnonzero(cloud.sums() <= (1 + WIDEST) * cloud.sums().min())
        passed = found.trajectory[:, 1:]
        for _ in range(OTHERS):
            far = tree_of(passed).query(cloud.position[near])[0]
            node = near[int(np.argmax(far))]
            nodes = _chain(int(node), back)[::-1] + _chain(int(node), ahead)[1:]
            starts.append(self.planner.fly(self._hops(cloud, edges, nodes)))
            passed = np.vstack([passed, starts[-1].trajectory[:, 1:]])
        return starts

    def _hops(self, cloud: _Cloud, edges: Edges, nodes: list[int]) -> list[Hop]:
        """Return the legs between `nodes`, one after the other."""
        first, hops = np.concatenate([[0], np.cumsum(edges.degree)]), []
        for source, target in pairwise(nodes):
            row = slice(first[source], first[source + 1])
            n = int(first[source] + np.flatnonzero(edges.target[row] == target)[0])
            edge = Edge(int(Status.CONNECTED), *map(float, edges.values[n]))
            hops.append((cloud.position[source], cloud.position[target], edge))
        return hops

    def _first(self) -> tuple[_Cloud, float]:
        """Return the cloud of the nodes that exist, and the mean number of legs from a node."""
        problem = self.problem
        if self.clock:
            assert isinstance(self.planner, ClockPlanner)
            position = self.planner.position
            arrivals = problem.departure + self.planner.arrivals(self.start)
            reached = np.flatnonzero(arrivals <= problem.evaluator.flow.extent.t_hi)
            edges = in_order(list(find_edges(problem, position, reached, departure=arrivals)))
            source, target = np.repeat(edges.source, edges.degree), edges.target
            costs, times = edges.values[:, 1], edges.values[:, 0]
        else:
            if self.roadmap is None:
                self.roadmap = build_roadmap(problem)
            road = self.roadmap
            position = road.position
            source, target = np.repeat(np.arange(len(position)), np.diff(road.indptr)), road.target
            costs, times = road.cost, road.time
        cloud = self._with_ends(position, source, target.astype(np.int64), costs, times)
        return cloud, max(1.0, len(source) / len(position))

    def _with_ends(self, position: Array, source: Index, target: Index, costs: Array, times: Array) -> _Cloud:
        """Return the cloud of nodes and edges, with start and goal as the last two nodes."""
        legs, count = self.problem.legs(position), len(position)
        ways: list[tuple[Index, Index, Array, Array]] = [(source, target, costs, times)]

        def add(attached: Attached, own: int, away: bool) -> None:
            fits = attached.outcomes[:, STATUS] == Status.CONNECTED
            nodes, rows = attached.nodes[fits], attached.outcomes[fits]
            here = np.full(len(nodes), own)
            ends = (here, nodes) if away else (nodes, here)
            ways.append((*ends, rows[:, COST], rows[:, TIME]))

        at = [nodes_at(position, end) for end in (self.start, self.goal)]
        ends = [int(nodes[0]) if nodes.size else count + n for n, nodes in enumerate(at)]
        if not at[0].size:
            add(legs.away(self.start), ends[0], True)
        if not at[1].size:
            add(legs.towards(self.goal), ends[1], False)
        everywhere = np.vstack([position, self.start, self.goal])
        source, target, costs, times = (np.concatenate(parts) for parts in zip(*ways, strict=True))
        since, left, when = _costs(len(everywhere), source, target, costs, times, *ends)
        order = np.concatenate([np.setdiff1d(np.arange(count), ends), ends]).astype(np.int64)
        return _Cloud(everywhere[order], since[order], left[order], self.problem.departure + when[order])

    def _placed(
        self, cloud: _Cloud, before: _Cells, best: Path, share: float, degree: float
    ) -> tuple[_Cloud, _Cells]:
        """Return the nodes of a round, of which the last two are start and goal, and the cells in which they lie.

        The values of new nodes come from the nodes around them.
        """
        sums, scale = cloud.sums(), before.scale()
        stops = self._stops(cloud, best)
        most = (1 + share) * (float(sums[stops].max()) if stops.size else best.cost)
        near = np.flatnonzero(sums <= most)
        tree = tree_of(cloud.position[np.isfinite(sums)] / scale)
        box = self._box(cloud.position[near], scale)
        finer = FINER
        while True:
            cells = before.finer(finer)
            new = cells.places(*box)
            nearby = tree.query(new / scale, k=NEAR_COUNT, distance_upper_bound=NEAR)
            far, around = (np.asarray(part) for part in nearby)
            at = np.isfinite(far)
            promise = np.where(at, np.append(sums[np.isfinite(sums)], np.inf)[around], np.inf).min(axis=1)
            chosen = np.flatnonzero(promise <= most)
            # the number of legs of a node grows with the density of nodes
            ratio = finer ** -(3 if cells.between else 2)
            pairs = (len(chosen) + len(near)) * degree * ratio
            if pairs <= MOST_PAIRS or finer >= COARSEST:
                break
            finer = min(
                COARSEST, max(1.02 * finer, finer * (pairs / MOST_PAIRS) ** (0.5 / (3 if cells.between else 2)))
            )
        chosen = chosen[self.problem.evaluator.allowed(new[chosen], self.problem.departure)]
        at, around = at[chosen], around[chosen]

        def with_means(values: Array) -> Array:
            near_values = np.where(at, np.append(values[np.isfinite(sums)], 0.0)[around], 0.0)
            return np.concatenate([values, near_values.sum(axis=1) / at.sum(axis=1)])

        every = _Cloud(
            np.vstack([cloud.position, new[chosen]]),
            *(with_means(values) for values in (cloud.since, cloud.left, cloud.when)),
        )
        # keep no more nodes than the legs of a round allow; the route's stops stay, start and goal come last
        count, stays = len(sums), np.zeros(len(every.position), np.bool_)
        stays[stops], stays[count - 2 : count] = True, False
        order = np.concatenate([sums, promise[chosen]])
        order[stays], order[count - 2 : count] = -np.inf, np.inf
        room = max(LEAST_NODES, int(MOST_PAIRS / (degree * ratio)))
        kept = np.argsort(order, kind="stable")[:room]
        kept = np.append(np.sort(kept[order[kept] <= most]), [count - 2, count - 1])
        return _Cloud(*(values[kept] for values in every)), cells

    def _box(self, position: Array, scale: Array) -> tuple[Array, Array]:
        """Return the box, lo and hi (3,) [m], for new nodes: the box of some nodes and one spacing more."""
        lo, hi = self.problem.lo.astype(float), self.problem.hi.astype(float)
        hi[2] = min(hi[2], 0.0)
        lo[:2] = np.maximum(lo, position.min(axis=0) - scale)[:2]
        hi[:2] = np.minimum(hi, position.max(axis=0) + scale)[:2]
        return lo, hi

    def _stops(self, cloud: _Cloud, best: Path) -> Index:
        """Return the nodes at which a route stops; with a rule of surfacing their sums may not be the least."""
        stops = np.array([best.legs[0].start, *(leg.end for leg in best.legs)])
        far, near = (np.asarray(part) for part in tree_of(cloud.position).query(stops))
        at = near[(far == 0.0) & np.isfinite(cloud.sums()[near])]
        return np.asarray(at, np.int64)

    def _problem_of(self, best: Path) -> Problem:
        """Return the problem with exact legs that are not much longer than the legs of the best route."""
        evaluator = self.problem.evaluator.by_fan()
        integration = evaluator.integration
        longest = LONGEST * max(leg.duration for leg in best.legs)
        steps = min(integration.steps, math.ceil(longest / integration.dt))
        short = replace(evaluator, integration=replace(integration, steps=steps))
        return replace(self.problem, evaluator=short, law=Reachable(0))

    def _edges(self, problem: Problem, guess: _Cloud, cells: _Cells) -> Edges:
        """Return the legs of a round, without legs that lead away from the goal or gain less than they cost."""
        evaluator, price = problem.evaluator, problem.evaluator.cost.kernel()
        position, integration = guess.position, evaluator.integration
        sink = fastest_sink(evaluator.polar, evaluator.flow)
        level = float(evaluator.polar.best_horizontal.max())
        unsure = DOUBT / FINER * max(cells.spacing / level, cells.rise / sink if cells.between else 0.0)
        current = velocities(evaluator.flow, *np.ascontiguousarray(position.T), guess.when)
        reach = (level + float(np.hypot(*current.T).max())) * integration.dt * integration.steps
        tree = tree_of(position[:, :2])

        def wanted(source: Index) -> Bools:
            rows = list(map(np.array, tree.query_ball_point(position[source, :2], reach, workers=-1)))
            at = np.repeat(np.arange(len(source)), [len(row) for row in rows])
            here, target = source[at], np.concatenate(rows).astype(np.int64)
            least = price.per_second * (np.abs(position[target, 2] - position[here, 2]) / sink - unsure)
            useful = guess.since[target] - guess.since[here] >= least
            useful &= guess.left[here] - guess.left[target] >= least
            result = np.zeros((len(source), len(position)), np.bool_)
            result[at[useful], target[useful]] = True
            return result

        departure, batch = guess.when if self.clock else None, SOURCES_AT_ONCE * len(position)
        return in_order(list(find_edges(problem, position, None, batch, departure, wanted)))

    def _known(self, problem: Problem, position: Array, edges: Edges) -> _Cloud:
        source, count = np.repeat(edges.source, edges.degree), len(position)
        values = edges.values
        since, left, when = _costs(
            count, source, edges.target.astype(np.int64), values[:, 1], values[:, 0], count - 2, count - 1
        )
        return _Cloud(position, since, left, problem.departure + when)

    def _route(self, problem: Problem, cloud: _Cloud, edges: Edges, share: float) -> Path:
        """Return the best route through the nodes of a round, found by a planner of the same kind."""
        rule = self.planner.rule
        if self.clock:
            sums = cloud.sums()
            near = np.flatnonzero(sums[:-2] <= (1 + share) * sums.min())
            position = cloud.position[np.append(near, [len(sums) - 2, len(sums) - 1])]
            return ClockPlanner(problem, position, rule).query(self.start, self.goal)
        made = provenance_of(problem, cloud.position)
        with threads(None) as used:
            tally = Tally(len(cloud.position), used)
        tally.add(edges)
        road = roadmap_of(problem, cloud.position, edges, made, tally)
        planner = Planner(road, problem) if rule == Surfacing() else SurfacingPlanner(road, problem, rule)
        return planner.query(self.start, self.goal)


def _chain(node: int, following: Array) -> list[int]:
    """Return a node and all nodes that follow it."""
    nodes = [node]
    while following[nodes[-1]] >= 0:
        nodes.append(int(following[nodes[-1]]))
    return nodes


def _costs(
    count: int, source: Index, target: Index, costs: Array, times: Array, start: int, goal: int
) -> tuple[Array, Array, Array]:
    """Return of each node (count,): cost from the start, cost to the goal, time [s] from the start."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    graph, clock = (csr_array((values, (source, target)), shape=(count, count)) for values in (costs, times))
    since, when = (dijkstra(weights, indices=[start])[0] for weights in (graph, clock))
    left = dijkstra(graph.T.tocsr(), indices=[goal])[0]
    return since, left, when


def roadmap_under(planner: RoutePlanner) -> Roadmap | None:
    """Return the roadmap whose legs a planner uses; None if it uses no roadmap."""
    if isinstance(planner, SurfacingPlanner):
        return planner.base
    return planner.roadmap if isinstance(planner, Planner) else None


def refined(
    planner: RoutePlanner,
    ends: tuple[Array | None, Array | None],
    path: Path,
    asked: Asked,
    polish: Callable[[Path], Path] | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> Refined:
    """Return a path that `planner` found, refined; unchanged if the path has no leg."""
    if not path.legs:
        return Refined(path, planner.problem, roadmap_under(planner))
    start = placed_end(planner.problem, ends[0], planner.problem.start, "start")
    goal = placed_end(planner.problem, ends[1], planner.problem.goal, "goal")
    return Refiner(planner, start, goal, polish).refine(path, asked, tell)


def with_added(problem: Problem, roadmap: Roadmap, parts: Sequence[tuple[Array, Edges]]) -> Roadmap:
    """Return a roadmap with the nodes (n, 3) [m] and edges of `parts` added; its old legs stay unchanged."""
    named = sum(point is not None for point in (problem.start, problem.goal))
    count = len(roadmap.position) - named
    known = {tuple(place) for place in roadmap.position.tolist()}
    added = dict.fromkeys(tuple(place) for where, _ in parts for place in where.tolist())
    new = np.array([place for place in added if place not in known]).reshape(-1, 3)
    position = np.vstack([roadmap.position[:count], new, roadmap.position[count:]])
    number = {tuple(place): n for n, place in enumerate(position.tolist())}
    numbers = np.arange(len(roadmap.position))
    numbers[count:] += len(new)
    values = np.stack([getattr(roadmap, name) for name in EDGE_FIELDS], axis=1)
    assert roadmap.node_counts is not None
    first = Edges(np.arange(len(numbers)), np.diff(roadmap.indptr), roadmap.target, values, roadmap.node_counts)
    keys, rows, counts = [], [], np.zeros((len(position), len(Status)), np.int32)
    places = [(np.array([number[tuple(place)] for place in where.tolist()]), edges) for where, edges in parts]
    for mine, edges in ((numbers, first), *places):
        keys.append(np.repeat(mine[edges.source], edges.degree) * len(position) + mine[edges.target])
        rows.append(edges.values)
        np.add.at(counts, mine[edges.source], edges.counts)
    key, chosen = np.unique(np.concatenate(keys), return_index=True)  # the first of equal edges
    source, target = np.divmod(key, len(position))
    degree = np.bincount(source, minlength=len(position))
    counts[:, Status.CONNECTED] = degree
    tally = Tally(len(position), roadmap.threads)
    whole = Edges(
        np.arange(len(position)), degree, target.astype(np.int32), np.concatenate(rows)[chosen], counts,
        roadmap.wall_s + sum(edges.seconds for _, edges in parts),
    )  # fmt: skip
    tally.add(whole)
    made = replace(provenance_of(problem, position), steps=roadmap.provenance.steps)
    return roadmap_of(problem, position, whole, made, tally)
