"""Water and seabed that is not there: zeros, fills, masks, the model's own depth, levels that a file lacks."""

import numpy as np
import pytest
from helpers.currents import DEPTH, DOMAIN, EAST, LAT, LON, NORTH, both, current, dataset, written

from glider_stream.base.errors import InputError
from glider_stream.kernels.terrain import allowed
from glider_stream.water.describe import describe
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import OceanFlow, ocean_flow, read_currents, sample

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xarray")

FRAME = LocalFrame.over(*DOMAIN)
DEEP = np.array([0.5, 50.0, 200.0, 500.0, 700.0, 1000.0])


def water(path, lon, lat, depth, names=None):
    return sample(read_currents(path, names), lon, lat, depth)


def bottom_of(path, depth, names=None):
    """The height [m] of the bottom in the middle of the domain, as the planner has it for its depths."""
    file = read_currents(path, names, lon=DOMAIN[0], lat=DOMAIN[1], depth=depth)
    _, seabed = ocean_flow(file, FRAME, *DOMAIN, depth)
    i, j = (n // 2 for n in seabed.bottom.shape)
    return float(seabed.bottom[i, j])


def tiles(data, zero_from=40.0):
    """NEMO's way: 0 below each bottom, fills only where whole tiles of land were left out."""
    data = both(data, lambda one: one.where((one.depth < zero_from) | (one.lon > 20.85), 0.0))
    data = both(data, lambda one: one.where(one.lon > 20.15))
    return both(data, lambda one: one.where((one.lon < 20.15) | (one.lon > 20.25), 0.0))


@pytest.mark.parametrize("fills", [True, False])
def test_zeros_below_the_bottom_are_seabed_whatever_else_the_file_holds(tmp_path, fills):
    data = tiles(dataset()) if fills else both(dataset(), lambda one: one.where(one.depth < 40.0, 0.0))
    path = written(tmp_path, data)
    assert water(path, 20.5, 60.5, 30.0) == pytest.approx(current(20.5, 60.5, 30.0), abs=1e-3)
    assert water(path, 20.5, 60.5, 45.0) is None
    if fills:
        assert water(path, 20.2, 60.5, 5.0) is None  # a whole column of zeros
        assert water(path, 20.9, 60.5, 90.0) == pytest.approx(current(20.9, 60.5, 90.0), abs=1e-3)
    took = read_currents(path).took
    assert "zeros (seabed)" in took["land"]
    assert "deepest level with data" in took["bottom"]
    # the planner's cut holds no fill, and not even the levels below: it must say the same
    for depth in ((0.0, 20.0), (0.0, 45.0), (0.0, 95.0)):
        assert bottom_of(path, depth) == pytest.approx(-30.0, abs=0.02), depth


def test_zeros_that_move_at_another_time_or_deeper_are_calm(tmp_path):
    data = dataset(hours=[0.0, 6.0, 12.0])
    still = both(data, lambda one: one.where((one.depth < 40.0) | (one.time > 3.0), 0.0))
    path = written(tmp_path, still)
    file = read_currents(path)
    assert sample(file, 20.5, 60.5, 90.0, "2024-11-20T00:00") == pytest.approx((0.0, 0.0), abs=1e-9)
    part = read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 45.0))
    assert np.isinf(part.seabed).all()
    between = written(
        tmp_path, both(dataset(), lambda one: one.where((one.depth < 25) | (one.depth > 60), 0.0)), "b.nc"
    )
    assert water(between, 20.5, 60.5, 40.0) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.isinf(read_currents(between, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 45.0)).seabed).all()


def test_zeros_above_a_fill_of_the_same_column_are_calm(tmp_path):
    data = both(dataset(), lambda one: one.where(one.depth < 40.0, 0.0).where(one.depth < 60.0))
    path = written(tmp_path, data)
    assert water(path, 20.5, 60.5, 49.0) == pytest.approx((0.0, 0.0), abs=0.3)
    assert bottom_of(path, (0.0, 45.0)) == pytest.approx(-50.0, abs=0.02)


def test_a_user_says_what_zeros_are(tmp_path):
    path = written(tmp_path, both(dataset(), lambda one: one.where(one.depth < 40.0, 0.0)))
    assert water(path, 20.5, 60.5, 80.0) is None
    assert water(path, 20.5, 60.5, 80.0, {"zeros": "calm"}) == pytest.approx((0.0, 0.0))
    assert any('set `zeros` = "calm"' in note for note in read_currents(path).notes)
    with pytest.raises(InputError, match='`zeros` must be "land" or "calm"; got \'sea\''):
        read_currents(path, {"zeros": "sea"})


def with_depth(data, name, values, **attrs):
    return data.assign(
        {name: (("lat", "lon"), np.full((LAT.size, LON.size), float(values)), {"units": "m", **attrs})}
    )


DEPTHS = {
    "deptho": lambda d: with_depth(d, "deptho", 620.0, standard_name="sea_floor_depth_below_geoid"),
    "h, without a word": lambda d: with_depth(d, "h", 620.0),
    "a height": lambda d: with_depth(d, "bottom", -620.0, standard_name="sea_floor_depth_below_sea_surface"),
    "in km": lambda d: with_depth(d, "bathymetry", 0.62, units="km"),
    "one time": lambda d: with_depth(d, "deptho", 620.0).assign(deptho=lambda e: e.deptho.expand_dims("month")),
}


@pytest.mark.parametrize("way", DEPTHS)
def test_the_models_own_depth_is_the_bottom(tmp_path, way):
    columns = both(dataset(depth=DEEP), lambda one: one.where(one.depth < 600.0))
    path = written(tmp_path, DEPTHS[way](columns))
    assert water(path, 20.5, 60.5, 600.0) is not None
    assert water(path, 20.5, 60.5, 640.0) is None
    assert bottom_of(path, (0.0, 400.0)) == pytest.approx(-620.0, abs=0.02)
    assert "the model's depth" in read_currents(path).took["bottom"]


def test_without_a_depth_the_deepest_level_with_data_is_the_bottom(tmp_path):
    columns = both(dataset(depth=DEEP), lambda one: one.where(one.depth < 600.0))
    path = written(tmp_path, columns)
    assert water(path, 20.5, 60.5, 500.0) is not None
    assert water(path, 20.5, 60.5, 510.0) is None  # not midway to 700 m
    assert bottom_of(path, (0.0, 150.0)) == pytest.approx(-500.0, abs=0.02)
    assert "values are points" in read_currents(path).took["bottom"]
    layers = columns.assign(
        depth_bnds=(
            ("depth", "nv"),
            np.array([[0, 25], [25, 125], [125, 350], [350, 600], [600, 850], [850, 1150.0]]),
        )
    )
    layers.depth.attrs["bounds"] = "depth_bnds"
    path = written(tmp_path, layers, "layers.nc")
    assert water(path, 20.5, 60.5, 590.0) is not None
    assert bottom_of(path, (0.0, 400.0)) == pytest.approx(-600.0, abs=0.02)
    assert "depth_bnds" in read_currents(path).took["bottom"]


def test_a_depth_in_a_file_beside_on_a_wider_grid(tmp_path):
    columns = written(tmp_path, both(dataset(depth=DEEP), lambda one: one.where(one.depth < 600.0)))
    lon, lat = np.arange(15.0, 26.01, 0.1), np.arange(58.0, 63.01, 0.1)
    static = xr.Dataset(
        {"deptho": (("lat", "lon"), np.full((lat.size, lon.size), 555.0), {"units": "m"})},
        {"lon": ("lon", lon, {"units": "degrees_east"}), "lat": ("lat", lat, {"units": "degrees_north"})},
    )
    beside = written(tmp_path, static, "static.nc")
    file = read_currents([columns, beside])
    assert sample(file, 20.5, 60.5, 550.0) is not None
    assert sample(file, 20.5, 60.5, 560.0) is None
    assert "deptho" in file.took["bottom"]
    # of the same size, yet elsewhere: never taken by its dimensions alone
    moved = static.isel(lon=slice(0, LON.size), lat=slice(0, LAT.size))
    file = read_currents([columns, written(tmp_path, moved, "elsewhere.nc")])
    assert "deepest level" in file.took["bottom"] or np.isnan(file.seabed).sum() == 0
    assert sample(file, 20.5, 60.5, 520.0) is None


def test_a_depth_that_the_levels_belie_opens_no_water_without_data(tmp_path):
    data = both(dataset(depth=DEEP), lambda one: one.where(one.depth < 600.0))
    path = written(tmp_path, with_depth(data, "deptho", 2000.0))
    assert water(path, 20.5, 60.5, 500.0) is not None
    assert water(path, 20.5, 60.5, 560.0) is None
    said = {"bottom": "none"}
    assert "deepest level" in read_currents(path, said).took["bottom"]


LEVELS = 20
S = (np.arange(LEVELS) + 0.5) / LEVELS - 1


def sigma_file(folder, which, h=400.0):
    stretch = (1 - np.cosh(4 * S)) / (np.cosh(4.0) - 1)
    z = h * (20 * S + h * stretch) / (20 + h)
    u, v = np.broadcast_arrays(*current(LON, LAT[:, None], -z[:, None, None]))
    dims = ("s_rho", "lat", "lon")
    data = xr.Dataset(
        {
            "u_eastward": (dims, u, EAST),
            "v_northward": (dims, v, NORTH),
            "h": (("lat", "lon"), np.full((LAT.size, LON.size), h), {"units": "m"}),
            "Cs_r": ("s_rho", stretch),
            "hc": 20.0,
            "Vtransform": 2,
        },
        {
            "s_rho": ("s_rho", S),
            "lat": ("lat", LAT, {"units": "degrees_north"}),
            "lon": ("lon", LON, {"units": "degrees_east"}),
        },
    ).isel(s_rho=which)
    return written(folder, data, "sigma.nc"), -z[which]


def test_some_sigma_levels_are_not_a_whole_column(tmp_path):
    path, at = sigma_file(tmp_path, slice(None))
    for depth in (0.0, 30.0, 250.0):
        assert water(path, 20.5, 60.5, depth) == pytest.approx(current(20.5, 60.5, depth), abs=5e-3)
    path, at = sigma_file(tmp_path, slice(12, None))
    inside, below = 0.9 * at.max(), 1.3 * at.max()
    assert water(path, 20.5, 60.5, inside) == pytest.approx(current(20.5, 60.5, inside), abs=1e-3)
    assert water(path, 20.5, 60.5, below) is None
    with pytest.raises(
        InputError, match=r"the domain reaches 300 m deep, but the deepest level of sigma.nc is at"
    ):
        read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 300.0))
    path, at = sigma_file(tmp_path, slice(0, 5))
    assert water(path, 20.5, 60.5, 10.0) is None
    assert water(path, 20.5, 60.5, 0.98 * at.max()) == pytest.approx(
        current(20.5, 60.5, 0.98 * at.max()), abs=5e-3
    )
    depths = describe(path).as_dict()["depths_m"]
    assert 0.7 * at.min() < depths[0] < at.min()
    with pytest.raises(InputError, match=r"the domain begins at 0 m, but the data of sigma.nc begin at"):
        read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 300.0))
    path, at = sigma_file(tmp_path, slice(19, 20))
    assert water(path, 20.5, 60.5, 0.0) == pytest.approx(current(20.5, 60.5, at[0]), abs=1e-3)
    assert water(path, 20.5, 60.5, 100.0) is None
    path, _ = sigma_file(tmp_path, slice(9, 10))
    with pytest.raises(
        InputError, match=r"one terrain-following level, at s = -0.525, far from surface and seabed"
    ):
        read_currents(path)


def test_a_form_of_levels_that_contradicts_the_file_is_refused(tmp_path):
    path, _ = sigma_file(tmp_path, slice(None))
    data = xr.load_dataset(path)
    data.s_rho.attrs["standard_name"] = "ocean_s_coordinate_g1"
    with pytest.raises(
        InputError, match=r"of the form 'ocean_s_coordinate_g1', but the file says `Vtransform` = 2.0"
    ):
        read_currents(written(tmp_path, data, "other.nc"))


def test_a_file_cut_to_its_lower_fixed_levels_says_nothing_of_the_surface(tmp_path):
    path = written(tmp_path, dataset(depth=[100.0, 150.0, 200.0]))
    assert water(path, 20.5, 60.5, 0.0) is None
    assert water(path, 20.5, 60.5, 90.0) is not None  # half a level's spacing
    with pytest.raises(InputError, match=r"the domain begins at 0 m, but the data of currents.nc begin at 75 m"):
        read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 150.0))


def radar(zeros, fills=True):
    """Surface currents of 0.1 m/s with some that are exactly 0, as a radar measures them."""
    data = both(dataset(depth=None), lambda one: one / 3)
    for j, i in zeros:
        data.uo[j, i] = data.vo[j, i] = 0.0
    return both(data, lambda one: one.where(one.lon < 20.75)) if fills else data


@pytest.mark.parametrize("fills", [True, False])
def test_measured_calm_is_water(tmp_path, fills):
    path = written(tmp_path, radar([(3, 3), (5, 5), (5, 6), (8, 2)], fills))
    assert water(path, float(LON[3]), float(LAT[3]), 0.0) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert any("calm water" in note for note in read_currents(path).notes)
    if fills:
        assert water(path, 20.9, 60.5, 0.0) is None
    # the same where a domain is cut about it
    part = read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 0.0))
    assert sample(part, float(LON[5]), float(LAT[5]), 0.0) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_patches_of_zeros_are_land_or_asked_about(tmp_path):
    patch = [(j, i) for j in range(2, 7) for i in range(2, 6)]
    path = written(tmp_path, radar(patch, fills=False))
    assert water(path, float(LON[4]), float(LAT[4]), 0.0) is None
    assert "zeros (land)" in read_currents(path).took["land"]
    # an island of one point, where zeros are land elsewhere in the file, though not in the domain
    small = written(tmp_path, radar([(8, 8), *patch], fills=False), "island.nc")
    part = read_currents(small, lon=(20.7, 20.9), lat=(60.7, 60.9), depth=(0.0, 0.0))
    assert sample(part, float(LON[8]), float(LAT[8]), 0.0) is None
    both_kinds = written(tmp_path, radar(patch, fills=True), "both.nc")
    with pytest.raises(
        InputError, match=r'both.nc holds both missing values and wide patches .* "land" or "calm"'
    ):
        read_currents(both_kinds)
    assert water(both_kinds, float(LON[4]), float(LAT[4]), 0.0, {"zeros": "land"}) is None
    assert water(both_kinds, float(LON[4]), float(LAT[4]), 0.0, {"zeros": "calm"}) == pytest.approx((0.0, 0.0))


def test_a_mask_says_what_zeros_are(tmp_path):
    patch = [(j, i) for j in range(2, 7) for i in range(2, 6)]
    data = radar(patch, fills=False)
    open_water = data.assign(mask_rho=(("lat", "lon"), np.ones((LAT.size, LON.size))))
    path = written(tmp_path, open_water)
    assert water(path, float(LON[4]), float(LAT[4]), 0.0) == pytest.approx((0.0, 0.0))


def test_the_calm_middle_of_an_eddy_is_water(tmp_path):
    x, y = np.meshgrid(LON - LON[5], LAT - LAT[5])
    column = np.ones((DEPTH.size, 1, 1))
    data = dataset()
    data.uo[:], data.vo[:] = -y * column, x * column
    path = written(tmp_path, data)
    assert water(path, float(LON[5]), float(LAT[5]), 60.0) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_roadmap_keeps_what_describe_says(tmp_path):
    path = written(tmp_path, tiles(dataset()))
    took = describe(path).as_dict()["took"]
    _, bottom, words = OceanFlow((str(path),)).waters(FRAME, *DOMAIN, (0.0, 20.0))
    for key in ("bottom", "levels", "stamps"):
        assert f"{key}: {took[key]}" in words, key
    assert "land: " in words
    assert (bottom.ground[:, 3:7] == -30.01).all()
    for key in ("bottom", "land", "levels", "stamps"):
        assert took[key] in str(describe(path))


def test_open_by_the_planner_and_open_by_describe_are_the_same(tmp_path):
    path = written(tmp_path, tiles(dataset()))
    whole = read_currents(path)
    part = read_currents(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 60.0))
    _, seabed = ocean_flow(part, FRAME, *DOMAIN, (0.0, 60.0))
    for lon, lat in np.random.default_rng(2).uniform((20.36, 60.36), (20.64, 60.64), (25, 2)):
        x, y = (float(one) for one in FRAME.to_local(lon, lat))
        for depth in (5.0, 29.0, 31.0, 55.0):
            assert (sample(whole, lon, lat, depth) is not None) == allowed(seabed, x, y, -depth)
