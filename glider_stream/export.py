"""Route files: a path in the forms that other programs read."""

import json
from collections.abc import Callable
from pathlib import Path as File

from .path import Path
from .settings import require
from .store import check_output, replacing


def _json(path: Path) -> str:
    return json.dumps(path.as_dict(), indent=1) + "\n"


EXPORTS: dict[str, Callable[[Path], str]] = {".json": _json}


def check_export(file: str | File) -> None:
    """InputError unless the file's ending names a known form, and the file can be made."""
    suffix = File(file).suffix.lower()
    known, got = ", ".join(EXPORTS), repr(suffix or "no ending")
    require(suffix in EXPORTS, f"the route file {file} must end in one of: {known}; got {got}")
    check_output(file)


def export_path(path: Path, file: str | File) -> None:
    """Write a path in the form that the file's ending names."""
    check_export(file)
    with replacing(File(file)) as temporary:
        temporary.write_text(EXPORTS[File(file).suffix.lower()](path), encoding="utf-8")
