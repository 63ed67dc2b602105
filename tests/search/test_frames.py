"""A plan's metres count from the centre of its own domain: elsewhere they are other places, so it is refused."""

from types import SimpleNamespace

import pytest

from glider_stream.base.errors import InputError
from glider_stream.search.path import check_frame
from glider_stream.water.domain import BoxDomain, GeographicDomain

HERE = "[domain]\nlon = [18.25, 18.80]\nlat = [37.70, 38.15]\ndepth = [0.0, 600.0]\n"
"""Its centre is that of the wider domain below, but for rounding."""
WIDER = SimpleNamespace(domain=GeographicDomain((18.2, 18.85), (37.65, 38.2), (0.0, 600.0)))
EAST = SimpleNamespace(domain=GeographicDomain((18.3, 18.85), (37.70, 38.15), (0.0, 600.0)))
METRES = SimpleNamespace(domain=BoxDomain((0.0, 1.0), (0.0, 1.0), (-1.0, 0.0)))


def test_a_plan_of_the_same_centre_is_taken():
    check_frame(HERE, WIDER, "the plan")
    check_frame("", EAST, "the plan")  # an older file does not say
    check_frame("[domain]\nx = [0.0, 9.0]\ny = [0.0, 9.0]\nz = [-9.0, 0.0]\n", METRES, "the plan")


@pytest.mark.parametrize("problem", [EAST, METRES])
def test_a_plan_of_another_centre_is_refused(problem):
    with pytest.raises(InputError, match=r"the plan was planned in another \[domain\]: .*longitude 18\.525"):
        check_frame(HERE, problem, "the plan")
