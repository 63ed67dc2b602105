"""A small mission in the small scenario of `helpers.small`, for the tests of missions."""

import tomllib
from functools import cache
from pathlib import Path

from glider_stream.mission.run import Runner
from glider_stream.mission.settings import mission_from_table
from helpers.small import SCENARIO

MISSION = """\
[scenario]
name = "small.toml"
set = ["steering.method=flow-map", "neighbours.kind=reachable", "sampling.shape=[7, 7, 3]"]

[forecast_error]
rms_share = 0.3
length_m = 100.0
depth_m = "all"
time_s = "steady"

[vehicle]
steering = "trims"
heading_bias_deg = 2.0
heading_error_deg = 2.0
speed_bias = 0.02
speed_error = 0.02
depth_error_m = 1.0
call_minutes = 0.5
fix_error_m = 2.0
call_failure = 0.1
waypoint_radius_m = 30.0

[pilot]
policies = ["open-loop", "replan", "straight", "depth-averaged", "omniscient"]
most_hours = 0.08

[arrival]
radius_m = 40.0
longest_hours = 2.0

[energy]
preset = "slocum"

[random]
seed = 7
"""
EXACT = {
    "forecast_error.rms_share": 0.0,
    "vehicle.heading_bias_deg": 0.0,
    "vehicle.heading_error_deg": 0.0,
    "vehicle.speed_bias": 0.0,
    "vehicle.speed_error": 0.0,
    "vehicle.depth_error_m": 0.0,
    "vehicle.call_minutes": 0.0,
    "vehicle.fix_error_m": 0.0,
    "vehicle.call_failure": 0.0,
}
"""Nothing errs, and calls take no time."""


def write_mission(folder):
    """Write the mission and its scenario into a folder; return the mission's file."""
    (folder / "small.toml").write_text(SCENARIO)
    (folder / "small-mission.toml").write_text(MISSION)
    return folder / "small-mission.toml"


def mission(folder, changes=(), overrides=()):
    """The small mission, with some values section.key changed; `overrides` are texts for its scenario."""
    file = Path(folder) / "small-mission.toml"
    if not file.exists():
        write_mission(Path(folder))
    table = tomllib.loads(MISSION)
    for place, value in dict(changes).items():
        section, key = place.split(".")
        table[section][key] = value
    return mission_from_table(table, file, overrides)


@cache
def runner(folder, changes=()):
    """The runner of the small mission; `changes` are pairs of section.key and value."""
    return Runner(mission(folder, changes))
