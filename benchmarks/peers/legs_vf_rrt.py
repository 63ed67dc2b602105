"""VF-RRT on exact legs, steps of 150 m: other random places in each run."""

from harness import routes

from glider_stream.evaluation.vector_field_rrt import vf_rrt
from glider_stream.scenario import read_scenario

STEERING = ["steering.method=flow-map"]
routes(
    "glider-stream",
    lambda scenario, seed: vf_rrt(read_scenario(scenario, STEERING).problem(), 150.0, seed=seed).travel_time,
)
