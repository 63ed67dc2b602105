"""Times as people read them: date and time in UTC if the departure is known, else hours."""

from datetime import datetime, timedelta

HOUR = 3600.0


def moment(departs: datetime | None, seconds: float) -> str:
    """Return a time [s] after a departure: `2024-11-20 12:16Z` (UTC) if that is known, else the hours."""
    if departs is None:
        return f"{hours(seconds)} h"
    return (departs + timedelta(seconds=seconds)).strftime("%Y-%m-%d %H:%MZ")


def span(seconds: float) -> str:
    """Return a length of time [s] as text in seconds and in hours."""
    return f"{seconds:,.0f} s ({hours(seconds)} h)"


def hours(seconds: float) -> str:
    """Return a time [s] as text in hours."""
    return f"{seconds / HOUR:,.2f}"
