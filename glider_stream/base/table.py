"""Tables of people's files: CSV with a header."""

import csv
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from .errors import InputError
from .settings import require
from .untrusted import check_file

MOST_TEXT = 20_000_000
"""A table may hold at most this many bytes."""


def read_table(path: Path, what: str, row: str, most: int) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header and the rows with their line numbers.

    `what` names the file, `row` what a line is, such as "dive"; InputError above `most` rows.
    """
    check_file(path, what)
    require(path.is_file(), f"{what} {path} does not exist; give a CSV file")
    size = path.stat().st_size
    require(size <= MOST_TEXT, f"{path.name} holds {size:,} bytes, more than {MOST_TEXT:,}; cut it")
    try:
        with path.open(encoding="utf-8-sig", newline="") as text:
            first = text.readline()
            # spreadsheets in some countries write semicolons
            delimiter = max(",;\t", key=first.count)
            text.seek(0)
            reader = csv.reader(text, delimiter=delimiter)
            header = [name.strip() for name in next(reader, [])]
            rows = list(_rows(reader, path.name, len(header), row, most))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} cannot be read as CSV: {error}; save it as such") from None
    require(len(rows) > 0, f"{path.name} must hold a header and one line for each {row}; got no line")
    for name, times in Counter(header).items():
        require(times == 1, f"{path.name} has more than one column `{name}`; rename one")
    return header, rows


def _rows(
    reader: Iterator[list[str]], name: str, width: int, what: str, most: int
) -> Iterator[tuple[int, list[str]]]:
    count = 0
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        line = getattr(reader, "line_num", 0)
        fits = len(row) == width
        require(fits, f"line {line} of {name} has {len(row)} cells, but the header has {width}; mend it")
        count += 1
        require(count <= most, f"{name} must hold at most {most:,} {what}s; got more: cut it")
        yield line, row


def find_columns(
    name: str, header: Sequence[str], usual: Mapping[str, Sequence[str]], given: Mapping[str, str]
) -> dict[str, str]:
    """Return the column for each entry of `usual` that the table has; `given` names columns of other names."""
    for what, column in given.items():
        require(what in usual, f"`{what}` is not known; choose from: {', '.join(usual)}")
        require(column in header, f"{name} has no column `{column}`; it has: {', '.join(header)}")
    found = dict(given)
    for what, names in usual.items():
        here = [column for column in header if column.lower() in names and column not in given.values()]
        if what not in found and here:
            message = f"{name} has more than one column for `{what}`: {', '.join(here)}; name one of them"
            require(len(here) == 1, message)
            found[what] = here[0]
    return found
