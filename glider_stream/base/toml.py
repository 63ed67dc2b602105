"""Writes tables as TOML; the standard library can only read it."""

import json
from collections.abc import Mapping
from typing import Any

from .errors import InputError

DEEPEST = 20
"""A scenario may have this many levels of tables and lists; it needs four."""


def check_depth(table: Mapping[str, Any], what: str) -> None:
    """Raise InputError if tables lie within tables too deeply."""
    level: list[Any] = [table]
    for _ in range(DEEPEST):
        level = [
            inner
            for item in level
            for inner in (item.values() if isinstance(item, Mapping) else item)
            if isinstance(inner, (Mapping, list))
        ]
        if not level:
            return
    raise InputError(
        f"{what} holds tables within tables, more than {DEEPEST} deep; use keys with one or two dots"
    )


def to_toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """Return a nested table as TOML text: values first, then sub-tables, then lists of tables."""
    lines, below = [], []
    for key, value in table.items():
        if isinstance(value, Mapping):
            below.append(f"[{prefix}{key}]\n{to_toml(value, f'{prefix}{key}.')}")
        elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
            below.extend(f"[[{prefix}{key}]]\n{to_toml(item, f'{prefix}{key}.')}" for item in value)
        else:
            lines.append(f"{key} = {_toml_value(value)}\n")
    return "".join(lines) + "".join(below)


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    # JSON escapes like TOML, except for one character
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
