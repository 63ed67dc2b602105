"""A route on the globe, as exports and their readers take it."""

import math
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

from glider_stream.search.path import Leg, Path
from glider_stream.water.frame import LocalFrame

FRAME = LocalFrame(lon=18.5, lat=38.0)

DEPARTS = datetime(2024, 11, 20, 12, 0, 0, tzinfo=UTC)

STOPS = ([0.0, 0.0, 0.0], [900.0, 300.0, -200.0], [1800.0, 700.0, -2.0], [2500.0, 900.0, -150.0])


def lonlat(*points):
    return np.stack(FRAME.to_lonlat(*np.array(points)[:, :2].T), axis=-1)


def route(frame=FRAME, stops=STOPS):
    """A geographic route through given places, each leg straight and 1000 s long."""

    def at(*points):
        return np.stack(frame.to_lonlat(*np.array(points)[:, :2].T), axis=-1)

    legs = []
    for n, (a, b) in enumerate(pairwise(stops)):
        start, end = np.array(a), np.array(b)
        share = np.linspace(0, 1, 5)[:, None]
        rows = np.hstack([1000.0 * (n + share), start + share * (end - start)])
        heading = math.atan2(end[1] - start[1], end[0] - start[0])
        angle = math.copysign(0.4, end[2] - start[2])
        legs.append(
            Leg(start, end, angle, heading, 0.4, 1000.0 * n, 1000.0, 0.01, rows, at(a, b), at(*rows[:, 1:]))
        )
    return Path(np.array(stops[0]), np.array(stops[-1]), 3000.0, tuple(legs), at(stops[0], stops[-1]), DEPARTS)


def assert_places(places, stops=STOPS, frame=FRAME):
    """Longitude, latitude, altitude of stops, to a metre."""
    lon, lat, z = np.array(places, float).T
    x, y = frame.to_local(lon, lat)
    assert np.abs(np.stack([x, y, z], axis=-1) - np.array(stops)).max() < 1.0
