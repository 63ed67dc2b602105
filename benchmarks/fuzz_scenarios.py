"""Random legal scenarios: built, flown again and queried, each of which must keep every promise.

    python benchmarks/fuzz_scenarios.py --count 2000 --log fuzz.jsonl

Scenario n is made from the seed n alone. Of each: no crash and no NaN; the same bits for any threads, batches
and shards; every edge within its tolerance when DOP853 flies it; every query as cheap as Dijkstra's algorithm of
networkx finds it in the file. In a flow that changes, a route of exact legs that DOP853 flies from end to end
meets its goal, and a roadmap in memory and one that stays in its file give the same route. The log has a line for
each scenario; the same command goes on where it stopped. Exit code 1 if one ever broke a promise. The first
`COMMON` use one kind of flow in the kernels, so that tests compile little.
"""

import argparse
import json
import math
import sys
import tempfile
import time
import traceback
from pathlib import Path

import h5py
import networkx
import numpy as np
from end_to_end import replayed

from glider_stream.base.errors import InputError
from glider_stream.jobs.build import Job, build_file, merge
from glider_stream.jobs.build import Shard as Part
from glider_stream.roadmap import verify
from glider_stream.roadmap.slices import SlicedRoadmap
from glider_stream.roadmap.store import read_any_roadmap, stored_roadmap
from glider_stream.roadmap.verify import MOST_OFF, replayed_misses
from glider_stream.scenario import scenario_from_table
from glider_stream.search.answer import planner_of, planner_on_demand
from glider_stream.search.query import Planner
from glider_stream.search.surfacing import Surfacing
from glider_stream.water.inspect import is_steady

verify.LEGS_AT_ONCE = 500  # a step costs the same for one leg and for many
COMMON = 30
MEMORY = Path("/dev/shm")
"""Files are made here where the system has it: a disk that must keep each of them is slow."""
OFF = 1.0
"""A route of exact legs in a flow that changes ends at most so far from its goal [m]."""
GOALS = 6
"""Goals that are asked for in each roadmap, from one start."""


def made(number):
    """The table of scenario `number`."""
    dice = np.random.default_rng(number)
    few = number < COMMON
    pick = lambda *choices: choices[dice.integers(len(choices))]  # noqa: E731
    side, deep = float(dice.uniform(60, 300)), float(dice.uniform(60, 200))
    nodes = int(dice.integers(6, 24 if few else 60))
    tolerance, steps = float(dice.uniform(3, 12)), int(dice.integers(60, 140))
    method = pick("surface", "streamline", "refine", "flow-map", "flow-map", "reachable")
    flow = _flow(dice, pick, side, deep, few)
    return {
        "flow": flow,
        "glider": {"preset": "paper" if few else pick("paper", "slocum", "seaglider")},
        "domain": {"x": [-side, side], "y": [-side, side], "z": [-deep, 0.0]},
        "sampling": _sampling(dice, pick, nodes, deep, side),
        "neighbours": _law(dice, pick, method, side),
        "steering": _steering(dice, method),
        "integration": {"dt": float(pick(2.0, 3.5, 5.0)), "steps": steps, "tolerance": tolerance},
        "cost": pick(
            {"kind": "time"}, {"kind": "energy", "preset": "slocum", "trim": float(dice.uniform(0, 20))}
        ),
        **({} if few else _departures(dice, pick, flow)),
    }


def _changes(flow):
    """Whether a table of a flow is one that changes with time."""
    drifts = any("drift" in vortex for vortex in flow.get("vortex", []))
    return drifts or flow["kind"] == "tidal-jet" or flow.get("epsilon", 0.0) > 0


def _departures(dice, pick, flow):
    """Slices, in half of the flows that change; the flow's times hold all of them."""
    every, count = float(dice.uniform(50, 900)), int(dice.integers(0, 4))
    if not _changes(flow) or dice.random() < 0.5 or every * count > flow.get("times", [0.0, math.inf])[1]:
        return {}
    return {"departures": {"first": 0.0, "last": every * count, "every": every}}


def _flow(dice, pick, side, deep, few):
    kinds = "uniform", "vortices", "vortices", "single-gyre", "rankine", "jet", "double-gyre"
    kind = pick(*kinds) if few else pick(*kinds, "double-gyre", "tidal-jet", "tidal-jet")
    speed = float(pick(0.0, 1e-6, 1e-3, *dice.uniform(0.01, 1.2, 4)) * pick(-1, 1))
    if kind == "double-gyre" and few:
        kind = "single-gyre"
    table = {
        "uniform": lambda: {"u": speed, "v": float(dice.uniform(-0.3, 0.3))},
        "vortices": lambda: {"vortex": [_vortex(dice, side, deep) for _ in range(dice.integers(1, 5))]},
        "single-gyre": lambda: {"amplitude": speed / 4, "length": 4 * side, "origin": [-2 * side, -2 * side]},
        "double-gyre": lambda: {
            "amplitude": speed / 4, "length": 4 * side, "epsilon": float(pick(0.0, 0.25)), "period": 5000.0,
            "origin": [-4 * side, -2 * side],
        },
        "rankine": lambda: {
            "x_centre": float(dice.uniform(-side, side)), "y_centre": 0.0,
            "radius": float(dice.uniform(80, 300)), "speed": speed,
        },
        "jet": lambda: {"y_centre": 0.0, "width": float(dice.uniform(200, 600)), "speed": speed},
        "tidal-jet": lambda: {
            "y_centre": 0.0, "width": float(dice.uniform(200, 600)), "speed": speed,
            "period": float(dice.uniform(600, 44_714)), "peak": float(dice.uniform(-3000, 3000)),
        },
    }[kind]()  # fmt: skip
    if kind == "vortices" and not few and dice.random() < 0.5:
        for vortex in table["vortex"]:
            vortex["drift"] = dice.uniform(-0.4, 0.4, 2).tolist()
    flow = {"kind": kind, **table}
    if _changes(flow):
        return flow | ({"times": [0.0, float(dice.uniform(200, 4000))]} if dice.random() < 0.5 else {})
    # a kink of these fields is no matter of a grid
    even = kind not in ("double-gyre",)
    sampled = {"sampled": [25.0, 25.0, 25.0]} if even and (few or dice.random() < 0.4) else {}
    return flow | sampled


def _vortex(dice, side, deep):
    vortex = {
        "x": float(dice.uniform(-side, side)),
        "y": float(dice.uniform(-side, side)),
        "radius": float(dice.uniform(80, 300)),
        "speed": float(dice.uniform(-0.5, 0.5)),
    }
    if dice.random() < 0.5:
        vortex |= {"depth": float(dice.uniform(0, deep)), "thickness": float(dice.uniform(80, 300))}
    return vortex


def _sampling(dice, pick, nodes, deep, side):
    kind = pick("grid", "uniform", "sobol", "halton", "yo")
    if kind == "grid":
        return {
            "kind": kind,
            "shape": [int(dice.integers(1, 4)), int(dice.integers(1, 4)), int(dice.integers(1, 5))],
        }
    if kind == "yo":
        depths = [0.0, deep] if dice.random() < 0.5 else [0.0, deep / 2, deep]
        return {"kind": kind, "depths": depths, "spacing": float(side * dice.uniform(0.6, 1.2))}
    return {"kind": kind, "count": nodes, "seed": int(dice.integers(1000))}


def _law(dice, pick, method, side):
    if method == "reachable":
        return {"kind": "reachable", "limit": int(pick(0, 3, 10))}
    return pick(
        {"kind": "nearest", "k": int(dice.integers(1, 20))},
        {"kind": "nearest", "k": "prm*"},
        {"kind": "radius", "radius": float(side * dice.uniform(0.5, 1.5))},
        {"kind": "all"},
    )


def _steering(dice, method):
    if method in ("flow-map", "reachable"):
        return {"method": "flow-map"}
    if method == "refine":
        return {"method": "streamline", "candidates": int(dice.integers(4, 30)), "refine": True}
    return {"method": method, "candidates": int(dice.integers(4, 60))}


def broken(number, folder):
    """What scenario `number` breaks, "" if nothing; and how many edges it has."""
    problem = scenario_from_table(made(number), folder).problem()
    file = folder / f"{number}.h5"
    build_file(problem, file, 1)
    road = read_any_roadmap(file)
    others = {"threads and batches": folder / "batches.h5", "shards": folder / "shards.h5"}
    build_file(problem, others["threads and batches"], batch_pairs=int(3 + number % 50))
    parts = [folder / f"part{n}.h5" for n in (1, 2)]
    for n, part in enumerate(parts, 1):
        build_file(problem, part, 1, job=Job(shard=Part(n, 2)))
    merge(parts, others["shards"])
    for what, other in others.items():
        if datasets(other) != datasets(file):
            return f"{what} change bits", road.target.size
    if not all(np.isfinite(value).all() for value in values_of(road)):
        return "a value is not finite", road.target.size
    sliced = isinstance(road, SlicedRoadmap)
    by_row = road.row_counts if sliced else road.node_counts
    if sum(road.counts.values()) != int(by_row.sum()) or road.counts["connected"] != road.target.size:
        return "the pairs are not counted", road.target.size
    wrong = clock_wrong(problem, road, number) if not is_steady(problem.evaluator.flow) else ""
    if sliced:
        slices = enumerate(road.departures)
        wrong = wrong or next(filter(None, (flown_wrong(leaving(problem, t), road.at(n)) for n, t in slices)), "")
        return wrong, road.target.size
    return wrong or flown_wrong(problem, road) or asked_wrong(problem, road, number), road.target.size


def leaving(problem, departure):
    """The problem at another departure [s]."""
    return problem.leaving(float(departure) - problem.departure)


def datasets(path):
    """The bytes of every dataset."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, one: found.update({name: one[()].tobytes()} if hasattr(one, "dtype") else {})
        )
    return found


def values_of(road):
    """Everything that a roadmap holds of nodes and edges."""
    return road.position, road.time, road.cost, road.glide_angle, road.heading, road.speed, road.miss


def flown_wrong(problem, road):
    """Whether an edge misses its tolerance by DOP853, or takes no time."""
    if not road.target.size:
        return ""
    source = np.repeat(np.arange(len(road.position)), np.diff(road.indptr))
    values = np.column_stack(values_of(road)[1:])
    misses = replayed_misses(
        problem.evaluator, problem.departure, road.position, source, road.target.astype(np.int64), values
    )
    tolerance = problem.evaluator.integration.tolerance
    if not (road.time > 0).all():
        return "a leg takes no time"
    worst = int(np.argmax(misses))
    if not misses[worst] <= (1 + MOST_OFF) * tolerance:
        return f"edge {worst} misses by {misses[worst]:.3g} m, the tolerance is {tolerance:.3g} m"
    return ""


def clock_wrong(problem, road, number):
    """Whether a route with the clock running misses its goal, or the roadmap's file gives another one."""
    dice, whole = np.random.default_rng(number), planner_of(problem, road, Surfacing())
    by_file = planner_on_demand(problem, stored_roadmap(road.file), Surfacing())
    start, goals = int(dice.integers(len(road.position))), dice.integers(len(road.position), size=2)
    for goal in goals:
        ends = road.position[start], road.position[goal]
        path, other = (planner.query(*ends) for planner in (whole, by_file))
        if path.as_dict() != other.as_dict():
            return f"the route from {start} to {goal} is another one by the roadmap's file"
        if not path.legs or not problem.evaluator.exact:
            continue
        away = float(np.linalg.norm(replayed(problem.evaluator.flow, path.as_dict())[-1] - ends[1]))
        if not away <= OFF:
            return f"the route from {start} to {goal} ends {away:.3g} m from its goal"
    return ""


def asked_wrong(problem, road, number):
    """Whether a query costs another sum than the shortest way that networkx finds over the file's edges."""
    if not is_steady(problem.evaluator.flow):
        return ""  # there the clock runs along the way
    dice = np.random.default_rng(number)
    nodes = len(road.position)
    start, goals = int(dice.integers(nodes)), dice.integers(nodes, size=GOALS)
    graph = graph_of(problem, road)
    least = networkx.single_source_dijkstra_path_length(graph, (start, 0))
    paths = Planner(road, problem).queries(road.position[start], [road.position[goal] for goal in goals])
    for goal, path in zip(goals, paths, strict=True):
        if goal == start or same_place(road, start, goal):
            continue
        wanted = min(least.get((int(goal), phase), math.inf) for phase in (0, 1))
        found = path.cost if path.found else math.inf
        if not (found == wanted or math.isclose(found, wanted, rel_tol=1e-9)):
            return f"the query from {start} to {goal} costs {found!r}, networkx finds {wanted!r}"
    return ""


def same_place(road, one, other):
    """Whether two nodes lie at one point."""
    return bool((road.position[one] == road.position[other]).all())


def graph_of(problem, road):
    """A roadmap as a graph of nodes and phases: come to by a dive, or nothing, (n, 0); by a climb (n, 1)."""
    graph = networkx.DiGraph()
    graph.add_nodes_from((n, phase) for n in range(len(road.position)) for phase in (0, 1))
    turns = problem.evaluator.cost.inflection(road.position[:, 2])
    for node in range(len(road.position)):
        for edge in range(road.indptr[node], road.indptr[node + 1]):
            climbs = bool(road.glide_angle[edge] > 0)
            for phase in (0, 1):
                turn = float(turns[node]) if turns is not None and climbs and phase == 0 else 0.0
                to = (int(road.target[edge]), int(climbs))
                graph.add_edge((node, phase), to, weight=float(road.cost[edge]) + turn)
    return graph


def tried(number):
    """A line of the log."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        try:
            fault, edges = broken(number, Path(folder))
        except InputError as error:
            # no node in the water that is known, a step too coarse for the current: refused, and said why
            fault, edges = "", f"refused: {error}"
        except Exception:
            fault, edges = traceback.format_exc(limit=-3), 0
    return {"number": number, "fault": fault, "edges": edges, "seconds": round(time.monotonic() - began, 3)}


def main():
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--count", type=int, default=2000)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--log", type=Path, default=Path("fuzz.jsonl"))
    options.add_argument("--seconds", type=float, default=math.inf, help="stop, to go on another time")
    asked = options.parse_args()
    lines = [json.loads(line) for line in asked.log.read_text().splitlines()] if asked.log.exists() else []
    done = {line["number"] for line in lines}
    began = time.monotonic()
    with asked.log.open("a") as log:
        for number in range(asked.first, asked.first + asked.count):
            if number in done:
                continue
            if time.monotonic() - began > asked.seconds:
                break
            line = tried(number)
            lines.append(line)
            log.write(json.dumps(line) + "\n")
            log.flush()
            if line["fault"]:
                print(f"{number}: {line['fault']}", flush=True)
    bad = [line["number"] for line in lines if line["fault"]]
    refused = sum(isinstance(line["edges"], str) for line in lines)
    edges = sum(line["edges"] for line in lines if not isinstance(line["edges"], str))
    print(f"{len(lines):,} scenarios, {edges:,} edges, {refused} refused; {len(bad)} broke a promise: {bad[:20]}")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
