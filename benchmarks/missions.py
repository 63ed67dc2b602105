"""What replanning is worth: campaigns of the shipped missions, and the loop without errors.

`python benchmarks/missions.py box gyre strait -o benchmarks/records/missions.json` flies 100 runs of each policy.
`ionian` needs --currents, the file that its scenario reads. The record keeps its other missions. What measured
currents are worth: `--set 'pilot.policies=["replan", "assimilate", "omniscient"]'`, and another record.
"""

import argparse
import time
from importlib.metadata import version
from pathlib import Path

from record import earlier, keep, machine

from glider_stream.base.cores import usable_cores
from glider_stream.mission.campaign import Campaign, simulate
from glider_stream.mission.run import Runner
from glider_stream.mission.settings import Mission, read_mission
from glider_stream.mission.statistics import Estimate

EXACT = [
    "forecast_error.rms_share=0.0",
    *(f"vehicle.{key}=0.0" for key in ("heading_bias_deg", "heading_error_deg", "speed_bias", "speed_error")),
    *(f"vehicle.{key}=0.0" for key in ("depth_error_m", "call_minutes", "fix_error_m", "call_failure")),
    "vehicle.steering=trims",
]
"""Nothing errs, and calls take no time."""


def without_errors(name: str, overrides: list[str]) -> dict[str, object]:
    """Return times without any error: what the plan says, and what each policy takes."""
    exact = [*overrides, *EXACT, 'pilot.policies=["open-loop", "replan"]']
    found = {outcome.policy: outcome for outcome in Runner(read_mission(name, exact)).run(0)}
    plan, loop, closed = found["open-loop"], found["open-loop"], found["replan"]
    return {
        "planned_s": plan.planned,
        "open_loop_s": loop.time if loop.arrived else None,
        "replan_s": closed.time if closed.arrived else None,
        "replan_over_plan": closed.time / plan.planned,
        "replan_over_open_loop": closed.time / loop.time,
        "replans": closed.plans,
    }


def flown(mission: Mission, runs: int, processes: int) -> tuple[Campaign, float]:
    """Return a campaign and its seconds."""
    began = time.perf_counter()
    return simulate(mission, runs, processes=processes), time.perf_counter() - began


def verdict(campaign: Campaign) -> dict[str, bool]:
    """Return whether replanning does what it should."""
    rows = {row.policy: row for row in campaign.rows}
    ours = rows["replan"]
    others = {
        f"better than {name}": _better(row.with_reference, ours.with_reference) or row.over_replan.low > 1.0
        for name, row in rows.items()
        if name not in ("replan", "assimilate", "omniscient")
    }
    return {
        "arrives in 95 % of the runs in which the omniscient does": ours.with_reference.value >= 0.95,
        "takes at most 1.10 times its time in the median": ours.over_reference.value <= 1.10,
        **others,
    }


def _better(theirs: Estimate, ours: Estimate) -> bool:
    """Return whether the intervals of two shares lie apart, ours above."""
    return ours.low > theirs.high


def main() -> None:
    """Fly the campaigns, print their tables and write the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("missions", nargs="+")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--processes", type=int, default=usable_cores())
    parser.add_argument("--currents", help="the file of currents that `ionian` reads")
    parser.add_argument("--set", action="append", default=[], help="a key of the missions to override")
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    record = earlier(asked.output)
    for name in asked.missions:
        overrides = [*asked.set, *([f"flow.file={asked.currents}"] if name == "ionian" else [])]
        campaign, seconds = flown(read_mission(name, overrides), asked.runs, asked.processes)
        print(campaign, f"\n  {seconds:.0f} s on {asked.processes} processes", flush=True)
        found = verdict(campaign)
        exact = without_errors(name, overrides)
        for what, holds in found.items():
            print(f"  {'yes' if holds else 'NO '} {what}", flush=True)
        print(f"  without errors: {exact}", flush=True)
        record[name] = {
            "software": version("glider-stream"),
            "machine": machine(),
            "runs": asked.runs,
            "seconds": round(seconds, 1),
            "processes": asked.processes,
            "forecast": campaign.forecast,
            "policies": [row.as_dict() for row in campaign.rows],
            "verdict": found,
            "without_errors": exact,
        }
        keep(record, asked.output)


if __name__ == "__main__":
    main()
