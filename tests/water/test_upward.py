"""A file's own vertical current, as models write it: the formula's values, and no sign or level is lost."""

import numpy as np
import pytest
from helpers.currents import written

from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import current
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import Names, OceanFlow

xr = pytest.importorskip("xarray")

DOMAIN = (20.3, 20.7), (60.3, 60.7)
FRAME = LocalFrame(20.5, 60.5)
LON, LAT = np.arange(20.0, 21.01, 0.05), np.arange(60.0, 61.01, 0.04)
FACES = np.array([0.0, 6.0, 15.0, 30.0, 55.0, 90.0, 140.0])
MIDDLES = (FACES[1:] + FACES[:-1]) / 2
HOURS = np.array([0.0, 6.0, 12.0])
TIME = {"units": "hours since 2024-11-20 00:00:00", "standard_name": "time"}
DOWN = {"units": "m", "positive": "down"}
BOTTOM = 120.0


def formula(lon, lat, depth, hours):
    """u, v, w [m/s]: linear along each axis, so that right reading is exact; half a cell is a tenth of w."""
    u = 0.3 + 0.2 * (lon - 20.5) - 0.1 * (lat - 60.5) - 0.001 * depth + 0.004 * hours
    v = -0.2 + 0.1 * (lon - 20.5) + 0.3 * (lat - 60.5) + 0.0005 * depth - 0.003 * hours
    return u, v, 2e-4 * depth * (1 + 3 * (lon - 20.5) - 4 * (lat - 60.5)) * (1 + 0.02 * hours)


def at(part, off_i, off_j, depth):
    """One part (t, z, y, x) at points half a cell further along or across the rows, and their places."""
    lon, lat = np.meshgrid(LON + off_i * 0.05, LAT + off_j * 0.04)
    depth = depth[:, None, None] if depth.ndim == 1 else depth
    values = formula(lon, lat, depth, HOURS[:, None, None, None])["uvw".index(part)]
    return np.broadcast_to(values, (3, depth.shape[0], *lon.shape)).copy(), lon, lat


def nemo(part, name, off, depth, **attrs):
    values, lon, lat = at(part, *off, depth)
    axis = f"depth{part}"
    return xr.Dataset(
        {
            name: (("time_counter", axis, "y", "x"), values, {"units": "m/s", **attrs}),
            "nav_lon": (("y", "x"), lon, {"units": "degrees_east"}),
            "nav_lat": (("y", "x"), lat, {"units": "degrees_north"}),
        },
        {"time_counter": ("time_counter", HOURS, TIME), axis: (axis, depth, DOWN)},
    )


def three_files(sign=1.0, **attrs):
    w = nemo("w", "vovecrtz", (0, 0), FACES, **attrs)
    w["vovecrtz"] *= sign
    return [nemo("u", "vozocrtx", (0.5, 0), MIDDLES), nemo("v", "vomecrty", (0, 0.5), MIDDLES), w]


def masked():
    """Land by fill values and, in w alone, by zeros; the faces at the seabed hold no value, as in NEMO."""
    files = three_files(standard_name="upward_sea_water_velocity")
    for one, name in zip(files, ("vozocrtx", "vomecrty", "vovecrtz"), strict=True):
        one[name][:, :, :, :4] = 0.0 if name == "vovecrtz" else np.nan
    flat = files[2].vovecrtz
    flat[:] = 2e-4 * np.maximum(0.0, FACES[-1] - FACES)[:, None, None]
    flat[:, -1] = np.nan
    return files


def one_file():
    """All in one file on the same dimensions, with the places of every kind of point."""
    files = three_files(standard_name="upward_sea_water_velocity")
    kinds = {"u": (0.5, 0), "v": (0, 0.5), "t": (0, 0), "f": (0.5, 0.5)}
    data = xr.merge([one.drop_vars(["nav_lon", "nav_lat"]) for one in files])
    for kind, off in kinds.items():
        _, lon, lat = at("w", *off, FACES)
        data[f"glam{kind}"], data[f"gphi{kind}"] = (("y", "x"), lon), (("y", "x"), lat)
    return [data]


def roms(faces="s_w", attributes=False):
    """A C-grid over a slope, under a raised surface, in terrain-following levels; w at faces or middles."""
    s = {"s_w": np.linspace(-1, 0, 25)}
    s["s_rho"] = (s["s_w"][1:] + s["s_w"][:-1]) / 2
    bend = {name: one - 0.1 * np.sin(np.pi * one) / np.pi for name, one in s.items()}
    _, lon, lat = at("w", 0, 0, FACES)
    h, zeta, hc = 130.0 + 10.0 * (lon - 20.5), np.full((3, *lon.shape), 0.7), 15.0

    def depth(name, h):
        a, c = s[name][:, None, None], bend[name][:, None, None]
        return -(0.7 + (0.7 + h) * (hc * a + h * c) / (hc + h))

    along, across = (h[:, 1:] + h[:, :-1]) / 2, (h[1:] + h[:-1]) / 2
    wide, tall = np.pad(along, ((0, 0), (0, 1)), "edge"), np.pad(across, ((0, 1), (0, 0)), "edge")
    u, u_lon, u_lat = (one[..., :-1] for one in at("u", 0.5, 0, depth("s_rho", wide)))
    v, v_lon, v_lat = (one[..., :-1, :] for one in at("v", 0, 0.5, depth("s_rho", tall)))
    w, _, _ = at("w", 0, 0, depth(faces, h))
    unit, rho = {"units": "meter second-1"}, ("eta_rho", "xi_rho")
    data = xr.Dataset(
        {
            "u": (("ocean_time", "s_rho", "eta_u", "xi_u"), u, unit | {"long_name": "u-momentum component"}),
            "v": (("ocean_time", "s_rho", "eta_v", "xi_v"), v, unit | {"long_name": "v-momentum component"}),
            "w": (("ocean_time", faces, *rho), w, unit | {"long_name": "vertical momentum component"}),
            "h": (rho, h, {"units": "meter"}),
            "zeta": (("ocean_time", *rho), zeta, {"units": "meter"}),
            "angle": (rho, 0.0 * h, {"units": "radians"}),
            "hc": ((), hc),
            "Vtransform": ((), 2),
        },
        {"ocean_time": ("ocean_time", HOURS * 3600, {"units": "seconds since 2024-11-20 00:00:00"})},
    )
    for kind, x, y, dims in (("rho", lon, lat, rho), ("u", u_lon, u_lat, ("eta_u", "xi_u")),
                             ("v", v_lon, v_lat, ("eta_v", "xi_v"))):  # fmt: skip
        data[f"lon_{kind}"], data[f"lat_{kind}"] = (dims, x), (dims, y)
    if attributes:
        names = {"sc_r": s, "Cs_r": bend, "sc_w": s, "Cs_w": bend}
        return [data.assign_attrs({n: of["s_rho" if n[-1] == "r" else "s_w"] for n, of in names.items()})]
    for name in s:
        data[name] = (name, s[name], {"standard_name": "ocean_s_coordinate_g2"})
        data[name.replace("s_", "Cs_").replace("rho", "r")] = (name, bend[name])
    return [data]


def own_faces(positive):
    """MITgcm: everything on axes of one dimension each; heights that fall, w on the upper faces."""
    u_at, v_at = np.append(LON - 0.025, LON[-1] + 0.025), np.append(LAT - 0.02, LAT[-1] + 0.02)
    places = {"XC": LON, "XG": u_at, "YC": LAT, "YG": v_at}
    axes = {name: (name, one, {"units": f"degrees_{'east' if 'X' in name else 'north'}"})
            for name, one in places.items()}  # fmt: skip
    heights = {"Z": -MIDDLES, "Zl": -FACES[:-1]}
    axes |= {name: (name, one, {"units": "m", "positive": "up", "axis": "Z"}) for name, one in heights.items()}

    def part(n, lon, lat, depth):
        t, z, y, x = np.meshgrid(HOURS, depth, lat, lon, indexing="ij")
        return formula(x, y, z, t)[n]

    sign = -1.0 if positive == "down" else 1.0
    w = 100 * sign * part(2, LON, LAT, FACES[:-1])
    return [xr.Dataset(
        {
            "U": (("time", "Z", "YC", "XG"), part(0, u_at, LAT, MIDDLES), {"units": "m/s"}),
            "V": (("time", "Z", "YG", "XC"), part(1, LON, v_at, MIDDLES), {"units": "m/s"}),
            "WVEL": (("time", "Zl", "YC", "XC"), w, {"units": "cm/s", "positive": positive}),
        },
        axes | {"time": ("time", HOURS, TIME)},
    )]  # fmt: skip


UPWARD = {"standard_name": "upward_sea_water_velocity"}
MODELS = {
    "NEMO, a file each": (lambda: three_files(**UPWARD), "vovecrtz", None),
    "NEMO, downward by its attribute": (lambda: three_files(-1.0, positive="down"), "vovecrtz", None),
    "NEMO, downward by its long name": (lambda: three_files(-1.0, long_name="Downward flow"), "vovecrtz", None),
    "NEMO, downward as the user says": (lambda: three_files(-1.0), "vovecrtz", False),
    "NEMO, one file with all places": (one_file, "vovecrtz", None),
    "ROMS at its faces": (roms, "w", True),
    "CROCO at its middles": (lambda: roms("s_rho"), "w", True),
    "CROCO, faces by attributes": (lambda: roms(attributes=True), "w", True),
    "MITgcm, cm/s, downward": (lambda: own_faces("down"), "WVEL", None),
    "MITgcm, upward": (lambda: own_faces("up"), "WVEL", None),
}


def waters(folder, files, vertical, upward=None, depth=(0.0, BOTTOM * 0.7), **names):
    paths = tuple(str(written(folder, one, f"{n}.nc")) for n, one in enumerate(files))
    flow = OceanFlow(paths, "2024-11-20T00:00:00", Names(**names), vertical=vertical, upward=upward)
    return flow.waters(FRAME, *DOMAIN, depth)


@pytest.mark.parametrize("model", MODELS)
def test_a_file_s_vertical_current_is_the_formula_s(tmp_path, model):
    make, vertical, upward = MODELS[model]
    names = {"u": "U", "v": "V"} if "MITgcm" in model else {}
    flow, _, told = waters(tmp_path, make(), vertical, upward, **names)
    assert f"`{vertical}`" in told
    rng = np.random.default_rng(1)
    for lon, lat, depth, hours in rng.uniform([20.3, 60.3, 1.0, 0.0], [20.7, 60.7, 80.0, 12.0], (40, 4)):
        x, y = map(float, FRAME.to_local(lon, lat))
        u, v, _ = formula(lon, lat, min(max(depth, MIDDLES[0]), MIDDLES[-1]), hours)
        turn = float(FRAME.convergence(lon, lat))
        found = current(flow, x, y, -depth, 3600.0 * hours)
        # w is 2 cm/s here; float32 and the map of places leave a micrometre a second
        assert found[2] == pytest.approx(formula(lon, lat, depth, hours)[2], abs=2e-6)
        if "ROMS" not in model and "CROCO" not in model:
            flat = u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn)
            assert found[:2] == pytest.approx(flat, abs=2e-5)


def test_nothing_crosses_the_seabed_and_a_coast_does_not_slow_what_rises_beside_it(tmp_path):
    flow, _, _ = waters(tmp_path, masked(), "vovecrtz", depth=(0.0, 115.0))
    for lon in (20.3, 20.5):
        x, y = map(float, FRAME.to_local(lon, 60.5))
        for depth in (30.0, 100.0):
            assert current(flow, x, y, -depth, 0.0)[2] == pytest.approx(2e-4 * (FACES[-1] - depth), abs=1e-7)


def contradicting():
    return three_files(standard_name="upward_sea_water_velocity", positive="down")


def omega():
    data = roms()[0].rename(w="omega")
    data.omega.attrs["long_name"] = "S-coordinate vertical momentum component"
    return [data]


def shallow():
    files = three_files(**UPWARD)
    return [*files[:2], files[2].isel(depthw=slice(1))]


def later():
    files = three_files(**UPWARD)
    return [*files[:2], files[2].assign_coords(time_counter=("time_counter", HOURS + np.array([0, 0, 1]), TIME))]


def beside():
    files = three_files(**UPWARD)
    return [*files[:2], files[2].assign(nav_lon=files[0].nav_lon, nav_lat=files[0].nav_lat)]


def unknown():
    files = three_files(**UPWARD)
    del files[2].vovecrtz.attrs["units"]
    return [*files[:2], files[2].rename(vovecrtz="lift")]


@pytest.mark.parametrize(
    ("make", "vertical", "upward", "why"),
    [
        (contradicting, "vovecrtz", None, r"contradicts itself: down and upward; set `flow\.upward`"),
        (three_files, "vovecrtz", None, r"does not say whether it counts upward; set `flow\.upward`"),
        (omega, "omega", True, r"`omega` of 0\.nc is a current through sloping levels.*continuity"),
        (shallow, "vovecrtz", None, r"needs two levels or more, and 2\.nc has one"),
        (later, "vovecrtz", None, r"other times than the currents"),
        (beside, "vovecrtz", None, r"lies on other points than the currents"),
        (unknown, "lift", None, r"`lift` in 2\.nc has no unit"),
    ],
)
def test_what_could_be_read_wrongly_is_refused(tmp_path, make, vertical, upward, why):
    with pytest.raises(InputError, match=why):
        waters(tmp_path, make(), vertical, upward)
