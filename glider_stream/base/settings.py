"""Frozen settings objects from TOML tables: every key is checked, and no value is guessed.

A block of a scenario is a frozen dataclass. A field without a default is a required key, its annotation is the
type of the key, and `__post_init__` checks the value. A new kind is one dataclass and one row of a table.
"""

import sys
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar

from .errors import InputError

T = TypeVar("T")
LARGEST_FLOAT = sys.float_info.max
LARGEST_INT = 2**53
"""Whole numbers up to this limit are also exact as floats; TOML has no limit."""


def _described(kind: Any) -> str:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_described(part) for part in inner if part is not type(None))
    if origin is typing.Literal:
        return " or ".join(f'"{choice}"' for choice in inner)
    if origin is tuple and inner[-1] is Ellipsis:
        return f"a list, each {_described(inner[0])}"
    if origin is tuple:
        return f"a list of {len(inner)}, each {_described(inner[0])}"
    if is_dataclass(kind):
        return "a table"
    return {float: "a finite number", int: "a whole number", str: "a text", bool: "true or false"}[kind]


def _fits(value: Any, kind: Any, where: str) -> Any:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        parts = [part for part in inner if part is not type(None)]
        if len(parts) == 1:
            return _fits(value, parts[0], where)
        for part in parts:
            try:
                return _fits(value, part, where)
            except InputError:
                continue
    elif origin is typing.Literal:
        if value in inner and not isinstance(value, bool):
            return value
    elif origin is tuple:
        if isinstance(value, (list, tuple)) and (inner[-1] is Ellipsis or len(value) == len(inner)):
            kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else inner
            return tuple(_fits(v, k, where) for v, k in zip(value, kinds, strict=True))
    elif is_dataclass(kind):
        if isinstance(value, Mapping):
            return from_table(typing.cast(type, kind), value, where)
    elif kind is float:
        # also False for NaN
        if not isinstance(value, bool) and isinstance(value, (int, float)) and abs(value) <= LARGEST_FLOAT:
            return float(value)
    elif kind is int:
        if not isinstance(value, bool) and isinstance(value, int):
            require(abs(value) <= LARGEST_INT, f"`{where}` must be at most 2^53; got {value}")
            return value
    elif isinstance(value, kind):
        return value
    raise InputError(f"`{where}` must be {_described(kind)}; got {value!r}")


def _known(name: str, choices: typing.Iterable[str], what: str) -> None:
    choices = sorted(choices)
    if name not in choices:
        raise InputError(f"{what} is not known; choose from: {', '.join(choices)}")


def _example(kind: Any) -> str:
    """Return what stands for a value of a type in an example."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return _example(inner[0])
    if origin is typing.Literal:
        return f'"{inner[0]}"'
    if origin is tuple:
        return f"[{','.join(_example(part) for part in inner if part is not Ellipsis)}]"
    return {float: "NUMBER", int: "WHOLE_NUMBER", str: "TEXT", bool: "true"}.get(kind, "TABLE")


def _check_complete(lacks: Mapping[str, str], example: Mapping[str, str], where: str) -> None:
    """Raise InputError that names all missing keys: one with its hint, several with a line as an example."""
    names = ", ".join(f"`{where}.{key}`" for key in lacks)
    require(len(lacks) != 1, f"{names} is missing: {', '.join(lacks.values())}")
    line = " ".join(f"--set {where}.{key}={example[key]}" for key in lacks)
    require(not lacks, f"{names} are missing; give all of them, in the form {line}")


def from_table(kind: type[T], table: Mapping[str, Any], where: str) -> T:
    """Return an object of the dataclass `kind` from a table; InputError names the key that is wrong."""
    hints = typing.get_type_hints(kind)
    keys = {f.name: f for f in fields(typing.cast(Any, kind)) if f.init}
    for key in table:
        _known(key, keys, f"the key `{where}.{key}`")
    lacks = {
        key: field.metadata.get("missing", f"it must be {_described(hints[key])}")
        for key, field in keys.items()
        if key not in table and field.default is MISSING and field.default_factory is MISSING
    }
    _check_complete(lacks, {key: _example(hints[key]) for key in lacks}, where)
    return kind(**{key: _fits(value, hints[key], f"{where}.{key}") for key, value in table.items()})


def from_kinds(kinds: Mapping[str, type[T]], table: Mapping[str, Any], where: str, selector: str = "kind") -> T:
    """Return an object of the class that the key `selector` chooses, made by `from_table` from the other keys."""
    rest = dict(table)
    if selector not in rest:
        raise InputError(f"`{where}.{selector}` is missing: choose from: {', '.join(sorted(kinds))}")
    name = rest.pop(selector)
    _known(str(name), kinds, f"`{where}.{selector}` = {name!r}")
    return from_table(kinds[name], rest, where)


def require(holds: bool, sentence: str) -> None:
    """Raise InputError with `sentence` unless the condition holds."""
    if not holds:
        raise InputError(sentence)
