"""Opening ocean files, which are untrusted: NetCDF of either kind and Zarr, by xarray."""

import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.settings import require
from ...base.untrusted import check_claim, check_file, check_links

MOST_STORE_FILES = 100_000
"""Files of a Zarr store that are looked at."""


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """The xarray.Dataset of a file, times undecoded; InputError where it is none, or damaged."""
    _needs("xarray", path)
    _needs("cf_xarray", path)
    import cf_xarray  # noqa: F401  (registers the accessor)
    import xarray

    require(path.exists(), f"the file {path} does not exist")
    check_file(path, "the file")
    engine = _engine(path)
    with warnings.catch_warnings():
        # stale attributes of good data: several fill values, odd calendars
        warnings.simplefilter("ignore", xarray.SerializationWarning)
        warnings.filterwarnings("ignore", category=RuntimeWarning, module=r"xarray|scipy")
        warnings.filterwarnings("ignore", module=r"zarr")
        try:
            if engine == "h5netcdf":
                check_links(path)
            with xarray.open_dataset(path, engine=engine, decode_times=False, cache=False) as data:
                _check_claims(path, data)
                yield data
        except InputError:
            raise
        except Exception as error:
            # what a damaged file makes the libraries raise is not written down anywhere
            what = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(f"{path.name} cannot be read; it may be truncated or damaged: {what}") from None


def _needs(module: str, path: Path) -> None:
    name = module.replace("_", "-")
    found = find_spec(module) is not None
    require(found, f"reading {path.name} needs {name}, which is missing: pip install glider-stream[ocean]")


def _engine(path: Path) -> str:
    if path.is_dir():
        store = any((path / name).is_file() for name in ("zarr.json", ".zgroup", ".zmetadata"))
        require(store, f"{path} is a folder and no Zarr store; name the NetCDF file in it")
        _needs("zarr", path)
        _check_store(path)
        return "zarr"
    try:
        with path.open("rb") as stream:
            head = stream.read(2056)
    except OSError as error:
        raise InputError(f"the file {path} cannot be read: {error.strerror}") from None
    require(head[:4] != b"CDF\x05", f"{path.name} is a NetCDF-5 file: rewrite it with `nccopy -k nc4`")
    if any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048)):
        _needs("h5netcdf", path)
        return "h5netcdf"
    require(head[:4] in (b"CDF\x01", b"CDF\x02"), f"{path.name} is not a NetCDF file, whatever its name")
    return "scipy"


def _check_store(path: Path) -> None:
    """A Zarr store names its codecs; one that unpickles runs whatever it holds."""
    for count, file in enumerate(path.rglob("*")):
        require(count < MOST_STORE_FILES, f"{path} holds more than {MOST_STORE_FILES:,} files; cut the store")
        check_file(file, f"in {path}, ")
        if file.name not in ("zarr.json", ".zarray", ".zmetadata"):
            continue
        try:
            text = file.read_text(encoding="utf-8")
            json.loads(text)
        except (OSError, ValueError, RecursionError):
            raise InputError(f"{path.name} cannot be read; {file.name} in it is damaged") from None
        require('"pickle"' not in text, f"{path.name} holds pickled objects, which are not read: write numbers")


def _check_claims(path: Path, data: Any) -> None:
    """Refuse what no file of its size can hold, before room is made for it."""
    held = sum(f.stat().st_size for f in path.rglob("*") if f.is_file()) if path.is_dir() else path.stat().st_size
    for name, variable in data.variables.items():
        if path.is_dir() and (path / str(name)).is_dir():
            held = sum(part.stat().st_size for part in (path / str(name)).rglob("*") if part.is_file())
        check_claim(path.name, f"`{name}`", variable.shape, variable.dtype.itemsize, held)
