"""One current, written as many models write it: the same answer, or a sentence that says what is missing."""

import json
import math
import warnings

import numpy as np
import pytest
from helpers.small import command

from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import velocity
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import divergence_ratio, ocean_flow, read_currents, sample

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xarray")
pyproj = pytest.importorskip("pyproj")

TOLERANCE = 1e-3
DEPTHS = np.array([0.0, 5.0, 20.0, 60.0, 150.0])
HOURS = np.array([0.0, 12.0, 24.0])
TIME = {"units": "hours since 2023-02-27 00:00:00"}
NY, NX, STEP = 26, 30, 4000.0
# far from its centre meridian a polar plane is turned by much: a forgotten rotation is a wrong current
PLANE = pyproj.Proj("+proj=stere +lat_0=90 +lat_ts=70 +lon_0=-25 +ellps=WGS84")
CORNER = np.array(PLANE(20.6, 60.4)) - STEP * np.array([NX / 2 - 0.3, NY / 2 - 0.4])
PLACES = [(20.63, 60.41, 47.0, 15.0), (20.31, 60.55, 3.0, 12.0), (20.9, 60.3, 88.0, 1.0)]


def current(lon, lat, depth, hours):
    """Toward east and north [m/s]: linear in depth and time, nearly so along any grid."""
    lon, lat = np.asarray(lon) - 20.6, np.asarray(lat) - 60.4
    u = 0.3 + 0.1 * np.sin(lon) - 0.15 * lat - 0.001 * depth + 0.004 * hours
    v = -0.1 + 0.1 * lon + 0.2 * np.sin(lat) + 0.0005 * depth - 0.006 * hours
    return u, v


def points(off_i=0.0, off_j=0.0, ny=NY, nx=NX):
    x = CORNER[0] + STEP * (np.arange(nx) + off_i)
    y = CORNER[1] + STEP * (np.arange(ny) + off_j)
    return x, y, *PLANE(*np.meshgrid(x, y), inverse=True)


def angle(lon, lat):
    """From east to the plane's x, counter-clockwise."""
    return -np.radians(PLANE.get_factors(lon, lat).meridian_convergence)


def spread(part, lon, lat, depth=DEPTHS, along=True):
    """One component (time, depth, y, x) at points (y, x), along the plane or toward east and north."""
    depth = depth[:, None, None] if depth.ndim == 1 else depth
    u, v = np.broadcast_arrays(*current(lon, lat, depth, HOURS[:, None, None, None]))
    g = angle(lon, lat)
    turned = (u * np.cos(g) + v * np.sin(g), v * np.cos(g) - u * np.sin(g)) if along else (u, v)
    return turned["uv".index(part)]


DIMS = ("time", "depth", "y", "x")


def plain(u="u", v="v", along=True, attrs_u=None, attrs_v=None, places=True, units="m/s"):
    _, _, lon, lat = points()
    data = xr.Dataset(
        {
            u: (DIMS, spread("u", lon, lat, along=along), {"units": units, **(attrs_u or {})}),
            v: (DIMS, spread("v", lon, lat, along=along), {"units": units, **(attrs_v or {})}),
        },
        {"time": ("time", HOURS, TIME), "depth": ("depth", DEPTHS, {"units": "m", "positive": "down"})},
    )
    if places:
        data = data.assign_coords(
            lon=(("y", "x"), lon, {"units": "degrees_east"}), lat=(("y", "x"), lat, {"units": "degrees_north"})
        )
    return data


XY = {"standard_name": "x_sea_water_velocity"}, {"standard_name": "y_sea_water_velocity"}


def along(**more):
    return plain(attrs_u=XY[0], attrs_v=XY[1], **more)


def with_plane(data, backward=False):
    x, y, _, _ = points()
    data = data.assign_coords(
        x=("x", x / 1000, {"units": "km", "standard_name": "projection_x_coordinate"}),
        y=("y", y / 1000, {"units": "km", "standard_name": "projection_y_coordinate"}),
    )
    return data.isel(y=slice(None, None, -1)) if backward else data


def with_mapping():
    data = with_plane(along(places=False))
    data["polar"] = ((), 0, pyproj.CRS(PLANE.srs).to_cf())
    for name in "uv":
        data[name].attrs["grid_mapping"] = "polar"
    return data


def pop():
    _, _, lon, lat = points()
    _, _, t_lon, t_lat = points(-0.5, -0.5)
    dims, wet = ("time", "z_t", "nlat", "nlon"), np.ones((NY, NX))
    wet[:, :4] = 0.0
    place = ("nlat", "nlon")
    return xr.Dataset(
        {
            "UVEL": (dims, 100 * spread("u", lon, lat) * wet, {"units": "centimeter/s"}),
            "VVEL": (dims, 100 * spread("v", lon, lat) * wet, {"units": "centimeter/s"}),
            "ANGLE": (place, angle(lon, lat), {"units": "radians"}),
            "ULONG": (place, lon % 360, {"units": "degrees_east"}),
            "ULAT": (place, lat, {"units": "degrees_north"}),
            "TLONG": (place, t_lon % 360, {"units": "degrees_east"}),
            "TLAT": (place, t_lat, {"units": "degrees_north"}),
        },
        {
            "time": ("time", HOURS, TIME),
            "z_t": ("z_t", 100 * DEPTHS, {"units": "centimeters", "positive": "down"}),
        },
    )


def nemo(component, shared=False):
    off = {"u": (0.5, 0.0), "v": (0.0, 0.5)}[component]
    _, _, lon, lat = points(*off)
    name = {"u": "vozocrtx", "v": "vomecrty"}[component]
    values = spread(component, lon, lat)
    values[..., :3, :3] = 0.0
    if shared:
        _, _, lon, lat = points()
    else:
        lon, lat = lon.copy(), lat.copy()
        lon[:3, :3] = lat[:3, :3] = 0.0
    depth = f"depth{component}"
    return xr.Dataset(
        {
            name: (("time_counter", depth, "y", "x"), values, {"units": "m/s", "long_name": "Zonal velocity"}),
            "nav_lon": (("y", "x"), lon, {"units": "degrees_east"}),
            "nav_lat": (("y", "x"), lat, {"units": "degrees_north"}),
        },
        {
            "time_counter": ("time_counter", HOURS, TIME),
            depth: (depth, DEPTHS, {"units": "m", "positive": "down"}),
        },
    )


def roms(transform=2, places=True, surface=True, land=False):
    """A C-grid over a slope, in terrain-following levels; u and v exact at their own points and depths."""
    s = (np.arange(40) + 0.5) / 40 - 1
    stretch = s - 0.1 * np.sin(np.pi * s) / np.pi
    hc = 15.0
    _, _, lon, lat = points()
    h = 120.0 + 60.0 * (lon - 20.6) + 10 * np.sin(5 * lat)
    zeta = 0.4 * np.sin(3 * lon)[None] * np.ones((HOURS.size, 1, 1)) * surface

    def heights(h, zeta):
        a, c, h, zeta = s[:, None, None], stretch[:, None, None], h[None, None], zeta[:, None]
        if transform == 1:
            top = hc * a + (h - hc) * c
            return top + zeta * (1 + top / h)
        top = (hc * a + h * c) / (hc + h)
        return zeta + (zeta + h) * top

    def mid(one, axis):
        size = one.shape[axis]
        return (np.take(one, range(size - 1), axis) + np.take(one, range(1, size), axis)) / 2

    variables = {
        "h": (("eta_rho", "xi_rho"), h, {"units": "meter"}),
        "angle": (("eta_rho", "xi_rho"), angle(lon, lat), {"units": "radians"}),
        "Cs_r": ("s_rho", stretch),
        "hc": ((), hc),
        "Vtransform": ((), transform),
        "lon_rho": (("eta_rho", "xi_rho"), lon, {"units": "degrees_east"}),
        "lat_rho": (("eta_rho", "xi_rho"), lat, {"units": "degrees_north"}),
    }
    if surface:
        variables["zeta"] = (("ocean_time", "eta_rho", "xi_rho"), zeta, {"units": "meter"})
    for part, axis, offset, count in (("u", -1, (0.5, 0), (NY, NX - 1)), ("v", -2, (0, 0.5), (NY - 1, NX))):
        _, _, here_lon, here_lat = points(*offset, *count)
        depth = -heights(mid(h, axis), mid(zeta, axis))
        at = f"eta_{part}", f"xi_{part}"
        values = spread(part, here_lon, here_lat, depth)
        if land:
            values[..., :5] = 1e37
        variables[part] = (
            ("ocean_time", "s_rho", *at),
            values,
            {"units": "meter second-1", "long_name": f"{part}-momentum component"},
        )
        if places:
            variables[f"lon_{part}"] = (at, here_lon, {"units": "degrees_east"})
            variables[f"lat_{part}"] = (at, here_lat, {"units": "degrees_north"})
    return xr.Dataset(
        variables,
        {
            "s_rho": ("s_rho", s, {"standard_name": f"ocean_s_coordinate_g{transform}"}),
            "ocean_time": ("ocean_time", HOURS * 3600, {"units": "seconds since 2023-02-27 00:00:00"}),
        },
    )


LON, LAT = np.arange(20.0, 21.3, 0.05), np.arange(60.0, 60.81, 0.025)


def straight(part, lon, lat, dims, attrs, **coords):
    values = spread(part, *np.meshgrid(lon, lat), along=False)
    return xr.DataArray(values, dims=dims, attrs={"units": "m s-1", **attrs}, coords=coords)


def axes(**named):
    return {
        name: (name, values, {"units": "degrees_east" if name.lower().startswith("x") else "degrees_north"})
        for name, values in named.items()
    } | {"time": ("time", HOURS, TIME), "Z": ("Z", -DEPTHS, {"units": "m", "positive": "up"})}


def mitgcm():
    dims = ("time", "Z", "YC", "XG"), ("time", "Z", "YG", "XC")
    return xr.Dataset(
        {
            "U": straight("u", LON - 0.025, LAT, dims[0], {}),
            "V": straight("v", LON, LAT - 0.0125, dims[1], {}),
        },
        axes(XC=LON, XG=LON - 0.025, YC=LAT, YG=LAT - 0.0125),
    )


def mom6():
    q_lon, q_lat = np.append(LON - 0.025, LON[-1] + 0.025), np.append(LAT - 0.0125, LAT[-1] + 0.0125)
    names = {"uo": "sea_water_x_velocity", "vo": "sea_water_y_velocity"}
    return xr.Dataset(
        {
            "uo": straight("u", q_lon, LAT, ("time", "Z", "yh", "xq"), {"standard_name": names["uo"]}),
            "vo": straight("v", LON, q_lat, ("time", "Z", "yq", "xh"), {"standard_name": names["vo"]}),
        },
        axes(xh=LON, xq=q_lon, yh=LAT, yq=q_lat),
    )


def mom5():
    data = xr.Dataset(
        {
            name: straight(
                name, LON, LAT, ("time", "st_ocean", "yu_ocean", "xu_ocean"), {"standard_name": standard}
            )
            for name, standard in (("u", "sea_water_x_velocity"), ("v", "sea_water_y_velocity"))
        },
        axes(xu_ocean=LON - 360, yu_ocean=LAT) | {"st_ocean": ("st_ocean", DEPTHS, {"units": "meters"})},
    )
    data.time.attrs["calendar"] = "noleap"
    return data.drop_vars("Z")


def rotated_pole():
    """Degrees of a turned globe: x and y along its parallels and meridians."""
    degrees, radians = (
        "+step +proj=unitconvert +xy_in=deg +xy_out=rad",
        "+step +proj=unitconvert +xy_in=rad +xy_out=deg",
    )
    pole = "+step +proj=ob_tran +o_proj=longlat +o_lon_p=0 +o_lat_p=40 +lon_0=10 +R=6371000"
    turn = pyproj.Transformer.from_pipeline(f"+proj=pipeline {degrees} {pole} {radians}")
    r_lon0, r_lat0 = turn.transform(20.6, 60.4)
    r_lon, r_lat = r_lon0 + np.arange(-0.6, 0.61, 0.04), r_lat0 + np.arange(-0.5, 0.51, 0.04)
    lon, lat = turn.transform(*np.meshgrid(r_lon, r_lat), direction="INVERSE")
    small = 1e-5
    ahead_lon, ahead_lat = turn.transform(*np.meshgrid(r_lon + small, r_lat), direction="INVERSE")
    azimuth = pyproj.Geod(ellps="sphere").inv(lon, lat, ahead_lon, ahead_lat)[0]
    g = np.pi / 2 - np.radians(azimuth)
    u, v = (spread(part, lon, lat, along=False) for part in "uv")
    dims = ("time", "depth", "rlat", "rlon")
    return xr.Dataset(
        {
            "u": (dims, u * np.cos(g) + v * np.sin(g), {"units": "m/s", **XY[0]}),
            "v": (dims, v * np.cos(g) - u * np.sin(g), {"units": "m/s", **XY[1]}),
            "lon": (("rlat", "rlon"), lon, {"units": "degrees_east"}),
            "lat": (("rlat", "rlon"), lat, {"units": "degrees_north"}),
        },
        {
            "rlon": ("rlon", r_lon, {"units": "degrees", "standard_name": "grid_longitude"}),
            "rlat": ("rlat", r_lat, {"units": "degrees", "standard_name": "grid_latitude"}),
            "time": ("time", HOURS, TIME),
            "depth": ("depth", DEPTHS, {"units": "m", "positive": "down"}),
        },
    )


def pom():
    data = roms()
    h = data.h.values
    sigma = -((np.arange(41) / 40) ** 1.2)
    _, _, lon, lat = points()
    depth = -(sigma[:, None, None] * h)[None]
    dims = ("time", "sigma", "y", "x")
    return xr.Dataset(
        {
            "u": (
                dims,
                spread("u", lon, lat, depth, along=False),
                {"units": "m/s", "standard_name": "eastward_sea_water_velocity"},
            ),
            "v": (
                dims,
                spread("v", lon, lat, depth, along=False),
                {"units": "m/s", "standard_name": "northward_sea_water_velocity"},
            ),
            "depth": (("y", "x"), h, {"units": "m"}),
            "elev": (("time", "y", "x"), np.zeros((HOURS.size, NY, NX)), {"units": "m"}),
            "lon": (("y", "x"), lon, {"units": "degrees_east"}),
            "lat": (("y", "x"), lat, {"units": "degrees_north"}),
        },
        {
            "sigma": (
                "sigma",
                sigma,
                {
                    "standard_name": "ocean_sigma_coordinate",
                    "formula_terms": "sigma: sigma eta: elev depth: depth",
                },
            ),
            "time": ("time", HOURS, TIME),
        },
    )


def sigma_on_axes():
    """Sigma levels over a regular grid whose rows go from north to south."""
    sigma = -np.linspace(0, 1, 41)
    lon, lat = np.meshgrid(LON, LAT)
    h = 120 + 50 * (lon - 20.6) - 80 * (lat - 60.4)
    depth = -(sigma[:, None, None] * h)[None]
    dims = ("time", "sigma", "lat", "lon")
    return xr.Dataset(
        {
            "water_u": (dims, spread("u", lon, lat, depth, along=False), {"units": "m/s"}),
            "water_v": (dims, spread("v", lon, lat, depth, along=False), {"units": "m/s"}),
            "bathy": (("lat", "lon"), h, {"units": "m"}),
        },
        {
            "lon": ("lon", LON, {"units": "degrees_east"}),
            "lat": ("lat", LAT, {"units": "degrees_north"}),
            "sigma": (
                "sigma",
                sigma,
                {"standard_name": "ocean_sigma_coordinate", "formula_terms": "sigma: sigma depth: bathy"},
            ),
            "time": ("time", HOURS, TIME),
        },
    ).isel(lat=slice(None, None, -1))


def masked(land):
    """Plausible numbers on land, that only a mask tells from water."""
    data = plain(
        "uo",
        "vo",
        False,
        {"standard_name": "eastward_sea_water_velocity"},
        {"standard_name": "northward_sea_water_velocity"},
    )
    dry = np.zeros((NY, NX), dtype=int)
    dry[:, :4] = 1
    name = "land_binary_mask" if land else "mask_rho"
    data[name] = (("y", "x"), dry if land else 1 - dry, {"standard_name": name} if land else {})
    return data


def written(folder, data, name="model.nc", engine="h5netcdf"):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for one in data.variables.values():
            one.encoding.setdefault("_FillValue", None)
        if name.endswith(".zarr"):
            data.to_zarr(folder / name)
        else:
            data.to_netcdf(folder / name, engine=engine)
    return folder / name


EAST = {"standard_name": "eastward_sea_water_velocity"}, {"standard_name": "northward_sea_water_velocity"}
MODELS = {
    "curved, toward east by its standard name": lambda: [plain("p", "q", False, *EAST)],
    "curved, toward east by its name": lambda: [plain("u_eastward", "v_northward", False)],
    "along x and y of a plane": lambda: [with_plane(along())],
    "a plane that counts y downward": lambda: [with_plane(along(), backward=True)],
    "a plane's x, y and its mapping alone": lambda: [with_mapping()],
    "along the grid, by its long name": lambda: [plain(attrs_u={"long_name": "velocity in grid-x direction"})],
    "dimensions turned round": lambda: [along().transpose("x", "time", "y", "depth")],
    "POP: cm/s, ANGLE, two sets of places": lambda: [pop()],
    "NEMO: u and v in files of their own": lambda: [nemo("v"), nemo("u")],
    "ROMS, Vtransform 2": lambda: [roms()],
    "ROMS, Vtransform 1, no surface": lambda: [roms(1, surface=False)],
    "ROMS without lon_u and lat_v": lambda: [roms(places=False)],
    "ROMS and its grid in a file of its own": lambda: [
        roms().drop_vars(["h", "angle", "lon_rho", "lat_rho", "hc", "Vtransform", "Cs_r"]),
        roms()[["h", "angle", "lon_rho", "lat_rho", "hc", "Vtransform", "Cs_r"]].drop_vars(
            "ocean_time", errors="ignore"
        ),
    ],
    "ROMS without an angle": lambda: [roms().drop_vars("angle")],
    "ROMS with land": lambda: [roms(land=True)],
    "POM: sigma levels, toward east": lambda: [pom()],
    "sigma levels on axes, from the north": lambda: [sigma_on_axes()],
    "MITgcm: a C-grid on axes": lambda: [mitgcm()],
    "MOM6: q and h points": lambda: [mom6()],
    "MOM5: a B-grid, far west, noleap": lambda: [mom5()],
    "a turned pole": lambda: [rotated_pole()],
    "a mask of the sea": lambda: [masked(False)],
    "a mask of land": lambda: [masked(True)],
    "one file a step": lambda: [along().isel(time=[n]) for n in (2, 0, 1)],
}


def told(place):
    return (
        f"2023-02-27T00:00:00+{0:02}:00"
        if place == 0
        else str(np.datetime64("2023-02-27T00:00:00") + np.timedelta64(int(place * 60), "m"))
    )


@pytest.mark.parametrize("model", MODELS)
def test_models_give_the_same_current(tmp_path, model):
    paths = [written(tmp_path, data, f"{n}.nc") for n, data in enumerate(MODELS[model]())]
    file = read_currents(paths)
    for lon, lat, depth, hours in PLACES:
        assert sample(file, lon, lat, depth, told(hours)) == pytest.approx(
            current(lon, lat, depth, hours), abs=TOLERANCE
        )
    if "mask" in model or "land" in model or "POP" in model:
        x, y, _, _ = points()
        lon, lat = PLANE(x[1], y[12], inverse=True)
        assert sample(file, lon, lat, 3.0, told(12.0)) is None


@pytest.mark.parametrize("name", ["model.zarr", "three.nc"])
def test_zarr_and_netcdf3(tmp_path, name):
    if name.endswith(".zarr"):
        pytest.importorskip("zarr")
    file = read_currents(written(tmp_path, roms(), name, "scipy"))
    lon, lat, depth, hours = PLACES[0]
    assert sample(file, lon, lat, depth, told(hours)) == pytest.approx(
        current(lon, lat, depth, hours), abs=TOLERANCE
    )


@pytest.mark.parametrize(
    "model",
    [
        "along x and y of a plane",
        "ROMS, Vtransform 2",
        "MOM6: q and h points",
        "NEMO: u and v in files of their own",
    ],
)
def test_a_domain_reads_what_the_whole_file_has(tmp_path, model):
    paths = [written(tmp_path, data, f"{n}.nc") for n, data in enumerate(MODELS[model]())]
    domain = (20.5, 20.8), (60.35, 60.5)
    frame = LocalFrame.over(*domain)
    values = []
    for file in (read_currents(paths), read_currents(paths, lon=domain[0], lat=domain[1], depth=(0.0, 60.0))):
        flow, seabed = ocean_flow(file, frame, *domain, (0.0, 60.0), "2023-02-27T00:00:00")
        values.append([velocity(flow, x, y, -40.0, 3600.0) for x in (-5e3, 0.0, 6e3) for y in (-4e3, 3e3)])
        assert (seabed.bottom < -60).all()
    assert values[0] == pytest.approx(np.array(values[1]), abs=1e-4)
    lon, lat = frame.to_lonlat(6e3, 3e3)
    turn = float(frame.convergence(lon, lat))
    u, v = current(lon, lat, 40.0, 1.0)
    expected = (u * math.cos(turn) - v * math.sin(turn), u * math.sin(turn) + v * math.cos(turn))
    assert values[1][-1] == pytest.approx(expected, abs=TOLERANCE)


def test_the_seabed_is_the_models_own(tmp_path):
    data = roms()
    file = read_currents(written(tmp_path, data))
    deep = float(120.0 + 60.0 * 0.03 + 10 * math.sin(5 * 60.41))
    assert sample(file, 20.63, 60.41, deep - 3.0, told(12.0)) is not None
    assert sample(file, 20.63, 60.41, deep + 3.0, told(12.0)) is None


def test_divergence_does_not_depend_on_how_it_is_written(tmp_path):
    ratio = [
        divergence_ratio(read_currents(written(tmp_path, one, f"{n}.nc")))
        for n, one in enumerate((along(), mom5()))
    ]
    assert ratio[0] == pytest.approx(ratio[1], rel=0.05)


def wrong_angle():
    data = roms()
    data["angle"] = data.angle + 0.6
    return data


REFUSALS = {
    "curved, and nothing says along what": (lambda: [plain()], "do not say whether .* set `rotate`"),
    "an angle that is another": (lambda: [wrong_angle()], "`angle` .* set `rotate`"),
    "staggered, yet the places of the centres": (
        lambda: [xr.merge([nemo("u", True), nemo("v", True)], compat="override", join="outer")],
        "set `stagger`",
    ),
    "no depth of the seabed": (lambda: [roms().drop_vars("h")], "no depth of the seabed `h`"),
    "no Vtransform": (
        lambda: [roms().drop_vars("Vtransform").assign_coords(s_rho=("s_rho", roms().s_rho.values))],
        "Vtransform",
    ),
    "no stretching": (lambda: [roms().drop_vars("Cs_r")], "Cs_r"),
    "no places": (lambda: [along(places=False)], "longitude"),
    "only u": (lambda: [nemo("u")], "no current toward north"),
    "POP without its own places": (lambda: [pop().drop_vars(["ULONG", "ULAT"])], "TLONG.*set `lon` and `lat`"),
    "NEMO with the places of corners alone": (
        lambda: [
            nemo("u").rename(nav_lon="glamf", nav_lat="gphif"),
            nemo("v").rename(nav_lon="glamf", nav_lat="gphif"),
        ],
        "does not lie at `glamf`.* set `lon` and `lat`",
    ),
    "a mask that tells nothing": (
        lambda: [along().assign(mask=(("y", "x"), np.arange(NY * NX).reshape(NY, NX) % 2))],
        "`mask` .* set `land`",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refused_in_one_sentence(tmp_path, case):
    make, words = REFUSALS[case]
    paths = [written(tmp_path, data, f"model{n}.nc") for n, data in enumerate(make())]
    with pytest.raises(InputError, match=words) as refusal:
        read_currents(paths)
    assert "\n" not in str(refusal.value)
    assert "model" in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (plain, {"rotate": "grid"}),
        (lambda: plain(along=False), {"rotate": "none"}),
        (lambda: wrong_angle(), {"rotate": "grid"}),
        (
            lambda: xr.merge([nemo("u", True), nemo("v", True)], compat="override", join="outer"),
            {"stagger": "nemo"},
        ),
        (lambda: plain().assign(turn=(("y", "x"), angle(*points()[2:]))), {"rotate": "turn"}),
        (
            lambda: along().assign(mask=(("y", "x"), np.arange(NY * NX).reshape(NY, NX) % 2)),
            {"mask": "none"},
        ),
    ],
)
def test_a_user_may_say(tmp_path, make, names):
    file = read_currents(written(tmp_path, make()), names)
    lon, lat, depth, hours = PLACES[0]
    assert sample(file, lon, lat, depth, told(hours)) == pytest.approx(
        current(lon, lat, depth, hours), abs=TOLERANCE
    )


def test_describe_takes_a_users_word(tmp_path, capsys):
    path = written(tmp_path, plain())
    asked = ["describe", path, "--json", "--at", "20.63,60.41,47,2023-02-27T15:00"]
    said = command(capsys, *asked)
    assert said.code == 2
    assert "rotate" in said.err
    done = command(capsys, *asked, "--name", "rotate=grid")
    point = json.loads(done.out)["points"][0]
    assert (point["u_east"], point["v_north"]) == pytest.approx(current(20.63, 60.41, 47.0, 15.0), abs=TOLERANCE)
    assert json.loads(done.out)["grid"] == "curved"
