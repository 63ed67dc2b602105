"""Drift by OpenDrift: OceanDrift with Runge-Kutta 4, without wind, waves and vertical motion."""

from datetime import timedelta

from harness import JOB, answer, starts, timed
from opendrift.models.oceandrift import OceanDrift
from opendrift.readers.reader_netCDF_CF_generic import Reader

lon, lat, depth = starts()
reader = Reader(JOB["twice"])


def drift():
    model = OceanDrift(loglevel=50)
    model.add_reader(reader)
    model.set_config("drift:advection_scheme", "runge-kutta4")
    model.set_config("drift:vertical_advection", False)
    model.set_config("general:use_auto_landmask", False)
    model.set_config("environment:constant:land_binary_mask", 0)
    model.set_config("environment:fallback:x_wind", 0)
    model.set_config("environment:fallback:y_wind", 0)
    model.seed_elements(lon=lon, lat=lat, z=-depth, time=reader.start_time)
    model.run(
        duration=timedelta(seconds=JOB["lasting_s"]),
        time_step=JOB["step_s"],
        time_step_output=timedelta(seconds=JOB["lasting_s"]),
    )
    return model.elements.lon, model.elements.lat


ends, seconds = timed(drift)
answer("opendrift", seconds, ends=ends)
