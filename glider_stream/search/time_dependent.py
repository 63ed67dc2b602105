"""Queries with the clock running: each leg leaves when the leg before it arrives.

The legs of a node are found at the time at which the search reaches the node, so the route can be flown in the
flow as it changes. This needs only nodes, no roadmap.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Index
from ..base.clock import moment
from ..base.settings import require
from ..kernels.edges import TIME
from ..roadmap.problem import Problem
from ..roadmap.step_error import step_error
from .assembly import RoutePlanner, nodes_at, placed_end
from .expansion import BoundedExpansion, ClockExpansion, Ends, Expansion
from .labels import Aim, LabelSearch
from .least_time import GreatestSpeeds, LeastTimes
from .path import Hop, Path
from .surfacing import Surfacing
from .trade_off import TradeOff, none_within
from .why_not import why_not

MOST_BINS = 240
"""A search with bins of time ends so many bins after the departure."""
PATIENCE = 48
"""A search with bins that the query did not ask for also ends after so many bins without a node that is new."""
LATER_FANS = 256
"""The second search, for a better path, uses this many fans; with few nodes they are enough for all ways."""
TRIED_FANS = 32
"""The second search uses only this many fans if the first used more than `LATER_FANS`, because then it can hardly
follow all ways."""
NARROWEST = 8.0
"""Bins are not made narrower than this [s]: two ways that arrive within such a short time continue alike."""
BETTER = 1e-3
"""A later way must be better by this [s or J], so that a way that is found twice in other batches is no gain."""


class ClockPlanner(RoutePlanner):
    """Answers any number of queries among nodes (n, 3) [m], at any departure, by legs found when they are needed.

    It has the methods of `query.Planner` and replaces it in a flow that changes with time. All paths keep the
    `rule` of surfacing. With `frozen` every leg meets the current of the problem's departure.
    """

    def __init__(
        self,
        problem: Problem,
        position: Array,
        rule: Surfacing = Surfacing(),  # noqa: B008  (frozen)
        frozen: bool = False,
    ) -> None:
        """Keep the nodes; no leg is searched yet."""
        super().__init__(problem, rule, frozen)
        self.position = position
        self._speeds: dict[float, GreatestSpeeds] = {}

    def query(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
    ) -> Path:
        """Return the cheapest path between two points (3,) [m]; None stands for the scenario's start or goal."""
        return self._query(start, goal, Aim(by_cost=True))

    def leaving(self, since: float) -> "ClockPlanner":
        """Return the same planner for routes that leave `since` [s] later."""
        later = ClockPlanner(self.problem.leaving(since), self.position, self.rule, self.assembly.frozen)
        later._speeds = self._speeds
        return later

    def within(self, start: ArrayLike | None, goal: ArrayLike | None, most_cost: float) -> Path:
        """Return the fastest path that costs at most `most_cost`; if no path does, it says why."""
        aim = Aim(cost_below=float(np.nextafter(most_cost, math.inf)))
        path = self._query(start, goal, aim)
        return path if path.found else none_within(self.query(start, goal), most_cost)

    def _query(self, start: ArrayLike | None, goal: ArrayLike | None, aim: Aim) -> Path:
        ends = self._ends(start, [goal])
        if np.array_equal(ends.start, ends.goals[0]):
            return self.assembly.path(ends.start, ends.goals[0], [])
        path, search = self._first(ends, self._with_bins(aim))
        if self.problem.bins is not None:
            return path if path.found else self._first(ends, aim)[0]
        return self._looked_again(ends, aim, path, search)

    def _looked_again(self, ends: Ends, aim: Aim, path: Path, search: LabelSearch) -> Path:
        """Return the best of a path and of ways that reach some node later than the earliest way, with a note.

        The first bins are as long as a typical leg. They are halved until `LATER_FANS` fans are spent. If no path
        is known, all ways in the first bins are followed, as long as they come to nodes that are new: a glider
        that the current carries away may come back later and only then find a way on.
        """
        durations = [float(label.row[TIME]) for label in search.labels if label.row is not None]
        if not durations or not self.assembly.changes or self.assembly.frozen:
            return path
        widest, departure = float(np.median(durations)), self.problem.departure
        latest, patience = departure + MOST_BINS * widest, PATIENCE * widest
        fans = LATER_FANS if search.tally.fans <= LATER_FANS else min(TRIED_FANS, LATER_FANS)
        expansion = BoundedExpansion(self._expansion(ends), fans if path.found else math.inf)
        best, width, finest, whole, until = path, widest, math.inf, True, departure
        while whole and width >= NARROWEST:
            below = (best.cost if search.by_cost else departure + best.travel_time) - BETTER
            later = replace(aim, bins=width, latest=latest, patience=patience, below=below)
            # the reason for no path comes from the widest bins: only there were all ways surely followed
            found, again = self._first(ends, later, expansion, known=best.found or width < widest)
            best = found if found.found or (width == widest and not best.found) else best
            whole, expansion.most = again.whole, max(fans, expansion.found)
            if whole:
                finest, until = (
                    width,
                    max(until, min(again.until, latest, self.problem.evaluator.flow.extent.t_hi)),
                )
            width /= 2
        if not best.found:
            when = moment(self.problem.departs, until - departure)
            looked = f"ways that come back to a node later were followed until {when}"
            return replace(best, why=f"{best.why}; {looked}, in bins of {finest:,.0f} s")
        if whole:
            return best
        next_width = min(widest, finest / 2)
        note = _in_part(search.tally.fans, expansion.found, finest, next_width, best.travel_time)
        return replace(best, notes=(*best.notes, note))

    def queries(self, start: ArrayLike | None, goals: Sequence[ArrayLike | None]) -> list[Path]:
        """Return the cheapest paths from one point (3,) [m] to each of many, by one search.

        To several goals only the earliest way to each node is followed, so a path may exist that costs less.
        """
        if len(goals) == 1:
            return [self.query(start, goals[0])]
        ends = self._ends(start, goals)
        search, expansion = self._search(ends, Aim(by_cost=True), to_all=True)
        goal_of: dict[int, list[int]] = {}
        for n, places in enumerate(expansion.goals):
            for place in places:
                goal_of.setdefault(int(place), []).append(n)
        first: dict[int, int] = {}
        for number in search.settled():
            for n in goal_of.get(search.labels[number].place, ()):
                first.setdefault(n, number)
            if len(first) == len(goals):
                break
        return [self._path(search, expansion, first.get(n), ends, n) for n in range(len(goals))]

    def table(self, starts: Sequence[ArrayLike], goals: Sequence[ArrayLike]) -> Array:
        """Return the costs (n, m) of the cheapest paths from n points (3,) [m] to m others; see `queries`."""
        return np.array([[path.cost for path in self.queries(start, goals)] for start in starts]).reshape(
            len(starts), len(goals)
        )

    def arrivals(self, start: ArrayLike | None = None) -> Array:
        """Return the earliest time (n,) [s after departure] at which each node is reached; inf if it is not."""
        departure, times = self.problem.departure, np.full(len(self.position), math.inf)
        search, _ = self._search(self._ends(start, []), Aim(), to_all=True)
        for number in search.settled():
            label = search.labels[number]
            if label.place < times.size:
                times[label.place] = min(times[label.place], label.time - departure)
        return times

    def front(self, start: ArrayLike | None = None, goal: ArrayLike | None = None) -> TradeOff:
        """Return every path for which no other is better both in time and in energy, sorted by time."""
        ends = self._ends(start, [goal])
        search, expansion = self._search(ends, self._with_bins(Aim(front=True)))
        found: list[int | None] = [n for n in search.settled() if search.is_goal[search.labels[n].place]]
        paths = [self._path(search, expansion, number, ends, 0) for number in found or [None]]
        exact = self.problem.bins is not None or not self.assembly.changes or self.assembly.frozen
        return TradeOff(tuple(paths), whole=exact)

    def _ends(self, start: ArrayLike | None, goals: Sequence[ArrayLike | None]) -> Ends:
        """Return the ends of a query after checks."""
        departure, extent = self.problem.departure, self.problem.evaluator.flow.extent
        times = f"the times of the flow, {extent.t_lo:g} to {extent.t_hi:g} s"
        within = extent.t_lo <= departure <= extent.t_hi
        require(within, f"the departure at {departure:g} s lies outside {times}; choose one of them")
        begin = placed_end(self.problem, start, self.problem.start, "start")
        places = [placed_end(self.problem, goal, self.problem.goal, "goal") for goal in goals]
        for place, name in [(begin, "start"), *((place, "goal") for place in places)]:
            self.rule.check_end(place, name)
        return Ends(begin, nodes_at(self.position, begin), places, [nodes_at(self.position, p) for p in places])

    def _with_bins(self, aim: Aim) -> Aim:
        bins = self.problem.bins
        return aim if bins is None else replace(aim, bins=bins, latest=self.problem.departure + MOST_BINS * bins)

    def _expansion(self, ends: Ends) -> ClockExpansion:
        return ClockExpansion(self.problem, self.position, ends, self.assembly.frozen)

    def _search(self, ends: Ends, aim: Aim, to_all: bool = False) -> tuple[LabelSearch, ClockExpansion]:
        expansion = self._expansion(ends)
        goals = np.empty(0, np.int64) if to_all else expansion.goals[0]
        return self._search_of(expansion, goals, aim), expansion

    def _search_of(self, expansion: Expansion, goals: Index, aim: Aim) -> LabelSearch:
        departure = self.problem.departure
        least = LeastTimes(self._speeds_now(), expansion.places)
        cost = self.problem.evaluator.cost
        return LabelSearch(expansion, cost, self.rule, least, goals, departure, aim)

    def _speeds_now(self) -> GreatestSpeeds:
        """Return the greatest speeds from the departure, or from an earlier time, on; both are upper bounds."""
        departure = self.problem.departure
        since = max((begin for begin in self._speeds if begin <= departure), default=departure)
        if since not in self._speeds:
            self._speeds[since] = GreatestSpeeds(self.problem, self.position, since)
        return self._speeds[since]

    def _first(
        self, ends: Ends, aim: Aim, bounded: BoundedExpansion | None = None, known: bool = False
    ) -> tuple[Path, LabelSearch]:
        """Return the path of the first final label at the goal, and the search.

        If no path is found and one is `known` already, the reason is not looked for.
        """
        clock = self._expansion(ends) if bounded is None else bounded.clock
        search = self._search_of(bounded or clock, clock.goals[0], aim)
        number = next((n for n in search.settled() if search.is_goal[search.labels[n].place]), None)
        if number is None and known:
            return self.assembly.no_path(ends.start, ends.goals[0]), search
        return self._path(search, clock, number, ends, 0), search

    def _path(
        self,
        search: LabelSearch,
        expansion: ClockExpansion,
        number: int | None,
        ends: Ends,
        goal: int,
    ) -> Path:
        here = np.array_equal(ends.start, ends.goals[goal])
        if number is None and not here:
            return self._no_path(expansion, search, ends.start, ends.goals[goal])
        hops = [] if number is None or here else search.hops(number)
        self._check_steps(hops)
        path = self.assembly.path(ends.start, ends.goals[goal], hops)
        return replace(path, expanded=search.tally.share)

    def _check_steps(self, hops: list[Hop]) -> None:
        """InputError where the integration's steps are too coarse for some legs."""
        if hops:
            starts, values = np.array([hop[0] for hop in hops]), np.array([hop[2][1:] for hop in hops])
            step_error(self.problem, starts, values).check()

    def _no_path(self, expansion: ClockExpansion, search: LabelSearch, start: Array, goal: Array) -> Path:
        """The honest no, and why, as far as that is known."""
        problem, extent = self.problem, self.problem.evaluator.flow.extent
        departure, times = problem.departure, np.full(expansion.nodes, math.inf)
        for label in search.labels:
            if label.place < expansion.nodes:
                times[label.place] = min(times[label.place], label.time - departure)
        path = self.assembly.no_path(start, goal)
        if not expansion.nodes:
            return path
        clock = self.assembly.changes and not self.assembly.frozen
        reason = why_not(problem, self.position, times, start, goal, clock)
        why = str(reason)
        if expansion.cut and clock:
            ends = moment(problem.departs, extent.t_hi - departure)
            ends = ends if problem.departs is not None else f"{extent.t_hi:,.0f} s"
            why = (
                f"the currents' times end at {ends}, and no way that was found gets there before; leave earlier, "
                f"or take currents that reach further; else {why}"
            )
        return replace(path, why=why, why_not=reason.as_dict(), expanded=search.tally.share)


def _in_part(first: int, later: int, finest: float, bins: float, seconds: float) -> str:
    """Return the note on a path for which not all ways that come to a node later were followed.

    `first` and `later` fans were found for the first ways and for later ways. All ways were followed in bins of
    `finest` [s], inf if in none, but not in `bins` [s]. The path takes some `seconds`.
    """
    whole = "" if math.isinf(finest) else f" and all that come {finest:,.0f} s apart"
    more = math.ceil(seconds / bins)
    return (
        f"the earliest ways to {first:,} nodes were followed, and {later:,} later ways{whole}, which lead to no "
        f"better route; who comes to a node later may still arrive earlier: query.bins = {bins:.0f} follows all "
        f"ways that come so many seconds apart, with up to {more:,} times the work"
    )
