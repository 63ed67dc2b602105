"""Large roadmaps: build, file, query, verify and plot, each as a new process: seconds and most memory.

The flow is the seed box's, as wide as its nodes need to lie 56 m apart; legs are the fastest `limit` down and up.

    python benchmarks/scale.py --nodes 1000000 --folder scale -o benchmarks/records/scale.json
"""

import math
import sys
import tomllib
from pathlib import Path

import click
import h5py
from record import earlier, keep, machine

from glider_stream.base.toml import to_toml
from glider_stream.evaluation.bench import _process as process
from glider_stream.scenario import shipped_scenarios


def wide_box(nodes, limit):
    """The seed box's scenario with more nodes, as text."""
    table = tomllib.loads(shipped_scenarios()["seed-box"].read_text())
    side = math.ceil(math.sqrt(nodes / 4))
    wider = side / 16
    half, flow = 450.0 * wider, table["flow"]
    for vortex in flow["vortex"]:
        vortex |= {name: vortex[name] * wider for name in ("x", "y", "radius")}
    flow |= {name: [-600.0 * wider, 600.0 * wider] for name in ("x", "y")}
    flow["sampled"] = [12.0 * wider, 12.0 * wider, 10.0]
    return to_toml(
        table
        | {
            "domain": {"x": [-half, half], "y": [-half, half], "z": [-300.0, 0.0]},
            "sampling": {"kind": "grid", "shape": [side, side, 4]},
            "neighbours": {"kind": "reachable", "limit": limit},
            "steering": {"method": "flow-map"},
            "query": {"start": [-half, half, 0.0], "goal": [half, -half, 0.0]},
        }
    )


@click.command()
@click.option("--nodes", default=1_000_000)
@click.option("--limit", default=32)
@click.option(
    "--runs", default=5, help="Runs of all commands but the build; the median counts, with the extremes."
)
@click.option(
    "--folder", type=click.Path(path_type=Path), required=True, help="Where the roadmap is, or is built."
)
@click.option("-o", "--output", type=click.Path(path_type=Path))
def main(nodes, limit, runs, folder, output):
    """Build the roadmap if the folder does not hold it, and ask it."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario, road = folder / f"wide-{nodes}.toml", folder / f"wide-{nodes}.h5"
    scenario.write_text(wide_box(nodes, limit))
    found = earlier(output)
    mine = found.setdefault(f"{nodes:,} nodes", {})
    if not road.exists():
        seconds, megabytes = process("build", scenario, "-o", road)
        mine["build"] = {"s": seconds, "MB": megabytes}
    with h5py.File(road) as file:
        mine["edges"], mine["bytes"] = len(file["edges/target"]), road.stat().st_size
    commands = {"query": [], "verify": ["--sample", 200], "plot": ["-o", folder / "road.png"], "info": []}
    for name, options in commands.items():
        measured = [process(name, road, *options) for _ in range(runs)]
        seconds, megabytes = (sorted(column) for column in zip(*measured, strict=True))
        mine[name] = {"s": [seconds[0], seconds[runs // 2], seconds[-1]], "MB": megabytes[-1]}
        print(name, mine[name], file=sys.stderr, flush=True)
    found["machine"] = machine()
    print(keep(found, output))


if __name__ == "__main__":
    main()
