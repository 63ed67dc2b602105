"""The files that a scenario reads; they are found again by their content after they or the roadmap were moved."""

import hashlib
import json
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.toml import check_depth, to_toml

KEYS = {"flow": ("file",), "terrain": ("bathymetry", "keep_out")}
"""For each section of a scenario, the keys whose values are file names."""
LOOKED_AT = 1 << 20
"""A file is recognised by its size and this many bytes at each end; its whole content is compared later."""
MOST_BESIDE = 10_000
"""At most this many files beside a roadmap are examined."""

Names = Mapping[str, tuple[str, ...]]
"""File names by section.key."""


def names_of(table: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the names of the files in a scenario's table, by section.key."""
    found = {}
    for section, keys in KEYS.items():
        block = table.get(section)
        for key in keys:
            value = block.get(key) if isinstance(block, Mapping) else None
            if value is not None:
                found[f"{section}.{key}"] = tuple(map(str, value if isinstance(value, list) else [value]))
    return found


def renamed(table: Mapping[str, Any], names: Names) -> dict[str, Any]:
    """Return a scenario's table with new names for its files."""
    result = {name: dict(block) if isinstance(block, Mapping) else block for name, block in table.items()}
    for place, files in names.items():
        section, key = place.split(".")
        result[section][key] = list(files) if isinstance(result[section].get(key), list) else files[0]
    return result


def settings_sha256(text: str) -> str:
    """Return a digest of a scenario without its file names; the files' content has other digests."""
    try:
        table = tomllib.loads(text)
        check_depth(table, "the scenario")
    except (ValueError, RecursionError):
        return hashlib.sha256(text.encode()).hexdigest()
    for place in names_of(table):
        section, key = place.split(".")
        del table[section][key]
    return hashlib.sha256(to_toml(table).encode()).hexdigest()


def fingerprint(path: Path) -> str:
    """Return a quick fingerprint of a file or a Zarr store; "" if it cannot be read."""
    text = hashlib.sha256()
    try:
        if path.is_dir():
            parts = sorted(part for part in path.rglob("*") if part.is_file())
            for part in parts[:MOST_BESIDE]:
                text.update(
                    f"{part.relative_to(path).as_posix()} {part.stat().st_size}\n".encode(errors="replace")
                )
                if part.suffix == ".json" or part.name.startswith(".z"):
                    text.update(part.read_bytes()[:LOOKED_AT])
        elif path.is_file():
            with path.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                text.update(f"{size}\n".encode() + file.read(LOOKED_AT))
                file.seek(max(0, size - LOOKED_AT))
                text.update(file.read(LOOKED_AT))
        else:
            return ""
    except OSError:
        return ""
    return text.hexdigest()


def inputs_of(names: Names, folder: Path) -> str:
    """Return, as JSON, the names and fingerprints of the files that a roadmap in `folder` was made from."""
    files = {
        place: [{"name": name, "fingerprint": fingerprint(Path(name))} for name in some]
        for place, some in names.items()
    }
    return json.dumps({"folder": str(folder), "files": files}) if files else ""


def located(names: Names, inputs: str, folder: Path) -> dict[str, tuple[str, ...]]:
    """Return the places of the files of a roadmap that now lies in `folder`; `inputs` comes from `inputs_of`.

    A file is searched at its old place, at its old place relative to the roadmap, and beside the roadmap, by its
    name and then by its content. InputError, with the cure, if it is not found.
    """
    try:
        kept = json.loads(inputs) if inputs else {}
        before, files = Path(kept.get("folder", "")), kept.get("files", {})
        marks = {place: [str(file["fingerprint"]) for file in some] for place, some in files.items()}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        before, marks = Path(), {}
    result = {}
    for place, some in names.items():
        wanted = marks.get(place, [])
        wanted = wanted if len(wanted) == len(some) else [""] * len(some)
        result[place] = tuple(
            _found(place, name, mark, before, folder) for name, mark in zip(some, wanted, strict=True)
        )
    return result


def _found(place: str, name: str, mark: str, before: Path, folder: Path) -> str:
    existing = []
    for path in _candidates(name, before, folder):
        if path.exists():
            existing.append(path)
            if mark and fingerprint(path) == mark:
                return str(path)
    if mark:
        for path in _beside(folder):
            if fingerprint(path) == mark:
                return str(path)
    if existing:
        return str(existing[0])  # what it holds is compared with what the roadmap was built with
    raise InputError(
        f"the file {name} of `{place}` does not exist, nor does one of its name or content beside the roadmap; "
        f"say where it is with --set {place}=FILE"
    )


def _candidates(name: str, before: Path, folder: Path) -> Iterator[Path]:
    yield Path(name)
    if before.is_absolute():
        yield Path(os.path.normpath(folder / os.path.relpath(name, before)))
    yield folder / Path(name).name


def _beside(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder, and its folders that are Zarr stores."""
    try:
        entries = sorted(folder.iterdir())[:MOST_BESIDE]
    except OSError:
        return
    for path in entries:
        store = path.is_dir() and any((path / head).is_file() for head in ("zarr.json", ".zgroup", ".zmetadata"))
        if store or path.is_file():
            yield path
