"""Routes of the suite's problems against their bounds: as they are found, polished, and refined.

Every problem that has a path is solved as it is shipped, with exact legs; legs of a flow that changes leave when
the last one arrives. No route may be faster than the problem's bound in data/references.json.

    python benchmarks/suite_routes.py -o benchmarks/records/suite_routes.json
    python benchmarks/suite_routes.py --routes benchmarks/records/suite_routes.json -o ...

With `--routes` the routes are those of an earlier record, compared with the bounds and references of today.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from record import keep, machine

from glider_stream.base.threads import threads
from glider_stream.evaluation.suite import LAW, Reference, references
from glider_stream.opened import open_scenario
from glider_stream.water.inspect import is_steady

WAYS: dict[str, dict[str, Any]] = {
    "found": {},
    "polished": {"polish": True},
    "refined": {"polish": True, "within": 0.01},
}
CLOSE = 1.02
"""A route is close to its bound if it takes at most this multiple of it."""
ROUNDING = 0.02
"""Closed forms are written with two digits, and a leg may end a centimetre short: this many seconds."""


def routes(name: str, known: Reference) -> dict[str, Any]:
    """One problem's routes: travel time [s], legs, processor time [s], over bound and over reference."""
    problem = open_scenario(name, [LAW, "steering.method=flow-map"])
    row: dict[str, Any] = {
        "problem": name,
        "changes": not is_steady(problem.problem.evaluator.flow),
        "nodes": len(problem.position),
    }
    for way, asked in WAYS.items():
        began = time.process_time()
        path = problem.query(**asked)
        row[way] = {
            "travel_time_s": round(path.travel_time, 2),
            "legs": len(path.legs),
            "processor_s": round(time.process_time() - began, 2),
        }
    return compared(row, known)


def compared(row: dict[str, Any], known: Reference) -> dict[str, Any]:
    """One problem's routes beside its bound and its reference."""
    assert known.bound is not None
    assert known.seconds is not None
    for way in WAYS:
        seconds = row[way]["travel_time_s"]
        row[way] |= {
            "over_bound": round(seconds / known.bound, 4),
            "over_reference": round(seconds / known.seconds, 4),
            "faster_than_bound": seconds < known.bound - ROUNDING,
        }
    return row | {"bound_s": known.bound, "reference_s": known.seconds}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How many routes are within 2 % of bound and reference, and how many are faster than the bound."""
    result: dict[str, Any] = {"problems": len(rows), "of_which_change": sum(row["changes"] for row in rows)}
    for way in WAYS:
        result[way] = {
            "within_2_percent_of_bound": sum(row[way]["over_bound"] <= CLOSE for row in rows),
            "within_2_percent_of_reference": sum(row[way]["over_reference"] <= CLOSE for row in rows),
            "faster_than_bound": sum(row[way]["faster_than_bound"] for row in rows),
        }
    return result


def main() -> None:
    """Read the arguments, solve, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", help="a problem; again for more")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file to keep the result in")
    parser.add_argument("--routes", type=Path, help="a record whose routes are compared, instead of solving")
    args = parser.parse_args()
    known = {name: one for name, one in references().items() if one.seconds is not None}
    if args.routes:
        record = json.loads(args.routes.read_text())
        where, rows = record["machine"], [compared(row, known[row["problem"]]) for row in record["routes"]]
    else:
        rows = []
        with threads(None) as count:
            for name, one in known.items():
                if not args.only or name in args.only:
                    rows.append(routes(name, one))
                    print(rows[-1], file=sys.stderr, flush=True)
        where = machine(count)
    print(keep({"machine": where, "summary": summary(rows), "routes": rows}, args.output))


if __name__ == "__main__":
    main()
