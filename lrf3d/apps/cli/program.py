"""The program ``lrf3d``: stopping it at any moment, and reporting its errors in one line.

Only modules that load quickly are imported here, so that signals are handled before anything else
is loaded.
"""

import gc
import os
import sys

from lrf3d.base.interrupts import asked, handle_signals, ignore_signals

# Number of allocations between two garbage collections. Cycles are rare, and collecting as often as
# Python does by default takes 2 % of the time of a command.
GARBAGE_INTERVAL = 20_000

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def main(program: "Callable[[list[str]], int | None] | None" = None, name: str = "lrf3d") -> None:
    """Run a program, lrf3d if not given; a known error ends it with one line and exit status 1."""
    open_streams()
    handle_signals(name)
    status = 1
    try:
        try:
            status = _run(program)
        finally:
            # Python gives signals their default action while it ends, which would be a death by
            # signal.
            ignore_signals()
    except KeyboardInterrupt as error:
        _report(name, error, "stopped")
        _discard_output(sys.stdout)
    except BrokenPipeError:
        # The reader of the output has closed it, as `head` does; that is no error.
        _discard_output(sys.stdout, sys.stderr)
        status = 0
    except Exception as error:
        message = _message(error)
        if message is None:
            raise
        _report(name, error, message)
    sys.exit(128 + asked() if asked() and status else status)


def open_streams() -> None:
    """Open streams that the shell has closed, as with ``2>&-``, so that they take and give nothing.

    Otherwise the next file that is opened would become the standard output or the standard error.
    """
    while (opened := os.open(os.devnull, os.O_RDWR)) < 3:
        os.set_inheritable(opened, True)
    os.close(opened)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))


def _run(program: "Callable[[list[str]], int | None] | None") -> int:
    for stream in (sys.stdout, sys.stderr):
        # A terminal without a character, such as σ or one of a file name, is no reason to fail.
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    from lrf3d.apps.cli.console import print_text, quiet_libraries

    quiet_libraries()
    gc.set_threshold(GARBAGE_INTERVAL)
    from lrf3d.apps.cli.parser import run_command

    try:
        status = (program or run_command)(sys.argv[1:])
    except SystemExit as end:
        status = int(end.code or 0)
    # An error of the standard output is reported here, not when Python ends.
    print_text("")
    return status or 0


def _message(error: Exception) -> str | None:
    """A known error in one line; None for a bug, and for an error in a user's own code."""
    from lrf3d.base.errors import Lrf3dError

    if isinstance(error, Lrf3dError):
        return str(error)
    if isinstance(error, OSError):
        _discard_output(sys.stdout)
        reason = error.strerror or str(error) or type(error).__name__
        names = [os.fsdecode(name) for name in (error.filename, error.filename2)
                 if isinstance(name, str | bytes)]  # fmt: skip
        return ": ".join(filter(None, [" to ".join(names), reason]))
    if isinstance(error, MemoryError):
        why = f" ({error})" if str(error) else ""
        return f"out of memory{why}; ask for less at once, or use a machine with more memory"
    return None


def _discard_output(*streams: "Any") -> None:
    """Drop the output that streams cannot print, or Python would try again when it ends."""
    for stream in streams:
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _report(name: str, error: BaseException, message: str) -> None:
    """Print why the program ends and what is kept, if stderr is open."""
    # What is kept can be continued unless the input is wrong.
    kept = isinstance(error, KeyboardInterrupt | OSError | MemoryError)
    parts = [message, *(getattr(error, "__notes__", []) if kept else [])]
    try:
        print(f"{name}: {' '.join('; '.join(parts).splitlines())}", file=sys.stderr, flush=True)
    except OSError:
        _discard_output(sys.stderr)
