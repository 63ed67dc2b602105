"""Drift by glider-stream: legs without a glide, in the flow as planners read it."""

import numpy as np
from harness import JOB, answer, starts, timed

from glider_stream.kernels.legs import fly_legs
from glider_stream.scenario import read_scenario

lon, lat, depth = starts()
box = [f"domain.{name}=[{values.min()},{values.max()}]" for name, values in (("lon", lon), ("lat", lat))]
problem = read_scenario("ionian", [f"flow.file={JOB['currents']}", *box]).problem()
frame = problem.domain.frame()
x, y = frame.to_local(lon, lat)
start = np.column_stack([x, y, -depth, np.full(x.size, problem.departure)])
still, lasting, end = np.zeros((x.size, 3)), np.full(x.size, JOB["lasting_s"]), np.empty((x.size, 3))


def drift():
    fly_legs(
        problem.evaluator.flow, start, still, lasting, -depth, JOB["lasting_s"], JOB["step_s"], end, 0, x.size
    )
    return frame.to_lonlat(end[:, 0], end[:, 1])


ends, seconds = timed(drift)
answer("glider-stream", seconds, ends=ends)
