"""A roadmap's route by glider-stream, polished: another Sobol sequence of 1,000 nodes in each run."""

from harness import JOB, answer, finite, timed

from glider_stream.opened import open_scenario

seeds, found = iter(range(JOB["runs"] + 1)), []


def route():
    nodes = ["sampling.kind=sobol", "sampling.count=1000", f"sampling.seed={next(seeds)}"]
    settings = [*nodes, "neighbours.kind=reachable", "steering.method=flow-map"]
    found.append(open_scenario(JOB["scenario"], settings).query(polish=True).travel_time)


_, seconds = timed(route)
answer("glider-stream", seconds, routes_s=finite(found[1:]))
