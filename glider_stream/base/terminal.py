"""What is written to the terminal: plain text, whatever files hold; and no failure of it stops the work."""

import contextlib
import os
import sys
from typing import IO, Any

READER_GONE = 141
"""The exit code of a program whose output nobody reads any more: 128 and the signal's number."""


def plain(text: str) -> str:
    """A text on one line without what a terminal would obey: each such character as Python writes it, \\x1b.

    For what comes out of files and names of files, so that it can neither move the cursor nor begin a line that
    looks like one of ours.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shown(text: str) -> str:
    """As `plain`, line by line: for what is made of several lines, each part of which is plain."""
    return "\n".join(plain(line) for line in text.split("\n"))


def say(text: object, *, error: bool = False) -> None:
    """Write a text and a new line on standard output, or on standard error, whose failure is no one's loss."""
    line = shown(str(text)) + "\n"
    if error:
        Murmur().write(line)
    elif sys.stdout is not None:
        try:
            sys.stdout.write(line)
            sys.stdout.flush()
        except BrokenPipeError:
            # who reads has seen enough, as `head` has
            silence(sys.stdout)
            raise SystemExit(READER_GONE) from None


class Murmur:
    """Standard error, for which nothing waits: closed, full or a pipe that nobody reads, the work goes on."""

    encoding = "utf-8"

    def __init__(self) -> None:
        """Standard error as it is now: a live bar puts itself in its place, and writes here."""
        self._stream = sys.stderr

    def write(self, text: str) -> int:
        """Write, or do not."""
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
        """Whether somebody watches."""
        try:
            return self._stream is not None and self._stream.isatty()
        except (OSError, ValueError):
            return False

    def fileno(self) -> int:
        """As the system knows it; OSError where there is none."""
        if self._stream is None:
            raise OSError("standard error is closed")
        return self._stream.fileno()


def silence(stream: IO[Any] | None) -> None:
    """Send what a broken stream still holds, and all that follows, nowhere: Python would fail at its end."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        assert stream is not None
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
