"""Long work: how far it is, and stopping the program between two of its steps.

A signal only sets a flag, which loops check. A handler that raised would do so at any moment, such
as within a half-loaded library, or within compiled code, which loses the exception or reports it as
a SystemError. Only modules that load quickly are imported here.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic, sleep

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

# Called with the number of finished steps, and the number of all.
Progress = Callable[[int, int], None]

# Signals that ask a program to end: Ctrl-C, ``kill``, and a terminal that is closed.
SIGNALS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]

# The signal that asked to stop; 0 for none.
_asked = 0

# The signals that a program handles, and ignores once it has ended; another one may follow.
_handled: set[int] = set()

# [s] When it came.
_since = 0.0

# Whether a file is being read.
_reads = False

# Functions that say what is kept if the program ends now, the innermost last.
_kept: list[Callable[[], str]] = []

# Folders and files that are removed however the program ends.
unfinished: set[str] = set()

# Held by whoever ends the program: the main thread or the one that waits for signals.
_end = threading.Lock()


def silent(done: int, total: int) -> None:
    """Report nothing."""


def asked() -> int:
    """The number of the signal that has asked to stop; 0 if none has."""
    return _asked


def check() -> None:
    """Raise KeyboardInterrupt if a signal has asked to stop; loops call it between two steps."""
    if _asked:
        raise KeyboardInterrupt


# Time [s] between two checks of what waits, and within which a second signal counts as the first:
# programs that start others, such as `uv run`, forward a Ctrl-C that the terminal has sent to all.
MOMENT = 0.1


def handle_signals(name: str) -> None:
    """Let signals stop the program of this name: at the next `check`, or the second one at once."""
    global _asked, _end
    _asked = 0
    # A program that this process ran before holds the other one.
    _end = threading.Lock()

    def handle(number: int, where: "FrameType | None") -> None:
        global _asked, _since
        if not _asked:
            _asked = number
            _since = monotonic()
            if _reads:
                raise KeyboardInterrupt
            if sys.stderr is not None and sys.stderr.isatty():
                _write(f"\n{name}: stopping; Ctrl-C again ends it at once\n")
        elif monotonic() > _since + MOMENT:
            _end_now(name, _asked)

    usual = sys.unraisablehook
    # An interrupt that cannot be raised where it comes, as in a destructor, is seen by a check.
    sys.unraisablehook = lambda what: None if _asked else usual(what)
    for number in SIGNALS:
        # A program in the background, or under nohup, goes on ignoring these signals.
        if number in _handled or signal.getsignal(number) is not signal.SIG_IGN:
            _handled.add(number)
            signal.signal(number, handle)


def limit_patience(name: str) -> None:
    """End the program soon after the first signal, even while compiled code cannot handle signals.

    Python calls handlers only between two of its own steps; another thread receives them at once.
    """
    if not hasattr(os, "set_blocking"):  # Windows, up to Python 3.11.
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def wait() -> None:
        while (number := os.read(reader, 1)[0]) not in SIGNALS:
            pass
        # [s] Time after which a program ends that has not reached a check: LLVM compiles for half
        # a minute without one.
        patience = 1.5
        sleep(patience)
        _end_now(name, number)

    threading.Thread(target=wait, daemon=True).start()


def _end_now(name: str, number: int) -> None:
    """End the program from anywhere, unless it is ending: what is half-written is removed.

    Processes that it has started end with it.
    """
    if not _end.acquire(blocking=False):
        return
    import shutil

    for path in list(unfinished):
        shutil.rmtree(path, ignore_errors=True)
        with suppress(OSError):
            os.unlink(path)
    text = ""
    with suppress(Exception):
        text = next(filter(None, (words() for words in reversed(_kept))), "")
    _write("; ".join(filter(None, [f"{name}: stopped", text])) + "\n")
    os._exit(128 + number)


def _write(text: str) -> None:
    """Write on stderr past its stream, which may be in the middle of a write."""
    with suppress(OSError):
        os.write(2, text.encode())


def ignore_signals() -> None:
    """Ignore signals from here on: the program has done its work and ends."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    if not _end.acquire(blocking=False):
        sleep(60)  # The other thread is ending it.


@contextmanager
def reading() -> Iterator[None]:
    """Let a signal stop the program at once in this block, which reads a file and writes nothing.

    The parsers of libraries check for no signal. What they make of an interrupt is one.
    """
    global _reads
    check()
    before = _reads
    _reads = True
    try:
        yield
    except Exception:
        check()
        raise
    finally:
        _reads = before
    check()


@contextmanager
def stoppable() -> Iterator[None]:
    """Let Ctrl-C stop the loops of this block only where they check; a second one raises at once.

    It changes nothing in a command, in a thread, within another such block, or where the user has
    set a handler. An interrupt that no check has seen is raised at the end.
    """
    global _asked
    usual = signal.default_int_handler
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not usual:
        yield
        return

    def handle(number: int, where: "FrameType | None") -> None:
        global _asked
        if _asked or _reads:
            usual(number, where)
        _asked = number

    signal.signal(signal.SIGINT, handle)
    try:
        yield
        check()
    finally:
        signal.signal(signal.SIGINT, usual)
        _asked = 0


@contextmanager
def noting(words: Callable[[], str]) -> Iterator[None]:
    """Add a note to any exception that ends the block: what is kept, and how to continue.

    The program prints the note. Of nested blocks the innermost one adds its note, if it has any.
    """
    _kept.append(words)
    try:
        yield
    except BaseException as error:
        if not hasattr(error, "__notes__") and (text := words()):
            error.add_note(text)
        raise
    finally:
        _kept.remove(words)
