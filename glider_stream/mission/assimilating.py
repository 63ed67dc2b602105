"""A forecast corrected by dives: its error is a Gaussian process on the stream function."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array
from ..kernels.flow import velocities
from ..roadmap.problem import Problem
from ..water.mapping.conditioned import CurrentMap, condition
from ..water.mapping.observations import Observations, dive_averages
from ..water.mapping.scales import Scales, stretched
from .settings import ForecastError, Mission, VehicleSettings
from .vehicle import Dive
from .world import rms_speed, with_error

DECIMALS = 6
"""Corrections are rounded to so many decimals [m/s]: the last digits of linear algebra depend on its threads."""


class Correction(NamedTuple):
    """The mean of a `map` of the forecast's error, in the form in which an error is put on a grid."""

    map: CurrentMap

    def on_mesh(self, x: Array, y: Array, z: Array, t: Array) -> Array:
        """Return the current (times, levels, points, 2) [m/s] at places x, y (points,), for all z and t."""
        return np.round(self.map.on_grid(x, y, -z, t), DECIMALS)


def corrected(forecast: Problem, mission: Mission, dives: Sequence[Dive]) -> Problem:
    """Return the problem of a forecast corrected by the depth-averaged currents of dives.

    The pilot knows how large the forecast's errors are and how far they reach ([forecast_error] of the mission),
    and how exact the vehicle is ([vehicle]); not what the errors are.
    """
    error = mission.forecast_error
    assert error is not None  # the mission's settings see to it
    if not dives or error.rms_share == 0.0:
        return forecast
    longest = mission.arrival.longest
    at = _observed(forecast, mission.vehicle, dives)
    found = condition(at, scales_of(error, rms_speed(forecast, longest)))
    flow = with_error(forecast, Correction(found), error, longest)
    return replace(forecast, evaluator=replace(forecast.evaluator, flow=flow))


def scales_of(error: ForecastError, speed: float) -> Scales:
    """Return the scales of an error whose size is a share of the forecast's rms `speed` [m/s].

    The forecast holds the error, too: its mean square is the true current's and the error's.
    """
    rms = error.rms_share * speed / math.sqrt(1.0 + error.rms_share**2)
    deep = math.inf if isinstance(error.depth_m, str) else float(stretched(np.array(error.depth_m)))
    time = math.inf if isinstance(error.time_s, str) else error.time_s
    return Scales(rms / math.sqrt(2.0), error.length_m, deep, time, kernel="gaussian")


def _observed(forecast: Problem, vehicle: VehicleSettings, dives: Sequence[Dive]) -> Observations:
    """Return what dives have measured, less the forecast's means along them."""
    parts = []
    for dive in dives:
        lasting = dive.ends - dive.begins
        # a heading that is off moves the dead-reckoned way across, a speed that is off moves it along
        off = (vehicle.heading_bias_deg, vehicle.heading_error_deg)
        share = math.hypot(*map(math.radians, off), vehicle.speed_bias, vehicle.speed_error) / math.sqrt(2.0)
        error = math.hypot(math.sqrt(2.0) * vehicle.fix_error_m / lasting, share * dive.through)
        times = (dive.begins, dive.ends)
        ends = np.array([dive.start]), np.array([dive.end])
        parts.append(dive_averages(*ends, dive.depth, *dive.current, times=times, error=error, yos=dive.yos))
    at = Observations.joined(parts)
    known = forecast.evaluator.flow.extent
    when = np.clip(at.t, known.t_lo, known.t_hi)
    return at.less(velocities(forecast.evaluator.flow, at.x, at.y, -at.depth, when))
