"""What a route's confidence says, for people: on the card, and in the answer of `confidence`."""

from collections.abc import Mapping
from typing import Any

from ..base.clock import hours


def told(confidence: Mapping[str, Any]) -> list[str]:
    """Return what a route's confidence says, as lines for people."""
    share, low, high = (100.0 * value for value in confidence["arrived_share"])
    lines = [
        f"arrives within {confidence['within_m']:g} m in {share:.0f} % ({low:.0f}-{high:.0f}) of "
        f"{confidence['members']} members"
    ]
    if "by_s" in confidence:
        share, low, high = (100.0 * value for value in confidence["arrived_by_share"])
        lines.append(f"by {hours(confidence['by_s'])} h in {share:.0f} % ({low:.0f}-{high:.0f})")
    times = confidence["arrival_quantiles_s"]
    known = [f"{name} by {'-' if time is None else hours(time) + ' h'}" for name, time in times.items()]
    lines.append(f"arrivals: {', '.join(known)}")
    share, low, high = (100.0 * value for value in confidence["touched_terrain_share"])
    lines.append(f"touches terrain in {share:.0f} % ({low:.0f}-{high:.0f})")
    lost = confidence["lost_by_leg"]
    if lost and sum(lost):
        legs = ", ".join(f"{count} on leg {n}" for n, count in enumerate(lost, 1) if count)
        lines.append(f"lost: {legs}")
    others = [f"{count} {end}" for end, count in confidence["ends"].items() if end != "arrived"]
    return [*lines, *([f"other ends: {', '.join(others)}"] if others else [])]
