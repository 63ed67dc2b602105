"""FMT* on exact legs: another Sobol sequence of 1,000 places in each run."""

from harness import routes

from glider_stream.evaluation.fmt_star import fmt_star
from glider_stream.scenario import read_scenario

STEERING = ["steering.method=flow-map"]
routes(
    "glider-stream",
    lambda scenario, seed: fmt_star(read_scenario(scenario, STEERING).problem(), 1000, seed).travel_time,
)
