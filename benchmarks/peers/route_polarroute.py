"""A route by PolarRoute: a mesh of the file's currents at the departure, its Slocum, a smoothed route.

Its routes know one current for each cell: where the current swings, that of the departure.
"""

import json
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from harness import JOB, answer, timed
from meshiphi.mesh_generation.mesh_builder import MeshBuilder
from polar_route.route_planner.route_planner import RoutePlanner
from polar_route.vessel_performance.vessel_performance_modeller import VesselPerformanceModeller

CELL = 1 / 64
folder = Path(tempfile.mkdtemp())
data = xr.open_dataset(JOB["file"]).isel(time=0)
lat, lon = (one.ravel() for one in np.meshgrid(data["latitude"], data["longitude"], indexing="ij"))
places = pd.DataFrame({"lat": lat, "long": lon})
places.assign(uC=data["uo"].values.ravel(), vC=data["vo"].values.ravel()).to_csv(folder / "c.csv", index=False)
places.assign(elevation=-2000.0).to_csv(folder / "depth.csv", index=False)


def source(loader, file, name):
    params = {"files": [str(folder / file)], "data_name": name, "dataset_name": name, "aggregate_type": "MEAN"}
    return {"loader": loader, "params": params | {"value_fill_types": "parent", "downsample_factors": [1, 1]}}


REGION = {
    "lat_min": 37.875, "lat_max": 38.125, "long_min": 17.96875, "long_max": 18.53125,
    "start_time": "2024-11-20", "end_time": "2024-11-21", "cell_width": CELL, "cell_height": CELL,
}  # fmt: skip
MESH = {
    "region": REGION,
    "data_sources": [source("vector_csv", "c.csv", "uC,vC"), source("scalar_csv", "depth.csv", "elevation")],
    "splitting": {"split_depth": 0, "minimum_datapoints": 1},
}
VESSEL = {
    "vessel_type": "Slocum", "max_speed": 3.6 * JOB["speed"], "unit": "km/hr",
    "max_ice_conc": 10, "min_depth": 10,
}  # fmt: skip
ROUTE = {
    "objective_function": "traveltime", "path_variables": ["traveltime"], "vector_names": ["uC", "vC"],
    "time_unit": "days",
}  # fmt: skip
ENDS = pd.DataFrame(
    [["A", JOB["start"][1], JOB["start"][0], "X", None], ["B", JOB["goal"][1], JOB["goal"][0], None, "X"]],
    columns=["Name", "Lat", "Long", "Source", "Destination"],
)


def route():
    modeller = VesselPerformanceModeller(MeshBuilder(MESH).build_environmental_mesh().to_json(), VESSEL)
    modeller.model_accessibility()
    modeller.model_performance()
    planner = RoutePlanner(json.loads(json.dumps(modeller.to_json())), dict(ROUTE))
    planner.compute_routes(ENDS.copy())
    planner.compute_smoothed_routes()
    return planner.to_json()["paths"]["features"][0]


found, seconds = timed(route)
told = 86_400.0 * found["properties"]["traveltime"][-1]
answer("polar-route", seconds, way=found["geometry"]["coordinates"], route_s=told)
