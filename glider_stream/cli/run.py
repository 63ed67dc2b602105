"""How the command line runs: warnings, refusals and exit codes."""

import os
import sys
import warnings
from typing import Any

import click

from ..base.errors import InputError, InputWarning, Stopped
from ..base.interrupt import STOPPED, stoppable
from ..base.terminal import plain, say, silence
from .group import cli

TRACE = "GLIDER_STREAM_TRACE"
"""With this environment variable set, an error of this program shows its trace."""


def main() -> None:
    """Run the command line.

    Exit codes: 0 done; 1 no path or a failed check; 2 unusable input; 3 an error of this program.
    """
    if hasattr(sys.stdout, "reconfigure"):
        # a name that is not UTF-8, or a letter that an old terminal does not have, is written as \\udcff
        sys.stdout.reconfigure(errors="backslashreplace")
    os.environ["MPLBACKEND"] = "agg"  # a notebook's own backend does not draw into files
    with stoppable():
        _run()


def _run() -> None:
    try:
        _check_environment()
        _show_warnings()
        cli(prog_name="glider-stream", standalone_mode=False)
    except InputError as error:
        _refuse(str(error))
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        place = context.command_path if context else "glider-stream"
        _refuse(f"{error.format_message().rstrip('.')}; see `{place} --help`")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        if error.filename is None:
            silence(sys.stdout)  # errors of files have a name: this one is of standard output
        _refuse(f"{error.filename or 'standard output'} cannot be used: {reason}; name another")
    except MemoryError as error:
        _refuse(f"there is not enough memory ({error}); make the problem smaller")
    except (click.Abort, KeyboardInterrupt) as error:
        # click turns a KeyboardInterrupt into an Abort
        stopped = error.__cause__ if isinstance(error.__cause__, Stopped) else "stopped"
        say(f"glider-stream: {plain(str(stopped))}", error=True)
        sys.exit(STOPPED)
    except Exception as error:
        if os.environ.get(TRACE):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        say(
            f"glider-stream: this is an error of the program, not of your input: {what}; "
            f"please report it, with the output that {TRACE}=1 in the environment gives",
            error=True,
        )
        sys.exit(3)


def _show_warnings() -> None:
    """Show warnings about input on one line, without the place in this program."""
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
        if issubclass(category, InputWarning):
            say(f"glider-stream: warning: {message}", error=True)
        else:
            usual(message, category, *rest, **named)

    warnings.showwarning = show


def _check_environment() -> None:
    """Raise InputError for a bad NUMBA_NUM_THREADS, for which Numba itself shows a traceback at import."""
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    fits = threads.isdecimal() and int(threads) > 0
    if not fits:
        raise InputError(f"the environment's NUMBA_NUM_THREADS must be a whole number above 0; got {threads!r}")


def _refuse(sentence: str) -> None:
    say(f"glider-stream: {plain(' '.join(sentence.split()))}", error=True)
    sys.exit(2)
