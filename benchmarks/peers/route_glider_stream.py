"""A route by glider-stream: a glider whose best horizontal speed is the vehicle's, dives of 200 m."""

from harness import JOB, answer, timed

from glider_stream.opened import open_scenario


def route():
    return open_scenario("ionian", JOB["settings"]).query(polish=True)


path, seconds = timed(route)
answer("glider-stream", seconds, route_s=path.travel_time, legs=len(path.legs))
