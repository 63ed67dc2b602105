"""What slices cost and lose against fans, and what a query over them takes: `slices.py [SCENARIO] [--set ..]`."""

import time
from dataclasses import replace
from statistics import median

import click
import numpy as np
from end_to_end import replayed

import glider_stream
from glider_stream.base.threads import threads
from glider_stream.kernels.edges import CONNECTED, STATUS, TIME
from glider_stream.roadmap.builder import build_slices, node_positions, warm_up
from glider_stream.roadmap.follow import Follower
from glider_stream.scenario import read_scenario
from glider_stream.search.slice_planner import SlicePlanner
from glider_stream.search.sliced import SliceSearch
from glider_stream.search.time_dependent import ClockPlanner

TIMES = 3
"""How often each slice is made; the least processor time counts."""


def edges(found, nodes):
    """A number for each edge, by its row and target, and its time."""
    row = np.repeat(np.arange(len(found.indptr) - 1), np.diff(found.indptr))
    met = found.outcomes[:, STATUS] == CONNECTED
    return (row * nodes + found.target)[met], found.outcomes[met, TIME]


def timed(work):
    """What some work makes, and the processor time [s] that it takes."""
    began = time.process_time()
    made = work()
    return made, time.process_time() - began


def compare(problem, position, every):
    """Each slice of some nodes by following and by fans: edges, time; processor time of both, in one run."""
    source = np.arange(0, len(position), every)
    chains = [Follower.of(problem, position).slices(source) for _ in range(TIMES)]
    costs = []
    for departure in problem.departures:
        legs = replace(problem, departure=departure, slices=()).legs(position)
        pairs = [(timed(lambda one=one: next(one)), timed(lambda legs=legs: legs.of(source))) for one in chains]
        followed, fan = pairs[0][0][0], pairs[0][1][0]
        follows, fans = (min(pair[n][1] for pair in pairs) for n in range(2))
        costs.append(follows / fans)
        (mine, my_times), (theirs, their_times) = (edges(one, len(position)) for one in (followed, fan))
        both, a, b = np.intersect1d(mine, theirs, return_indices=True)
        later = my_times[a] - their_times[b]
        print(
            f"{departure:9.0f} s: {theirs.size:,} edges by fans, {1 - both.size / theirs.size:.2%} of them not "
            f"followed, {1 - both.size / mine.size:.2%} followed alone; {np.mean(later > 1):.2%} more than 1 s "
            f"later; cost {costs[-1]:.2f}"
        )
    print(f"a further slice costs {np.mean(costs[1:]):.2f} of one by fans")


def ask(planner, count, compared, reserve):
    """Queries between random nodes at random departures: seconds each; some flown, and compared."""
    random = np.random.default_rng(0)
    road = planner.slices
    planner.query(road.position[-2], road.position[-1])
    took, missed, slower, alone = [], [], [], []
    for number in range(count):
        start, goal = road.position[random.choice(len(road.position), 2, replace=False)]
        since = random.uniform(road.departures[0], road.departures[-1] - reserve) - planner.problem.departure
        began = time.perf_counter()
        path = planner.leaving(since).query(start, goal)
        took.append(time.perf_counter() - began)
        if number >= compared or not path.found:
            continue
        missed.append(float(np.linalg.norm(replayed(planner.problem.evaluator.flow, path.as_dict())[-1] - goal)))
        began = time.perf_counter()
        other = ClockPlanner(planner.leaving(since).problem, road.position).query(start, goal)
        alone.append(time.perf_counter() - began)
        slower.append(path.travel_time / other.travel_time - 1)
        print(f"  {path.travel_time:,.1f} s, without slices {other.travel_time:,.1f} s; {'; '.join(path.notes)}")
    print(f"{count} queries: {median(took):.3f} s, {max(took):.3f} s at most")
    if missed:
        print(
            f"{len(missed)} of them flown by DOP853: {max(missed):.2g} m from the goal at most; slower than "
            f"without slices by {np.mean(slower):.3%} on average, {max(slower):.2%} at most, {min(slower):.2%} "
            f"at least; without slices {median(alone):.2f} s"
        )


@click.command()
@click.argument("scenario", default="swinging-gyre")
@click.option("--set", "overrides", multiple=True)
@click.option("--first", default=0.0)
@click.option("--last", default=44714.0)
@click.option("--count", default=24, help="Slices.")
@click.option("--every", default=12, help="One node in so many is compared; 0 for none.")
@click.option("--queries", default=20, help="Queries over the whole roadmap; 0 for none.")
@click.option("--compared", default=0, help="So many of them are flown, and found again without slices.")
@click.option("--reserve", default=5000.0, help="Queries leave so long before the last slice [s].")
@click.option("--roadmap", help="A roadmap file that is queried instead of building one.")
def main(scenario, overrides, first, last, count, every, queries, compared, reserve, roadmap):
    """Compare, build and ask."""
    if roadmap:
        began = time.perf_counter()
        opened = glider_stream.open(roadmap)
        problem, road = opened.problem, opened.roadmap
        print(f"read in {time.perf_counter() - began:.1f} s")
        print(road)
        ask(opened.planner(), queries, compared, reserve)
        return
    problem = read_scenario(scenario, overrides).problem()
    problem = replace(problem, slices=tuple(np.linspace(first, last, count).tolist()))
    position = node_positions(problem)
    warm_up(problem)
    if every:
        with threads(1):
            compare(problem, position, every)
    if queries:
        road = build_slices(problem)
        print(f"{len(position):,} nodes, {count} slices, {road.target.size:,} edges in {road.wall_s:.1f} s")
        ask(SlicePlanner(problem, SliceSearch(road, problem)), queries, compared, reserve)


if __name__ == "__main__":
    main()
