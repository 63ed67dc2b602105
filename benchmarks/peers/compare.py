"""What a record says: whether this project's route is the fastest; which ratios moved since an older record."""

from typing import Any

Row = dict[str, Any]

OURS, BOUND = "glider-stream", "hj_reachability"
TOLERANCE = 0.005
"""A route that is longer by no more than this share is no slower."""
MOVED = {"route": 0.005, "rate": 0.25, "time to plan": 0.25}
"""A ratio has moved if it changed by more than this share."""


def route_of(row: Row) -> float | None:
    """The time [s] of a row's route: as flown, or the median of its runs. None if it has none, or is no route."""
    if row["peer"] == BOUND:
        return None
    found: float | None = row["routes_s"]["median"] if "routes_s" in row else row.get("route_s")
    return found


def beside_ours(rows: list[Row]) -> list[tuple[str, Row, float]]:
    """Every problem with routes: its name, the fastest peer's row, and our time over that peer's."""
    found = []
    for problem in dict.fromkeys(row["problem"] for row in rows):
        times = {row["peer"]: (route_of(row), row) for row in rows if row["problem"] == problem}
        ours = times.pop(OURS, (None, {}))[0]
        others = [(time, row) for time, row in times.values() if time is not None]
        if ours is not None and others:
            least, row = min(others, key=lambda one: one[0])
            found.append((problem, row, ours / least))
    return found


def answer(rows: list[Row]) -> str:
    """One sentence: on how many problems no peer's route is faster than ours by over TOLERANCE; where one is."""
    told = beside_ours(rows)
    if not told:
        return "No problem has both a route of ours and a peer's."
    slower = [
        f"{problem} ({row['peer']}, {100 * (over - 1):.1f} %)"
        for problem, row, over in told
        if over > 1 + TOLERANCE
    ]
    else_where = f"; slower on {', '.join(slower)}" if slower else ""
    return (
        f"On {len(told) - len(slower)} of {len(told)} problems our route is no slower than any peer's "
        f"by more than {100 * TOLERANCE:g} %{else_where}."
    )


def ratios(rows: list[Row]) -> dict[tuple[str, str, str], float]:
    """What records can compare, by problem, peer, kind: routes over the reference, rates and times over ours."""
    found = {}
    for row in rows:
        ours = next((one for one in rows if one["peer"] == OURS and one["problem"] == row["problem"]), {})
        if row.get("over_level_set") is not None:
            found[row["problem"], row["peer"], "route"] = row["over_level_set"]
        for kind, key in (("rate", "evaluations_per_s"), ("time to plan", "processor_s")):
            drift = row["problem"] == "drift"
            if row["peer"] != OURS and drift == (kind == "rate") and key in row and key in ours:
                found[row["problem"], row["peer"], kind] = row[key]["median"] / ours[key]["median"]
    return found


def moved(old: list[Row], new: list[Row]) -> str:
    """A line for each ratio that moved by more than MOVED, that is new or that is gone; one if none did."""
    before, now = ratios(old), ratios(new)
    lines = [f"{', '.join(key)}: new, {now[key]:.4g}" for key in now if key not in before]
    lines += [f"{', '.join(key)}: gone, was {before[key]:.4g}" for key in before if key not in now]
    for key in now:
        if key in before and abs(now[key] / before[key] - 1.0) > MOVED[key[2]]:
            change = 100.0 * (now[key] / before[key] - 1.0)
            lines.append(f"{', '.join(key)}: {before[key]:.4g} before, {now[key]:.4g} now ({change:+.1f} %)")
    return "\n".join(lines) or f"None of {len(now)} ratios moved."
