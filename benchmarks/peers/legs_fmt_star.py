"""FMT* on exact legs: another Sobol sequence of 1,000 places in each run."""

from harness import JOB, answer, finite, timed

from glider_stream.evaluation.fmt_star import fmt_star
from glider_stream.scenario import read_scenario

STEERING = "flow-map"
seeds, found = iter(range(JOB["runs"] + 1)), []


def route():
    problem = read_scenario(JOB["scenario"], [f"steering.method={STEERING}"]).problem()
    found.append(fmt_star(problem, 1000, next(seeds)).travel_time)


_, seconds = timed(route)
answer("glider-stream", seconds, routes_s=finite(found[1:]))
