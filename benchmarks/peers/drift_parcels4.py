"""Drift by Parcels 4, as its tutorials read Copernicus Marine files and advect by AdvectionRK4."""

import numpy as np
import parcels
import xarray as xr
from harness import JOB, answer, starts, timed

lon, lat, depth = starts()
data = xr.open_dataset(JOB["twice"]).load()
fields = parcels.convert.copernicusmarine_to_sgrid(fields={"U": data["uo"], "V": data["vo"]})
fieldset = parcels.FieldSet.from_sgrid_conventions(fields)


def drift():
    particles = parcels.ParticleSet(fieldset, x=lon, y=lat, z=depth)
    particles.execute(
        parcels.kernels.AdvectionRK4,
        runtime=np.timedelta64(int(JOB["lasting_s"]), "s"),
        dt=np.timedelta64(int(JOB["step_s"]), "s"),
        verbose_progress=False,
    )
    return particles.x, particles.y


ends, seconds = timed(drift)
answer("parcels", seconds, ends=ends)
