"""Times of ocean files in UTC: instants, means, forecast runs with lead times, files without a time."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.settings import require
from .file import Times, parse_time
from .names import SINCE, Catalogue, Names, standard_name, units_of
from .units import in_seconds

REFERENCE = re.compile(
    r"^(forecast_)?(reference_time|reftime)$|^(run|run_time|init|init_time|analysis_time)$", re.I
)
"""Names of the time at which a forecast begins."""
LEAD = re.compile(
    r"^(step|lead|lead_time|leadtime|forecast_period|forecast_hour|fhour|tau|prediction_timedelta)$", re.I
)
"""Names of the time since the forecast began (the lead time)."""
MEAN_TITLES = re.compile(
    r"\b(daily|hourly|monthly|weekly|annual|yearly|time|\d+.?(day|hour|month)\w*)[\s_-]*(mean|average)"
    r"|\baverages? file|(mean|average)s? (of|over) (one|a|each|\d)|(?<![A-Za-z])P(1D|1M|T\d+H)-m\b|\bday_mean\b"
    r"|\b(mean|average)d? fields?",
    re.I,
)
"""Titles and products that contain one of these phrases are means over time."""
TITLES = (
    "title",
    "id",
    "product",
    "product_id",
    "dataset",
    "dataset_id",
    "type",
    "field_type",
    "summary",
    "source",
)
MEAN_WORDS = ("mean", "average", "averaged", "avg")
NO_CURRENT_THEN = re.compile(r"max|min|range|std|standard_dev|variance|sum|root_mean|mid_range|mode\b")
"""What `cell_methods` may say of an interval that no current at any time of it is."""
MONTHS = "jan feb mar apr may jun jul aug sep oct nov dec"
ZONES = {"t", "z", "ut", "utc", "gmt", *MONTHS.split()}
"""Words in the date from which times count: months, and names of UTC alone. Libraries pass over all others."""


@dataclass(frozen=True)
class Clock:
    """The times of a variable.

    `times` (nt): UTC, in the order of the file, or None if the file has no time. `dims`: the dimensions of the
    times. `picked`: indices along other dimensions that the user chose. `description`: how the times were read.
    `stamps`: whether values are means, and where in their interval the times of the file stand.
    """

    times: Times | None
    dims: tuple[str, ...]
    picked: dict[str, int]
    description: str
    stamps: str
    notes: tuple[str, ...]


NO_CLOCK = Clock(None, (), {}, "", "instants: the file has no time", ())


def clock_of(at: Catalogue, variable: Any, axis: tuple[str, str] | None) -> Clock:
    """Return the times of a variable; `axis` is the dimension and the coordinate of its time, if it has one."""
    forecast = _forecast(at, variable)
    if forecast is not None:
        return forecast
    name = axis[1] if axis is not None else at.scalar(variable, "time")
    if name is None:
        return NO_CLOCK
    dims = () if axis is None else (axis[0],)
    count, more = _decoded(at, at.data[name], at.names)
    if count is None:
        return Clock(None, dims, {}, name, "instants: nothing says when", more)
    count, stamps, notes = _middles(at, variable, name, count)
    return Clock(count, dims, {}, name, stamps, more + notes)


def _rounded(values: NDArray[Any]) -> Times:
    return (values.astype("datetime64[us]") + np.timedelta64(500, "us")).astype("datetime64[ms]")


def _units(variable: Any, names: Names) -> str:
    """Return the unit of a time; if it has no origin, the origin that the user gives is added."""
    units = units_of(variable)
    if SINCE.search(units) or names.origin is None:
        return units
    origin = str(parse_time(names.origin, "`origin`").astype("datetime64[s]")).replace("T", " ")
    alone = re.sub(r"\bsince\b.*", "", units).strip()
    require(
        in_seconds(alone) is not None,
        f"the time `{variable.name}` is in {alone!r}, which is not a unit of time that can count from an origin",
    )
    return f"{alone} since {origin}"


def _decoded(
    at: Catalogue, variable: Any, names: Names, units: str | None = None
) -> tuple[Times | None, tuple[str, ...]]:
    """Return the times in UTC and notes; None for a single time whose date is unknown."""
    import xarray

    subject = f"the time `{variable.name}` in {at.name}"
    units = units or _units(variable, names)
    if not SINCE.search(units):
        require(
            variable.size == 1,
            f'{subject} has no unit such as "hours since 1950-01-01" (it has {units or "none"!r}), so '
            f"{variable.size} times are unknown: set `origin` in `names`, the date from which they count",
        )
        return None, (f"`{variable.name}` has no date",)
    origin = SINCE.split(units, maxsplit=1)[-1].lower()
    strange = [word for word in re.findall(r"[a-z]+", origin) if word not in ZONES]
    offset = re.search(r"(utc?|gmt)\s*[-+]\s*\d", origin)
    require(
        not strange and offset is None,
        f"{subject} counts from a date in a zone that cannot be told ({units!r}): write the zone into the unit "
        "as an offset from UTC, such as +02:00",
    )
    raw = np.atleast_1d(np.asarray(variable.values))
    require(
        raw.dtype.kind in "fiu" and bool(np.isfinite(raw).all()),
        f"{subject} has missing values; leave these times out",
    )
    calendar = str(variable.attrs.get("calendar", "standard"))
    try:
        # decoded alone: other coordinates of the file may not be decodable
        bare = xarray.Dataset({"time": (tuple("abc"[: raw.ndim]), raw, {"units": units, "calendar": calendar})})
        values = np.asarray(xarray.decode_cf(bare)["time"].values)
    except Exception as error:
        # the libraries do not document what they raise for an impossible unit
        raise InputError(
            f"{subject} cannot be read: units {units!r}, calendar {calendar!r} ({str(error).splitlines()[0]}); "
            "mend them"
        ) from None
    notes: tuple[str, ...] = ()
    if values.dtype.kind == "O":
        try:
            # the date is kept: 1 March stays 1 March, however long February was
            flat = [np.datetime64(moment.isoformat(), "us") for moment in values.ravel()]
            values = np.array(flat).reshape(values.shape)
        except ValueError:
            raise InputError(
                f"{subject} has dates of the calendar {calendar!r} that do not exist; mend the file"
            ) from None
        notes = (f"times of the calendar {calendar!r} keep their dates",)
    return _rounded(values), notes


def _over_time(variable: Any, clock: str) -> str:
    """Return how values stand for their time by `cell_methods` ("mean", "point", ...), or an empty text."""
    methods = str(variable.attrs.get("cell_methods", "")).lower()
    for names, method in re.findall(r"((?:\w+\s*:\s*)+)(\w+)", re.sub(r"\([^)]*\)", "", methods)):
        if {"time", "t", clock.lower()} & set(re.findall(r"\w+", names)):
            return str(method)
    online = str(variable.attrs.get("online_operation", "")).lower()
    return {"average": "mean", "instant": "point"}.get(online, "")


def _middles(at: Catalogue, variable: Any, clock: str, times: Times) -> tuple[Times, str, tuple[str, ...]]:
    """Return the times, a description and notes; times of means are moved to the middle of their intervals."""
    method = _over_time(variable, clock)
    mean = method in MEAN_WORDS
    require(
        NO_CURRENT_THEN.match(method) is None,
        f"`{variable.name}` in {at.name} is the {method} over time, as its `cell_methods` says, and no current "
        "that flows at any time: give a file of instants or means",
    )
    if at.names.stamps is not None:
        # the interval is known only when all files are joined
        return times, f"means, stamped at the {at.names.stamps} of their interval, as you say", ()
    if "climatology" in at.data[clock].attrs:
        note = f"`{clock}` is a climatology: means over several years, not a forecast"
        return times, "a climatology", (note,)
    bounds = str(at.data[clock].attrs.get("bounds", ""))
    if method == "point":
        return times, "instants, as `cell_methods` says", ()
    if bounds in at.data.variables and at.data[bounds].shape == (times.size, 2):
        limits = at.data[bounds]
        units = units_of(limits) or _units(at.data[clock], at.names)
        known = limits.assign_attrs(calendar=at.data[clock].attrs.get("calendar", "standard"))
        ends, _ = _decoded(at, known.rename(bounds), at.names, units)
        assert ends is not None
        middle = ends[:, 0] + (ends[:, 1] - ends[:, 0]) // 2
        hours = (middle - times) / np.timedelta64(3_600_000, "ms")
        inside = bool(((times >= ends.min(axis=1)) & (times <= ends.max(axis=1))).all())
        require(inside, f"the bounds `{bounds}` of `{clock}` in {at.name} do not hold its times; mend the file")
        span = float((np.abs(ends[:, 1] - ends[:, 0])).max() / np.timedelta64(3_600_000, "ms"))
        if span == 0:
            return times, f"instants, as `{bounds}` says", ()
        stamps = f"means over {span:g} h, at the middle of `{bounds}`"
        off = float(np.abs(hours).max())
        if off < 1e-3:
            return times, stamps, ()
        return middle, stamps, (f"the times are {off:g} h from the middle of `{bounds}`: the middle is used",)
    title = next((text for key in TITLES if MEAN_TITLES.search(text := str(at.data.attrs.get(key, "")))), None)
    title = "field_type = mean" if str(at.data.attrs.get("field_type", "")).lower() == "mean" else title
    if mean or title is not None:
        why = f"`{variable.name}` says {method!r} over time" if mean else f"the file says {title[:60]!r}"  # type: ignore[index]
        note = (
            f"{why}, and gives no bounds of its times: each time is taken as the middle of its interval; "
            'set `stamps` = "start" or "end" in `names` if it is not'
        )
        return times, "means, taken to stand at the middle of their interval (no bounds)", (note,)
    return times, "instants: nothing says that they are means", ()


def _forecast(at: Catalogue, variable: Any) -> Clock | None:
    """Return the times of a forecast from its runs and lead times, or None if the variable has no lead time."""
    dims = [str(dim) for dim in variable.dims]
    lead = next((dim for dim in dims if _is_lead(at, dim)), None)
    if lead is None:
        return None
    run = next((dim for dim in dims if dim != lead and _is_reference(at, dim)), None)
    picked, chosen = ({}, "") if run is None else _chosen_run(at, variable, run)
    valid = next(
        (
            at.data[name]
            for name in map(str, at.data.variables)
            if lead in at.data[name].dims
            and set(at.data[name].dims) <= {lead, run}
            and SINCE.search(_units(at.data[name], Names()))
        ),
        None,
    )
    if valid is not None:
        chosen_times = valid.isel({dim: n for dim, n in picked.items() if dim in valid.dims})
        times, notes = _decoded(at, chosen_times, at.names)
        return Clock(
            times, (lead,), picked, f"{valid.name}{chosen}", "instants: nothing says that they are means", notes
        )
    starts = [name for name in map(str, at.data.variables) if _is_start(at, name, run)]
    if len(starts) != 1:
        raise InputError(
            f"`{variable.name}` in {at.name} counts its times by `{lead}` from the start of a forecast, "
            "which the file does not give; set `time` in `names`, or add a variable with the reference time"
        )
    start = at.data[starts[0]].isel({dim: n for dim, n in picked.items() if dim in at.data[starts[0]].dims})
    begin, notes = _decoded(at, start, at.names)
    if begin is None:
        return None
    period = at.data[lead]
    seconds = in_seconds(units_of(period))
    if seconds is None:
        raise InputError(
            f"the lead time `{lead}` in {at.name} is in {units_of(period)!r}, which is not a unit of time"
        )
    after = np.rint(np.asarray(period.values, np.float64) * seconds * 1e3).astype("timedelta64[ms]")
    description = f"{starts[0]} + {lead}{chosen}"
    return Clock(
        begin.ravel()[0] + after,
        (lead,),
        picked,
        description,
        "instants: nothing says that they are means",
        notes,
    )


def _is_lead(at: Catalogue, dim: str) -> bool:
    if dim not in at.data.variables or at.data[dim].dims != (dim,):
        return False
    variable = at.data[dim]
    named = standard_name(variable) == "forecast_period" or LEAD.match(dim) is not None
    return named and not SINCE.search(units_of(variable))


def _is_reference(at: Catalogue, dim: str) -> bool:
    if REFERENCE.match(dim):
        return True
    if dim not in at.data.variables:
        return False
    return standard_name(at.data[dim]) == "forecast_reference_time" or bool(SINCE.search(units_of(at.data[dim])))


def _is_start(at: Catalogue, name: str, run: str | None) -> bool:
    """Whether a variable is the time at which the chosen run begins."""
    variable = at.data[name]
    if not SINCE.search(_units(variable, at.names)):
        return False
    if run is not None:
        return bool(variable.dims == (run,))
    known = (
        standard_name(variable) in ("forecast_reference_time", "time") or REFERENCE.match(name) or name == "time"
    )
    return variable.size == 1 and bool(known)


def _chosen_run(at: Catalogue, variable: Any, run: str) -> tuple[dict[str, int], str]:
    """Return the index of the run that is read (the only one, or the user's choice) and a text about it."""
    size = variable.sizes[run]
    if size == 1:
        return {run: 0}, ""
    wanted = at.names.run
    known = _decoded(at, at.data[run], at.names)[0] if run in at.data.variables else None
    listed = (
        "" if known is None else f", {known[0].astype('datetime64[s]')}Z to {known[-1].astype('datetime64[s]')}Z"
    )
    require(
        wanted is not None,
        f"{at.name} holds {size} runs of a forecast along `{run}`{listed}: set `run` in `names` "
        "to its number, counted from 0, or its date",
    )
    if isinstance(wanted, int):
        require(0 <= wanted < size, f"`run` must be a number from 0 to {size - 1} in {at.name}; got {wanted}")
        which = wanted
    else:
        when = parse_time(str(wanted), "`run`")
        hits = np.flatnonzero(known == when) if known is not None else np.zeros(0, np.int64)
        require(len(hits) == 1, f"{at.name} holds no run of {wanted}{listed}; name another `run`")
        which = int(hits[0])
    label = which if known is None else f"{known[which].astype('datetime64[s]')}Z"
    return {run: which}, f", run {label} of {size}"
