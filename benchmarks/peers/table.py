"""The tables of docs/peers.md, from the record."""

import math
import re
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def _seconds(spread: dict[str, float], digits: int = 3) -> str:
    low, high = (f"{spread[key]:.{digits}g}" for key in ("low", "high"))
    return f"{spread['median']:.{digits}g} s ({low} to {high})"


def _drift(row: Row) -> list[str]:
    rate = {key: value / 1e6 for key, value in row["evaluations_per_s"].items()}
    ends = row.get("metres_from_ours", {"median": math.nan, "most": math.nan})
    return [
        f"{rate['median']:.3g} million/s ({rate['low']:.3g} to {rate['high']:.3g})",
        f"{ends['median']:.2g} m, {ends['most']:.2g} m",
    ]


def _surface(row: Row) -> list[str]:
    ratio = row.get("over_level_set", math.nan)
    return [
        f"{row['told_s'] / 3600:.2f} h", f"{row['route_s'] / 3600:.2f} h", f"{ratio:.3f}",
        _seconds(row["processor_s"]),
    ]  # fmt: skip


def _legs(row: Row) -> list[str]:
    routes = row["routes_s"]
    return [
        row["found"],
        f"{routes['median']:,.0f} s ({routes['low']:,.0f} to {routes['high']:,.0f})",
        f"{row['over_level_set']:.3f}",
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
    head = ["peer", "version", *heads, "lines"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        if "failed" in row:
            said = row["failed"].replace("|", "/").replace("\n", " ")
            blank = [""] * (len(heads) - 1)
            lines.append(f"| {row['peer']} | failed | {said} | " + " | ".join([*blank, str(row["lines"])]) + " |")
        else:
            told = [row["peer"], row["version"].split()[-1], *cells(row), str(row["lines"])]
            lines.append("| " + " | ".join(told) + " |")
    return "\n".join(lines)


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
    for problem in dict.fromkeys(row["problem"] for row in rows):
        tables[problem] = of_problem([row for row in rows if row["problem"] == problem])
    text = document.read_text()
    for name, table in tables.items():
        marked = re.compile(rf"(<!-- table {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = marked.sub(lambda found, table=table: f"{found[1]}\n{table}\n\n{found[2]}", text)
    document.write_text(text)
