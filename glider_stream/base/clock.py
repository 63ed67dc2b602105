"""Times as people read them: the date and time in UTC where a departure is known, else hours."""

from datetime import datetime, timedelta

HOUR = 3600.0


def moment(departs: datetime | None, seconds: float) -> str:
    """A time [s] after a departure: `2024-11-20 12:16Z` where that is known (UTC), else the hours since then."""
    if departs is None:
        return f"{hours(seconds)} h"
    return (departs + timedelta(seconds=seconds)).strftime("%Y-%m-%d %H:%MZ")


def span(seconds: float) -> str:
    """A length of time [s] in seconds and in hours."""
    return f"{seconds:,.0f} s ({hours(seconds)} h)"


def hours(seconds: float) -> str:
    """Hours of a time [s]."""
    return f"{seconds / HOUR:,.2f}"
