"""The program ``lrf3d``: stopping it at any moment, and reporting its errors.

Only modules that load quickly are imported here, so that Ctrl-C is handled before anything else is
loaded.
"""

import os
import signal
import sys
from time import monotonic

from lrf3d.interrupts import chain, notes

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any

SIGNALS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
"""Signals that ask a program to end: Ctrl-C, ``kill``, and a terminal that is closed."""

REPEAT_SECONDS = 0.05
"""Interval [s] at which a lost interrupt is raised again: short for the user, and long compared
with the check."""

CLEANUP = 10.0
"""Time for cleaning up [s] before another Ctrl-C ends the program immediately. Cleaning up takes
two or three seconds; holding the key down must not cut it off."""


def main(program: "Any" = None, name: str = "lrf3d") -> None:
    """Run a program; a known error ends it with one line and exit status 1.

    Args:
        program: The commands, a Typer; those of lrf3d if not given.
        name: Name of the program.
    """
    stops = Stops(name)
    error: BaseException | None = None
    try:
        _run(stops, program, name)
        stops.over = True
    except BaseException as caught:
        # This comes first: from here on an interrupt would leave this function.
        stops.over = True
        error = caught
    stops.end()
    if stops.number:
        # If the interrupt came from code that was made from a string, such as methods of data
        # classes, Python ends by the signal itself; running other such code prevents that.
        exec("")
        sys.exit(_stopped(name, stops.number, error))
    if isinstance(error, SystemExit):
        sys.exit(error.code)
    sys.exit(0 if error is None else _failed(name, error))


def _run(stops: "Stops", program: "Any", name: str) -> None:
    """Run the command, and flush its output."""
    stops.begin()
    for stream in (sys.stdout, sys.stderr):
        # A terminal without a character, such as σ or one of a file name, is no reason to fail.
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    from lrf3d.cli.console import print_text, quiet_libraries
    from lrf3d.output import scratch_folder

    quiet_libraries()
    if program is None:
        from lrf3d.cli.app import app as program

    try:
        if _keeps_compiled():
            program(prog_name=name)
        else:
            # Numba does not start without a writeable cache; this one is removed afterwards.
            with scratch_folder() as folder:
                os.environ["NUMBA_CACHE_DIR"] = str(folder)
                program(prog_name=name)
    finally:
        # An error of the standard output is reported here, not when Python ends.
        print_text("")


def _keeps_compiled() -> bool:
    """Whether Numba finds a writeable cache: next to the modules, or in the home folder."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for folder in (os.path.dirname(os.path.dirname(__file__)), home):
        while folder and not os.path.exists(folder):
            folder = os.path.dirname(folder)
        if os.access(folder, os.W_OK | os.X_OK):
            return True
    return "NUMBA_CACHE_DIR" in os.environ


class Stops:
    """Requests to stop: recorded once, and raised as KeyboardInterrupt until it takes effect.

    An interrupt may be lost: libraries catch it, compiled code turns it into another exception, and
    exceptions of destructors and callbacks are dropped. So any exception that follows counts as the
    interrupt, and if none is propagating, it is raised again.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.number = 0
        """The first signal that arrived; 0 if none did."""
        self.over = False
        """Whether the program is ending anyway."""
        self._asked = 0.0

    def begin(self) -> None:
        """Install the handlers."""
        for number in SIGNALS:
            # A program in the background, or under nohup, goes on ignoring these signals.
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._ask)

    def end(self) -> None:
        """Ignore the signals: only Python itself has to end."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _ask(self, number: int, where: "FrameType | None") -> None:
        if self.over:
            return
        if self.number:
            if monotonic() > self._asked + CLEANUP:
                os._exit(_stopped(self._name, self.number, None))
        else:
            self.number, self._asked = number, monotonic()
            _suppress_tracebacks()
            if hasattr(signal, "setitimer"):
                signal.signal(signal.SIGALRM, self._raise)
                signal.setitimer(signal.ITIMER_REAL, REPEAT_SECONDS, REPEAT_SECONDS)
        self._raise(number, where)

    def _raise(self, _: int, where: "FrameType | None") -> None:
        """Raise the interrupt, unless it is propagating or modules are being loaded."""
        propagating = any(isinstance(each, KeyboardInterrupt) for each in chain(sys.exc_info()[1]))
        # Half-loaded C libraries fail unpredictably. Loading ends by itself, or is interrupted
        # when it takes too long, as in a user's module that never ends.
        if self.over or propagating or (_loads(where) and monotonic() < self._asked + CLEANUP):
            return
        raise KeyboardInterrupt


def _loads(frame: "FrameType | None") -> bool:
    """Whether a frame is within an import."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _suppress_tracebacks() -> None:
    """Suppress the tracebacks of what an interrupt broke."""
    sys.excepthook = lambda *_: None
    sys.unraisablehook = lambda _: None
    if "threading" in sys.modules:
        sys.modules["threading"].excepthook = lambda *_: None  # type: ignore[attr-defined]
    if "logging" in sys.modules:
        sys.modules["logging"].disable()


def _stopped(name: str, number: int, error: BaseException | None) -> int:
    """Print that the program was stopped and what is kept; return the exit status."""
    from lrf3d.errors import OutputError

    parts = ["stopped", *notes(error)]
    if isinstance(error, OutputError):
        parts.insert(1, str(error))
    _say(name, "; ".join(parts))
    return 128 + number


def _failed(name: str, error: BaseException) -> int:
    """Print an error, in one line unless it is a bug of the program; return the exit status."""
    from lrf3d.errors import Lrf3dError

    if isinstance(error, BrokenPipeError):
        # The reader of the output has closed it, as `head` does; that is no error.
        _discard_output(sys.stdout, sys.stderr)
        return 0
    if isinstance(error, Lrf3dError):
        _say(name, str(error))
    elif isinstance(error, OSError):
        _say(name, _system_error(error, "standard output" if _discard_output(sys.stdout) else ""))
    elif isinstance(error, MemoryError):
        why = f" ({error})" if str(error) else ""
        _say(name, f"out of memory{why}; ask for less at once, or use a machine with more memory")
    else:
        raise error
    return 1


def _system_error(error: OSError, default: str) -> str:
    """The error of the system, with the file that it names, or else a default name."""
    reason = error.strerror or str(error) or type(error).__name__
    names = [os.fsdecode(name) for name in (error.filename, error.filename2)
             if isinstance(name, str | bytes)]  # fmt: skip
    return ": ".join(filter(None, [" to ".join(names) or default, reason]))


def _discard_output(*streams: "Any") -> bool:
    """Drop the output that streams cannot print; otherwise Python would try again when it ends.

    Returns:
        Whether there was such a stream.
    """
    found = False
    for stream in streams:
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            found = True
    return found


def _say(name: str, message: str) -> None:
    """Print a line on stderr, if it is still open."""
    try:
        print(f"{name}: {' '.join(message.splitlines())}", file=sys.stderr, flush=True)
    except OSError:
        _discard_output(sys.stderr)
