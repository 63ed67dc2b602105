"""Members of an ensemble: one for a plan, all for a program; never the first without a word."""

import numpy as np
import pytest
import xarray as xr
from helpers.currents import DOMAIN, both, dataset, written

from glider_stream.base.errors import InputError
from glider_stream.water.frame import LocalFrame
from glider_stream.water.ocean import OceanFlow, read_currents, read_members


def scaled(factor, hours=None):
    return both(dataset(hours=hours), lambda part: factor * part)


def ensemble(dim="member", labels=None, count=3):
    data = xr.concat([scaled(n + 1.0) for n in range(count)], dim)
    return data if labels is None else data.assign_coords({dim: labels})


@pytest.mark.parametrize("dim", ["member", "realization", "ensemble", "number", "ens"])
def test_all_members_of_a_file(tmp_path, dim):
    path = written(tmp_path, ensemble(dim))
    members = read_members(path)
    plain = read_currents(written(tmp_path, dataset(), "plain.nc"))
    for n, member in enumerate(members):
        assert member.u == pytest.approx((n + 1) * plain.u)
    with pytest.raises(
        InputError, match=f"3 members along `{dim}`, 0 to 2: set `member` in `names`, or `flow.mem"
    ):
        read_currents(path)


def test_a_plan_reads_the_member_that_it_names(tmp_path):
    path, frame = written(tmp_path, ensemble("number", [4, 7, 9])), LocalFrame.over(*DOMAIN)

    def fastest(member):
        flow = OceanFlow((str(path),), member=member)
        return flow.waters(frame, *DOMAIN, (0.0, 50.0))[0].extent.max_speed

    assert fastest(7) == pytest.approx(2 * fastest(4), rel=1e-5)
    with pytest.raises(InputError, match="holds no member 5 along `number`, 4 to 9; name another `member`"):
        fastest(5)
    with pytest.raises(InputError, match="3 members along `number`, 4 to 9: set `member`"):
        fastest(None)
    assert [len(read_members(path, lon=DOMAIN[0], lat=DOMAIN[1], depth=(0.0, 50.0)))] == [3]


def test_several_files_are_members_or_times(tmp_path):
    one, two = (written(tmp_path, scaled(n, [0.0, 6.0]), f"{n}.nc") for n in (1, 2))
    members = read_members([one, two])
    assert members[1].u == pytest.approx(2 * members[0].u)
    with pytest.raises(
        InputError, match=r"is given more than once; leave out the overlap, or, if these files are mem"
    ):
        read_currents([one, two])
    later = written(tmp_path, scaled(2, [12.0, 18.0]), "later.nc")
    with pytest.raises(InputError, match=r"1\.nc and later\.nc have different times: members must have the same"):
        read_members([one, later])
    # members along a dimension: several files are stretches of time
    parts = [
        written(tmp_path, xr.concat([scaled(1, hours), scaled(2, hours)], "member"), f"part{n}.nc")
        for n, hours in enumerate(([0.0, 6.0], [12.0, 18.0]))
    ]
    joined = read_members(parts)
    assert [member.u.shape[0] for member in joined] == [4, 4]
    assert joined[1].u == pytest.approx(2 * joined[0].u)


def test_a_member_of_a_file_without_members_is_refused(tmp_path):
    """The setting is never passed over without a word."""
    plain = written(tmp_path, dataset())
    with pytest.raises(InputError, match=r"currents\.nc holds no members, but `member` = 3: leave `member` out"):
        read_currents(plain, {"member": 3})
    single = written(tmp_path, dataset().assign_coords(number=7), "single.nc")
    assert np.isfinite(read_currents(single, {"member": 7}).u).all()
    with pytest.raises(InputError, match=r"single\.nc holds member 7 alone, but `member` = 3"):
        read_currents(single, {"member": 3})
    alone = written(tmp_path, ensemble("number", [4], count=1), "alone.nc")
    assert "member 4 of 1 along `number`, as you say" in read_currents(alone, {"member": 4}).notes
    with pytest.raises(InputError, match="holds no member 3 along `number`"):
        read_currents(alone, {"member": 3})
    with pytest.raises(InputError, match=r"currents\.nc holds no members: name a file that does"):
        read_members(plain)
    with pytest.raises(InputError, match="all members are read: leave out `member` = 1"):
        read_members(plain, {"member": 1})
