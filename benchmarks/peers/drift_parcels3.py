"""Drift by Parcels 3: its AdvectionRK4 as compiled C (JITParticle)."""

from datetime import timedelta

from harness import JOB, answer, starts, timed
from parcels import AdvectionRK4, FieldSet, JITParticle, ParticleSet

lon, lat, depth = starts()
axes = {"lon": "longitude", "lat": "latitude", "depth": "depth", "time": "time"}
fieldset = FieldSet.from_netcdf(JOB["twice"], {"U": "uo", "V": "vo"}, axes)


def drift():
    particles = ParticleSet(fieldset, pclass=JITParticle, lon=lon, lat=lat, depth=depth)
    particles.execute(
        AdvectionRK4,
        runtime=timedelta(seconds=JOB["lasting_s"]),
        dt=timedelta(seconds=JOB["step_s"]),
        verbose_progress=False,
    )
    return particles.lon, particles.lat


ends, seconds = timed(drift)
answer("parcels", seconds, ends=ends)
