"""The vertical part of currents from files: a variable on its own levels, continuity, refusals."""

import math

import numpy as np
import pytest
from helpers.currents import DOMAIN, dataset, written

from glider_stream.base.errors import InputError
from glider_stream.kernels.flow import OceanGrid, RisingOceanGrid, current, max_rise, velocity
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import OceanFlow, read_currents
from glider_stream.water.ocean.vertical import on_levels

xr = pytest.importorskip("xarray")

LEVELS = np.array([0.0, 5.0, 20.0, 40.0, 62.0, 85.0, 120.0])
FRAME = LocalFrame(20.5, 60.5)
RADIUS = 6.371e6


def with_w(**attrs):
    """The small current file with a vertical current on its own levels, growing with depth and toward east."""
    data = dataset()
    depth, _, lon = np.meshgrid(LEVELS, data.lat, data.lon, indexing="ij")
    data["wo"] = (("depthw", "lat", "lon"), 1e-4 * depth * (1 + lon - 20.5), {"units": "m s-1"} | attrs)
    data["depthw"] = ("depthw", LEVELS, {"units": "m", "positive": "down"})
    return data


def waters(folder, data, **how):
    return OceanFlow((str(written(folder, data)),), **how).waters(FRAME, *DOMAIN, (0.0, 80.0))


def test_a_variable_is_read_on_its_own_levels_beside_the_same_currents(tmp_path):
    flow, _, told = waters(tmp_path, with_w(standard_name="upward_sea_water_velocity"), vertical="wo")
    plain, _, note = waters(tmp_path, with_w(standard_name="upward_sea_water_velocity"))
    assert isinstance(flow, RisingOceanGrid)
    assert isinstance(plain, OceanGrid)
    assert "vertical current `wo`" in told
    assert "`wo` may be a vertical current" in note
    assert "may be" not in told
    for x, y, z in ((0.0, 0.0, -33.0), (3000.0, -2000.0, -7.0), (-2500.0, 4000.0, -70.0)):
        assert current(flow, x, y, z, 0.0)[:2] == pytest.approx(velocity(plain, x, y, z, 0.0), abs=1e-12)
        lon, _ = FRAME.to_lonlat(x, y)
        assert current(flow, x, y, z, 0.0)[2] == pytest.approx(-1e-4 * z * (1 + lon - 20.5), abs=1e-6)


@pytest.mark.parametrize(("how", "sign"), [({"long_name": "downward velocity"}, -1), ({}, 1)])
def test_which_way_is_up_comes_from_the_file_or_from_the_user(tmp_path, how, sign):
    flow, _, _ = waters(tmp_path, with_w(**how), vertical="wo", upward=None if how else True)
    assert current(flow, 0.0, 0.0, -40.0, 0.0)[2] == pytest.approx(sign * 4e-3, rel=1e-3)


def test_continuity_lifts_water_under_a_divergence(tmp_path):
    flow, _, told = waters(tmp_path, dataset(), vertical="continuity")
    assert "by continuity from the surface down" in told
    degree = math.radians(1) * RADIUS
    for z in (-20.0, -60.0):
        # du/dlon = dv/dlat = 0.1 a degree at every depth; v changes the width of a meridian's strip
        v = np.mean([velocity(flow, 0.0, 0.0, part * z, 0.0)[1] for part in np.linspace(0, 1, 11)])
        spread = 0.1 / (degree * math.cos(math.radians(60.5))) + 0.1 / degree
        spread -= v * math.tan(math.radians(60.5)) / RADIUS
        assert current(flow, 0.0, 0.0, z, 0.0)[2] == pytest.approx(-spread * z, rel=0.01)
    assert max_rise(flow) > 0


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ({"vertical": "wo"}, r"`wo` of currents.nc does not say whether it counts upward"),
        ({"vertical": "omega"}, r"none holds `omega`.*continuity.*wo"),
        ({"vertical": "continuity", "upward": True}, r"flow\.upward"),
    ],
)
def test_what_is_not_known_is_refused(tmp_path, how, why):
    with pytest.raises(InputError, match=why):
        waters(tmp_path, with_w(), **how)


def test_one_level_has_no_continuity(tmp_path):
    with pytest.raises(InputError, match=r"continuity.* needs the currents of two levels.* has one"):
        waters(tmp_path, dataset(depth=None), vertical="continuity")


def test_a_vertical_wind_is_no_current(tmp_path):
    data = with_w().rename(wo="wz").assign(wz=with_w().wo.assign_attrs(long_name="vertical velocity of air"))
    assert not any("vertical" in note for note in read_currents(written(tmp_path, data)).notes)


def test_levels_between_levels_change_nothing():
    values, levels = np.random.default_rng(0).normal(size=(2, 4, 3, 3, 1)), np.array([-9.0, -4.0, -1.0, 0.0])
    finer = on_levels(values, levels, np.array([-9.0, -6.5, -4.0, -1.0, 0.0, 3.0]))
    np.testing.assert_allclose(finer[:, [0, 2, 3, 4]], values, rtol=0, atol=1e-15)
    np.testing.assert_allclose(finer[:, 1], values[:, :2].mean(axis=1), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(finer[:, 5], values[:, 3])
