"""Ctrl-C: the first stops the work and keeps what was found; the second ends the process at once."""

import contextlib
import os
import signal
import socket
import threading
from collections.abc import Iterator

from .terminal import Murmur

PATIENCE = 1.0
"""A stop that takes longer than this [s] is explained."""
STOPPED = 130
"""The exit code of a program that Ctrl-C has stopped: 128 and the signal's number."""


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in the block; a second Ctrl-C ends the process in any state.

    Python handles a signal only between two of its own steps, and a compiled kernel may take minutes. So a thread
    is told of each signal by the system; it can run because kernels release the interpreter. If the program
    ignores Ctrl-C, for example under nohup, it continues to do so.
    """
    main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if not main or before is signal.SIG_IGN or before is None:
        yield
        return
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    woken = signal.set_wakeup_fd(theirs.fileno(), warn_on_full_buffer=False)
    watch = threading.Thread(target=_watch, args=(ours,), name="ctrl-c", daemon=True)
    watch.start()
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        signal.set_wakeup_fd(woken)
        theirs.close()
        watch.join(PATIENCE)


def _watch(ours: socket.socket) -> None:
    """Count the signals until the other end is closed."""
    count = 0
    with ours:
        while True:
            try:
                received = ours.recv(64)
            except TimeoutError:
                Murmur().write("glider-stream: stopping; press Ctrl-C again to end it at once\n")
                ours.settimeout(None)
                continue
            if not received:
                return
            count += received.count(signal.SIGINT)
            if count >= 2:
                if Murmur().isatty():
                    Murmur().write("\x1b[?25h")  # a progress bar hides the cursor
                Murmur().write("glider-stream: ended at once\n")
                os._exit(STOPPED)
            if count == 1:
                ours.settimeout(PATIENCE)
