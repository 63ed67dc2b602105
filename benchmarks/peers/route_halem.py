"""A route by HALEM: the file's nodes, three layers of neighbours, one ship of constant speed and no draught.

Its water is 8 m deep: in deep water a ship so slow overflows HALEM's formula for squat (exp(g h / V^2)).
"""

from datetime import datetime

import halem
import numpy as np
import xarray as xr
from harness import JOB, answer, timed

DEPARTURE = "20/11/2024 00:00:00"


class Roadmap(halem.BaseRoadmap):
    @staticmethod
    def load():
        data = xr.open_dataset(JOB["file"]).isel(latitude=slice(None, None, 2), longitude=slice(1, None, 2))
        lat, lon = np.meshgrid(data["latitude"], data["longitude"], indexing="ij")
        u, v = (np.nan_to_num(data[name].values.reshape(data["time"].size, -1)) for name in ("uo", "vo"))
        hours = 3600.0 * np.arange(max(2, len(u)))
        u, v = (np.resize(one, (hours.size, lat.size)) for one in (u, v))
        return {
            "time": datetime.strptime(DEPARTURE, "%d/%m/%Y %H:%M:%S").timestamp() + hours,
            "nodes": np.column_stack([lat.ravel(), lon.ravel()]),
            "u": u,
            "v": v,
            "water_depth": np.full(u.shape, 8.0),
        }


def route():
    ship = {"vship": np.array([[JOB["speed"]]]), "WD_min": np.array([0.1]), "WVPI": np.array([1.0])}
    count = Roadmap.load()["nodes"].shape[0]
    roadmap = Roadmap(
        number_of_neighbor_layers=3, **ship, WWL=0.2, LWL=2.0, ukc=0.1, optimization_type=["time"],
        nodes_index=np.arange(count), dx_min=0.0, blend=1.0, nl=(1, 1),
    )  # fmt: skip
    roadmap.parse()
    way, time, _ = halem.HALEM_time(JOB["start"], JOB["goal"], DEPARTURE, JOB["speed"], roadmap)
    return [JOB["start"], *way.tolist(), JOB["goal"]], time[-1] - time[0]


(way, seconds_told), seconds = timed(route)
answer("halem", seconds, way=way, route_s=seconds_told)
