"""Opens ocean files, which are untrusted input: NetCDF of all versions and Zarr, by xarray."""

import errno
import json
import os
import re
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

from ...base.errors import InputError
from ...base.settings import require
from ...base.untrusted import check_claim, check_file, check_links, groups_of
from .grib import open_grib

TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""The first bytes of TIFF files."""
OTHER_KINDS = {
    b"GRIB": "a GRIB file: install cfgrib, or convert it with `cdo -f nc4 copy` or `grib_to_netcdf`",
    **dict.fromkeys(TIFF, "a GeoTIFF: install rioxarray, or convert it with `gdal_translate -of netCDF`"),
    b"PK\x03\x04": "a zip archive: unpack it with `unzip`, and name the file in it",
    b"\x1f\x8b": "packed by gzip: unpack it with `gunzip`",
    b"BZh": "packed by bzip2: unpack it with `bunzip2`",
    b"\xfd7zXZ": "packed by xz: unpack it with `unxz`",
    b"\x0e\x03\x13\x01": "an HDF4 file: convert it with `h4tonccf_nc4` or `gdal_translate -of netCDF`",
    b"ncols": "an ESRI ASCII grid: convert it with `gdal_translate -of netCDF`",
    b"NCOLS": "an ESRI ASCII grid: convert it with `gdal_translate -of netCDF`",
    b"DSAA": "a Surfer grid: convert it with `gdal_translate -of netCDF`",
}
"""The first bytes of files that cannot be read, and the tool that converts them."""
MOST_STORE_FILES = 100_000
"""A Zarr store may hold at most this many files."""


DECODERS = re.compile(
    r"^(xarray\.(backends|coding|conventions)|h5netcdf|h5py|scipy\.io|zarr|numcodecs|cftime|netCDF4|cfgrib|eccodes|rasterio|rioxarray)\b"
)
"""Packages that read files: an error that is raised in one of them is about the file."""


@contextmanager
def opened(path: Path, group: str | None = None) -> Iterator[Any]:
    """Yield the xarray.Dataset of a file, with times undecoded.

    InputError if it is not a grid file or is damaged. `group`: the group of a NetCDF-4 file. If only one group
    holds grids, it is taken.
    """
    _needs("xarray", path)
    _needs("cf_xarray", path)
    import cf_xarray  # noqa: F401  (registers the accessor)
    import xarray

    address = re.match(r"[a-z][\w+.-]+:{1,2}/", str(path)) is not None and not path.exists()
    require(not address, f"{path} is an address: download the file, and name it where it is then")
    require(path.exists(), f"the file {path} does not exist")
    check_file(path, "the file")
    engine, more = _engine(path)
    try:
        if engine == "h5netcdf":
            check_links(path)
            more = {"group": _group(path, group)}
        with warnings.catch_warnings():
            # warnings of the reading packages, and of old attributes: several fill values, odd calendars
            warnings.simplefilter("ignore")
            if engine == "cfgrib":
                data = open_grib(path)
            else:
                data = xarray.open_dataset(path, engine=engine, decode_times=False, cache=False, **more)
            if engine == "rasterio":
                data = data.rio.write_coordinate_system()
    except InputError:
        raise
    except Exception as error:
        # the libraries do not document what they raise for a damaged file
        raise _damaged(path, error) from None
    with warnings.catch_warnings(), data:
        warnings.simplefilter("ignore", xarray.SerializationWarning)
        warnings.filterwarnings("ignore", category=RuntimeWarning, module=r"xarray|scipy")
        warnings.filterwarnings("ignore", module=r"zarr")
        try:
            _check_claims(path, data)
            yield _with_parents(path, data, more.get("group"))
        except InputError:
            raise
        except Exception as error:
            if _of_the_file(error):
                raise _damaged(path, error) from None
            raise


DISK = {
    getattr(errno, name)
    for name in ("ESTALE", "EIO", "ETIMEDOUT", "ENOTCONN", "EHOSTDOWN", "EREMOTEIO", "ENXIO")
    if hasattr(errno, name)
}
"""Errors of a disk or of a network's file system, which say nothing of the file."""


def _damaged(path: Path, error: Exception) -> InputError:
    said = re.search(r"errno = (\d+)", str(error))
    number = int(said[1]) if said else getattr(error, "errno", None)
    if isinstance(number, int) and number in DISK:
        return InputError(
            f"{path.name} cannot be read: {os.strerror(number).lower()}; look to its disk or network, then give "
            "the same command again"
        )
    what = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(f"{path.name} cannot be read; it may be truncated or damaged ({what}): get it again")


def _of_the_file(error: Exception) -> bool:
    """Return whether an error was raised by a reading package and not by this one."""
    if not isinstance(error.__traceback__, TracebackType):
        return False
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    last = max((n for n, name in enumerate(modules) if name.startswith("glider_stream")), default=-1)
    return any(DECODERS.match(name) for name in modules[last + 1 :])


def _group(path: Path, named: str | None) -> str | None:
    """Return the group that holds grids: the user's, the root, or the only one that does."""
    every, grids = groups_of(path)
    if named is not None:
        wanted = named.strip("/")
        known = ", ".join(every) or "none"
        require(wanted in (*every, ""), f"{path.name} holds no group `{named}`; it holds: {known}")
        return wanted or None
    if not grids or "" in grids:
        return None
    require(
        len(grids) == 1,
        f"{path.name} holds grids in {len(grids)} groups, {', '.join(sorted(grids)[:6])}: set `group` in `names`",
    )
    return grids.pop()


def _with_parents(path: Path, data: Any, group: str | None) -> Any:
    """Return the data of a group, with the axes of the groups around it."""
    import xarray

    while group:
        group = group.rpartition("/")[0]
        with xarray.open_dataset(
            path, engine="h5netcdf", decode_times=False, cache=False, group=group or None
        ) as around:
            _check_claims(path, around)
            missing = {
                name: variable.load()
                for name, variable in around.variables.items()
                if name not in data.variables
                and all(data.sizes.get(dim, n) == n for dim, n in variable.sizes.items())
            }
            data = data.assign(missing)
    return data


def _needs(module: str, path: Path) -> None:
    name = module.replace("_", "-")
    found = find_spec(module) is not None
    require(found, f"reading {path.name} needs {name}, which is missing: pip install glider-stream[ocean]")


def _engine(path: Path) -> tuple[str, dict[str, Any]]:
    """Return the engine that opens a file and its options; InputError names a tool that converts the file."""
    if path.is_dir():
        store = any((path / name).is_file() for name in ("zarr.json", ".zgroup", ".zmetadata"))
        require(store, f"{path} is a folder but not a Zarr store; name the NetCDF file in it")
        _needs("zarr", path)
        _check_store(path)
        # with this option it neither guesses nor warns
        return "zarr", {"consolidated": _is_consolidated(path)}
    try:
        with path.open("rb") as stream:
            head = stream.read(2056)
    except OSError as error:
        raise InputError(f"the file {path} cannot be read: {error.strerror}") from None
    require(head[:4] != b"CDF\x05", f"{path.name} is a NetCDF-5 file: rewrite it with `nccopy -k nc4`")
    if any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048)):
        _needs("h5netcdf", path)
        return "h5netcdf", {}
    if head[:4] in (b"CDF\x01", b"CDF\x02"):
        return "scipy", {}
    if head[:4] == b"GRIB" and find_spec("cfgrib") is not None:
        return "cfgrib", {}
    if head[:4] in TIFF and find_spec("rioxarray") is not None:
        return "rasterio", {}
    for mark, what in OTHER_KINDS.items():
        require(not head.startswith(mark), f"{path.name} is {what}")
    raise InputError(f"{path.name} is not a NetCDF file, although its name may say so; give a NetCDF file")


def _is_consolidated(path: Path) -> bool:
    """Return whether a Zarr store keeps its metadata in one file."""
    if (path / ".zmetadata").is_file():
        return True
    whole = path / "zarr.json"
    return whole.is_file() and "consolidated_metadata" in json.loads(whole.read_text(encoding="utf-8"))


def _check_store(path: Path) -> None:
    """Raise InputError if a Zarr store uses a codec that unpickles, because that can run any code."""
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
    """Raise InputError if a file declares more data than a file of its size can hold, before memory is used."""
    held = sum(f.stat().st_size for f in path.rglob("*") if f.is_file()) if path.is_dir() else path.stat().st_size
    for name, variable in data.variables.items():
        if path.is_dir() and (path / str(name)).is_dir():
            held = sum(part.stat().st_size for part in (path / str(name)).rglob("*") if part.is_file())
        check_claim(path.name, f"`{name}`", variable.shape, variable.dtype.itemsize, held)
