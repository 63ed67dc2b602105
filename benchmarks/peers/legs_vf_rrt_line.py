"""VF-RRT on the paper's legs, 16 controls, steps of 150 m: other random places in each run."""

from harness import JOB, answer, finite, timed

from glider_stream.evaluation.vector_field_rrt import vf_rrt
from glider_stream.scenario import read_scenario

STEERING = "streamline"
seeds, found = iter(range(JOB["runs"] + 1)), []


def route():
    problem = read_scenario(JOB["scenario"], [f"steering.method={STEERING}"]).problem()
    found.append(vf_rrt(problem, 150.0, seed=next(seeds)).travel_time)


_, seconds = timed(route)
answer("glider-stream", seconds, routes_s=finite(found[1:]))
