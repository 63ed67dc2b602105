"""Where compiled kernels are kept: a folder that another user owns or may write in is not used."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

from glider_stream.kernels import cache

pytestmark = pytest.mark.skipif(os.name == "nt", reason="owners and modes are those of Unix")
DIGEST = cache.KERNEL_DIGEST[:16]


@pytest.fixture
def only(tmp_path, monkeypatch):
    """The places to choose from: the user's, then a second."""
    first, second = tmp_path / "first", tmp_path / "second"
    monkeypatch.setattr(cache, "_places", lambda: iter([first, second]))
    return first, second


def mode_of(folder):
    return stat.S_IMODE(folder.stat().st_mode)


@pytest.mark.parametrize("mask", [0o022, 0o002, 0o000])
def test_our_cache_folder_is_not_open_to_others(only, mask):
    before = os.umask(mask)
    try:
        assert cache.cache_folder() == only[0] / DIGEST
    finally:
        os.umask(before)
    assert (mode_of(only[0]), mode_of(only[0] / DIGEST)) == (0o700, 0o700)


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o722, 0o1777])
def test_a_folder_that_others_may_write_in_is_not_used(only, mode):
    (only[0] / DIGEST).mkdir(parents=True)
    (only[0] / DIGEST).chmod(mode)
    assert cache.cache_folder() == only[1] / DIGEST


def test_a_folder_that_others_may_move_is_not_used(only):
    only[0].mkdir()
    only[0].chmod(0o777)
    assert cache.cache_folder() == only[1] / DIGEST
    only[0].chmod(0o1777)  # as /tmp has it
    assert cache.cache_folder() == only[0] / DIGEST


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root gives files away")
def test_a_folder_of_another_user_is_not_used(only):
    (only[0] / DIGEST).mkdir(parents=True, mode=0o700)
    os.chown(only[0] / DIGEST, 12345, 12345)
    assert cache.cache_folder() == only[1] / DIGEST
    os.chown(only[0] / DIGEST, 0, 0)
    os.chown(only[0], 12345, 12345)
    assert cache.cache_folder() == only[1] / DIGEST


def test_a_link_is_not_followed(only, tmp_path):
    only[0].mkdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (only[0] / DIGEST).symlink_to(tmp_path / "elsewhere")
    assert cache.cache_folder() == only[1] / DIGEST


def test_an_account_without_a_home(monkeypatch, tmp_path):
    def nobody(self):
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", nobody)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    places = list(cache._places())
    assert places[-1] == tmp_path / f"glider-stream-{os.geteuid()}"
    monkeypatch.setattr(cache, "_places", lambda: iter(places[-1:]))
    folder = cache.cache_folder()
    assert folder is not None
    assert mode_of(folder.parent) == 0o700
