"""The tables of docs/peers.md, from the record."""

import math
import re
from pathlib import Path
from typing import Any

import compare

Row = dict[str, Any]


def _seconds(spread: dict[str, float], digits: int = 3) -> str:
    low, high = (f"{spread[key]:.{digits}g}" for key in ("low", "high"))
    return f"{spread['median']:.{digits}g} s ({low} to {high})"


def _or_none(value: float | None, shape: str) -> str:
    return "none" if value is None else format(value, shape)


def _drift(row: Row) -> list[str]:
    rate = {key: value / 1e6 for key, value in row["evaluations_per_s"].items()}
    ends = row.get("metres_from_ours", {"median": math.nan, "most": math.nan})
    return [
        f"{rate['median']:.3g} million/s ({rate['low']:.3g} to {rate['high']:.3g})",
        f"{ends['median']:.3g} m, {ends['most']:.3g} m",
    ]


def _surface(row: Row) -> list[str]:
    ratio = row.get("over_level_set", math.nan)
    return [
        f"{row['told_s'] / 3600:.2f} h", f"{row['route_s'] / 3600:.2f} h", f"{ratio:.3f}",
        _seconds(row["processor_s"]),
    ]  # fmt: skip


def _legs(row: Row) -> list[str]:
    middle, low, high = (_or_none(row["routes_s"][key], ",.0f") for key in ("median", "low", "high"))
    return [
        row["found"],
        f"{middle}{' s' * (middle != 'none')} ({low} to {high})",
        _or_none(row["over_level_set"], ".3f"),
        _seconds(row["processor_s"]),
    ]


def _kind(problem: str) -> str:
    return "drift" if problem == "drift" else "surface" if problem.startswith("surface") else "legs"


SHAPES: dict[str, tuple[tuple[str, ...], Any]] = {
    "drift": (("evaluations", "ends from ours: median, most"), _drift),
    "surface": (("route as told", "route as flown", "over the level set", "time to plan"), _surface),
    "legs": (("found", "route", "over the reference", "time to plan"), _legs),
}


def of_problem(rows: list[Row]) -> str:
    """One problem's table."""
    heads, cells = SHAPES[_kind(rows[0]["problem"])]
    head = ["peer", "version", *heads, "lines of code"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        if "failed" in row:
            said = row["failed"].replace("|", "/").replace("\n", " ")
            blank = [""] * (len(heads) - 1)
            lines.append(f"| {row['peer']} | failed | {said} | " + " | ".join([*blank, str(row["lines"])]) + " |")
        else:
            told = [row["peer"], row["version"].split()[-1], *cells(row), str(row["lines"])]
            lines.append("| " + " | ".join(told) + " |")
    return "\n".join([*lines, *_reference(rows)])


def _reference(rows: list[Row]) -> list[str]:
    """What the ratios are over, and how well it is known."""
    row: Row = next((one for one in rows if "level_set_error" in one or "reference_s" in one), {})
    if "level_set_error" in row:
        own = row["our_level_set"]
        times = [f"{own[key] / 3600:.2f}" for key in ("arrival_s", "error_s")]
        return [
            "",
            f"The level set is known within {100 * row['level_set_error']:.2g} %, by its two grids. "
            f"This project's own level set says {times[0]} h, within {times[1]} h.",
        ]
    if "reference_s" in row:
        return [
            "",
            f"The reference is {row['reference_s']:,.1f} s; no route takes less than {row['bound_s']:,.1f} s.",
        ]
    return []


def answered(rows: list[Row]) -> str:
    """On every problem: the fastest peer, and our time over its."""
    lines = ["| problem | the fastest peer | our time over its | no slower than it |", "|---|---|---|---|"]
    for problem, row, over in compare.beside_ours(rows):
        verdict = "yes" if over <= 1.0 + compare.TOLERANCE else "no"
        lines.append(f"| {problem} | {row['peer']} | {over:.3f} | {verdict} |")
    return "\n".join([*lines, "", compare.answer(rows)])


def known(rows: list[Row]) -> str:
    """What each peer is and can do."""
    lines = ["| peer | what it is | what it can do | script |", "|---|---|---|---|"]
    for row in {(row["peer"], row["script"]): row for row in rows}.values():
        lines.append(f"| {row['peer']} | {row['what']} | {row['can']} | `{row['script']}` |")
    return "\n".join(lines)


def rewrite(document: Path, record: dict[str, Any]) -> None:
    """Write every table between its marks anew: `<!-- table NAME -->` and `<!-- end -->`."""
    rows = record["rows"]
    tables = {"peers": known(rows), "machine": f"Measured on: {record['machine']}."}
    tables["answer"] = answered(rows)
    for problem in dict.fromkeys(row["problem"] for row in rows):
        tables[problem] = of_problem([row for row in rows if row["problem"] == problem])
    text = document.read_text()
    for name, table in tables.items():
        marked = re.compile(rf"(<!-- table {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = marked.sub(lambda found, table=table: f"{found[1]}\n{table}\n\n{found[2]}", text)
    document.write_text(text)
