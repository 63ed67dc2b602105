"""A roadmap's route by glider-stream, polished: another Sobol sequence of 1,000 nodes in each run."""

from harness import routes

from glider_stream.opened import open_scenario


def travel_time(scenario, seed):
    nodes = ["sampling.kind=sobol", "sampling.count=1000", f"sampling.seed={seed}"]
    settings = [*nodes, "neighbours.kind=reachable", "steering.method=flow-map"]
    return open_scenario(scenario, settings).query(polish=True).travel_time


routes("glider-stream", travel_time)
