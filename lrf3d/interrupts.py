"""Stopping: a signal only sets a flag, which loops check between two of their steps.

A handler that raised would do so at any moment, such as within compiled code or a half-loaded
library, which then crash or continue wrongly. Only modules that load quickly are imported here.
"""

import os
import signal
import sys
import threading
from contextlib import contextmanager
from time import monotonic

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

SIGNALS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
"""Signals that ask a program to end: Ctrl-C, ``kill``, and a terminal that is closed."""

SAME = 0.1
"""Time [s] within which a second signal counts as the first: programs that start others, such as
``uv run``, forward a Ctrl-C that the terminal has sent to all."""

_asked, _since = 0, 0.0
"""The signal that asked to stop, 0 for none, and when it came [s]."""


def asked() -> int:
    """The number of the signal that has asked to stop; 0 if none has."""
    return _asked


def check() -> None:
    """Raise KeyboardInterrupt if a signal has asked to stop; loops call it between two steps."""
    if _asked:
        raise KeyboardInterrupt


def handle_signals(name: str) -> None:
    """Let signals stop the program of this name: at the next `check`, or the second one at once."""

    def handle(number: int, where: "FrameType | None") -> None:
        if not _asked:
            _note(number)
            if sys.stderr is not None and sys.stderr.isatty():
                _write(f"\n{name}: stopping; Ctrl-C again ends it at once\n")
        elif monotonic() > _since + SAME:
            _write(f"{name}: stopped\n")
            # Processes that it has started end with it; what is half-written is replaced later.
            os._exit(128 + _asked)

    forget()
    for number in SIGNALS:
        # A program in the background, or under nohup, goes on ignoring these signals.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handle)


def ignore_signals() -> None:
    """Ignore signals from here on: the program has done its work and ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def forget() -> None:
    """Withdraw the request to stop."""
    global _asked
    _asked = 0


@contextmanager
def stoppable() -> "Iterator[None]":
    """Let Ctrl-C stop the loops of this block only where they check; a second one raises at once.

    It changes nothing in a command, in a thread, within another such block, or where the user has
    set a handler. An interrupt that no check has seen is raised at the end.
    """
    usual = signal.default_int_handler
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not usual
    ):
        yield
        return

    def handle(number: int, where: "FrameType | None") -> None:
        if _asked:
            usual(number, where)
        _note(number)

    signal.signal(signal.SIGINT, handle)
    try:
        yield
        check()
    finally:
        signal.signal(signal.SIGINT, usual)
        forget()


@contextmanager
def noting(words: "Callable[[], str]") -> "Iterator[None]":
    """Add a note to any exception that ends the block: what is kept, and how to continue.

    The program prints the note. Of nested blocks the innermost one adds its note, if it has any.
    """
    try:
        yield
    except BaseException as error:
        if not hasattr(error, "__notes__") and (text := words()):
            error.add_note(text)
        raise


@contextmanager
def uninterrupted() -> "Iterator[None]":
    """Block Ctrl-C in the processes that the block starts; here it is delayed until the end.

    A terminal sends it to all processes of a program, of which only their parent is to handle it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    # Python starts the resource tracker with the first process, which unblocks the signal.
    resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _note(number: int) -> None:
    global _asked, _since
    _asked, _since = number, monotonic()


def _write(text: str) -> None:
    # A stream of Python may be in the middle of a write, which a handler must not enter.
    try:
        os.write(2, text.encode())
    except OSError:
        return
