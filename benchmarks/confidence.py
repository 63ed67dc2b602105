"""Whether routes arrive as often as is said: chosen by some members of an ensemble, flown in others.

`python benchmarks/confidence.py strait box gyre -o benchmarks/records/confidence.json`: for each mission, routes
are planned and chosen in 30 draws of the forecast's error, then flown in 200 others by the simulator of missions.
"""

import argparse
import json
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
from record import earlier, keep, machine

from glider_stream.mission.confidence.candidates import Search
from glider_stream.mission.confidence.ensemble import drawn
from glider_stream.mission.confidence.judged import Criterion, best_of, checked, fly
from glider_stream.mission.settings import read_mission

HELD_OUT = 1_000_000
"""The number of the first draw that had no part in a choice."""


def measured(name: str, members: int, held_out: int, quantile: float) -> dict[str, object]:
    """Return what was promised, and what came true, for one mission."""
    began = time.process_time()
    mission = read_mission(name)
    limit = mission.arrival.longest
    ensemble = drawn(mission, members)
    candidates = Search(ensemble).candidates(replanned=False)
    flights = fly(ensemble, candidates)
    times = np.array([each.time for each in flights])
    criteria = {f"{quantile:.0%}": Criterion(limit, quantile), "mean": Criterion(limit)}
    chosen = {what: best_of(times, criterion) for what, criterion in criteria.items()}
    sure = criteria[f"{quantile:.0%}"]
    promised = sure.promised(times[chosen[f"{quantile:.0%}"]])
    kept = {what: candidates[n] for what, n in chosen.items()} | {"fastest in the forecast": candidates[0]}
    others = drawn(mission, held_out, HELD_OUT)
    distinct = list({candidate.name: candidate for candidate in kept.values()}.values())
    flown = {each.candidate.name: each for each in fly(others, distinct)}
    check = checked(flights, sure)
    return {
        "software": version("glider-stream"),
        "machine": machine(),
        "members": members,
        "held_out": held_out,
        "candidates": len(candidates),
        "promised_share": quantile,
        "promised_by_s": promised,
        "checked_among_members": None if check is None else check.as_list(),
        "routes": {
            what: {
                "name": candidate.name,
                "members_by_then": next(
                    each.arrived(promised).as_list() for each in flights if each.candidate is candidate
                ),
                "held_out_by_then": flown[candidate.name].arrived(promised).as_list(),
                "held_out_ever": flown[candidate.name].arrived().as_list(),
                "held_out_mean_s": float(np.minimum(flown[candidate.name].time, limit).mean()),
            }
            for what, candidate in kept.items()
        },
        "cpu_seconds": round(time.process_time() - began, 1),
    }


def main() -> None:
    """Measure, print and write the record, which keeps its other missions."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("missions", nargs="+")
    parser.add_argument("--members", type=int, default=30)
    parser.add_argument("--held-out", type=int, default=200)
    parser.add_argument("--quantile", type=float, default=0.9)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    record = earlier(asked.output)
    for name in asked.missions:
        record[name] = found = measured(name, asked.members, asked.held_out, asked.quantile)
        print(name, json.dumps(found, indent=1), flush=True)
        keep(record, asked.output)


if __name__ == "__main__":
    main()
