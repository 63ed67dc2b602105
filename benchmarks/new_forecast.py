"""A new forecast that differs in a tenth of the domain: `build --from` against a fresh build.

    python benchmarks/new_forecast.py CURRENTS.nc

The current file (uo, vo on longitude, latitude) is copied, halved in a corner of a domain of 100 km of the
`ionian` scenario. What a change can affect reaches a cell of the file and a horizon's way further than itself.
Exit code 1 unless both roadmaps are the same to the bit, and the update took at most a third of the time.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import xarray as xr

from glider_stream import planner
from glider_stream.roadmap.compare import difference
from glider_stream.scenario import read_scenario


def main():
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("currents")
    options.add_argument("--nodes", default="[220,235,2]", help="sampling.shape of the scenario")
    asked = options.parse_args()
    wide = ["domain.lon=[17.7,18.85]", "domain.lat=[37.2,38.2]"]
    wide += ["sampling.kind=grid", f"sampling.shape={asked.nodes}"]
    domain = read_scenario("ionian", [*wide, f"flow.file={asked.currents}"]).domain
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        with xr.open_dataset(asked.currents, decode_times=False) as data:
            # a tenth of the domain: its south-western corner, nearly a third each way
            share = 0.1**0.5
            lon, lat = (side[0] + share * (side[1] - side[0]) for side in (domain.lon, domain.lat))
            corner = (data.longitude < lon) & (data.latitude < lat)
            data.assign({name: data[name].where(~corner, 0.5 * data[name]) for name in ("uo", "vo")}).to_netcdf(
                place / "new.nc", engine="h5netcdf"
            )
        planner.build("ionian", place / "old.h5", overrides=[*wide, f"flow.file={asked.currents}"])
        sets = [*wide, f"flow.file={place / 'new.nc'}"]
        seconds = []
        for name, job in (("fresh", {}), ("update", {"base": place / "old.h5"})):
            began = time.perf_counter()
            planner.build("ionian", place / f"{name}.h5", overrides=sets, **job)
            seconds.append(time.perf_counter() - began)
        fresh, update = (planner.info(place / f"{name}.h5") for name in ("fresh", "update"))
        same = difference(fresh, update).same_edges and fresh.counts == update.counts
        changed = not difference(planner.info(place / "old.h5"), fresh).same_edges
    print(
        f"{len(fresh.position):,} nodes, {fresh.target.size:,} edges; the change shows: {changed}; same: {same}"
    )
    print(f"fresh {seconds[0]:.1f} s, update {seconds[1]:.1f} s: {seconds[1] / seconds[0]:.2f} of it")
    sys.exit(0 if same and changed and seconds[1] <= seconds[0] / 3 else 1)


if __name__ == "__main__":
    main()
