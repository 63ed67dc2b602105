"""TOML out of tables: the standard library only reads it."""

import json
from collections.abc import Mapping
from typing import Any


def to_toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """A nested table as TOML text: values first, then sub-tables, then lists of tables."""
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
