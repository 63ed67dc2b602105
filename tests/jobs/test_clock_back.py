"""A clock that is set back in the middle of a build changes nothing but the date in the file."""

import itertools
import time
from datetime import UTC, datetime, timedelta

import pytest
from helpers.builds import BATCH, datasets, expected, problem
from helpers.small import scenario_file

from glider_stream.base.errors import Stopped
from glider_stream.jobs.build import Job, build_file
from glider_stream.roadmap import provenance


class Backward(datetime):
    """A clock on which every look is a year before the last one."""

    looks = itertools.count(1)

    @classmethod
    def now(cls, zone=None):
        return datetime(2026, 1, 1, tzinfo=UTC) - timedelta(days=365 * next(cls.looks))


def test_a_clock_that_is_set_back(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario_file(tmp_path)
    expected.cache_clear()
    whole = expected("streamline")
    years = itertools.count(1)
    monkeypatch.setattr(provenance, "datetime", Backward)
    monkeypatch.setattr(time, "time", lambda: 1.7e9 - 3e7 * next(years))
    seen = []

    def stop(progress):
        seen.append(progress)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(Stopped):
        build_file(problem(tmp_path), "road.h5", progress=stop, batch_pairs=BATCH, job=Job(checkpoint=0.0))
    kept = seen[-1].done
    build_file(problem(tmp_path), "road.h5", progress=seen.append, batch_pairs=BATCH)
    assert seen[2].done > kept > 0
    assert all(progress.seconds >= 0 for progress in seen)
    assert datasets("road.h5") == whole
    assert next(Backward.looks) > 2
