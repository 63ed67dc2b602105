"""FMT* on the paper's legs, 16 controls: another Sobol sequence of 1,000 places in each run."""

from harness import routes

from glider_stream.evaluation.fmt_star import fmt_star
from glider_stream.scenario import read_scenario

STEERING = ["steering.method=streamline", "steering.candidates=16"]
routes(
    "glider-stream",
    lambda scenario, seed: fmt_star(read_scenario(scenario, STEERING).problem(), 1000, seed).travel_time,
)
