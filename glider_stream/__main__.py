"""The program: `glider-stream`, or `python -m glider_stream`."""

import os
import signal


def main() -> None:
    """Run the command line, once nothing that happens meanwhile can end in a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Ctrl-C while modules are loaded ends the process, as it ends any program
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    open_streams()
    from .cli import main as run

    run()


def open_streams() -> None:
    """Open what the caller has closed of standard input, output and error.

    The next file that is opened would take its place, and what libraries write there would go into a roadmap.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one


if __name__ == "__main__":
    main()
