"""The program: `glider-stream`, or `python -m glider_stream`."""

import os
import signal


def main() -> None:
    """Run the command line, after setting up what prevents tracebacks."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Ctrl-C while modules are loaded ends the process, as in any program
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    open_streams()
    from .cli import main as run

    run()


def open_streams() -> None:
    """Open those of standard input, output and error that the caller has closed.

    Otherwise the next file that is opened would take their place, and output of libraries would go into a
    roadmap.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # this takes the lowest free number, which is this one


if __name__ == "__main__":
    main()
