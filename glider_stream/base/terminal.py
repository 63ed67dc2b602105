"""Writing to the terminal: only plain text, whatever files hold; a failure never stops the work."""

import contextlib
import os
import sys
from typing import IO, Any

READER_GONE = 141
"""The exit code if nobody reads the program's output any more: 128 and the signal's number."""


def plain(text: str) -> str:
    """Return a text on one line; each control character is replaced by its Python form, such as \\x1b.

    It is for texts and names from files: they can neither move the cursor nor begin a line that looks like ours.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shown(text: str) -> str:
    """Return a text of several lines with `plain` applied to each line."""
    return "\n".join(plain(line) for line in text.split("\n"))


def say(text: object, *, error: bool = False) -> None:
    """Write a text and a new line on standard output, or on standard error, where failures are ignored."""
    line = shown(str(text)) + "\n"
    if error:
        Murmur().write(line)
    elif sys.stdout is not None:
        try:
            sys.stdout.write(line)
            sys.stdout.flush()
        except BrokenPipeError:
            # the reader has closed, as `head` does
            silence(sys.stdout)
            raise SystemExit(READER_GONE) from None


class Murmur:
    """Standard error that nothing waits for: if it is closed, full or not read, the work continues."""

    encoding = "utf-8"

    def __init__(self) -> None:
        """Keep standard error as it is now: a live bar takes its place later and writes here."""
        self._stream = sys.stderr

    def write(self, text: str) -> int:
        """Write the text if possible."""
        try:
            if self._stream is not None:
                self._stream.write(text)
                self._stream.flush()
        except (OSError, ValueError):
            silence(self._stream)
        return len(text)

    def flush(self) -> None:
        """Nothing waits."""

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        try:
            return self._stream is not None and self._stream.isatty()
        except (OSError, ValueError):
            return False

    def fileno(self) -> int:
        """Return the system's number of the stream; OSError if it does not exist."""
        if self._stream is None:
            raise OSError("standard error is closed")
        return self._stream.fileno()


def silence(stream: IO[Any] | None) -> None:
    """Discard what a broken stream still holds and all that follows; otherwise Python would fail at its end."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        assert stream is not None
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
