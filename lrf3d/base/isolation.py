"""Reading an untrusted file in a process of its own, with limits on memory and time.

A path and a reader enter; the value that the reader returns leaves, through a pipe. If the file
crashes its library, or takes too much memory or time, this process raises an error of one line. The
reading process is a fresh interpreter that runs `lrf3d.base.confinement`, since a fork of a process
with threads may hang.
"""

import json
import os
import re
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from signal import Signals
from tempfile import mkdtemp
from time import monotonic
from types import SimpleNamespace
from typing import Any, NamedTuple

from lrf3d.base import errors
from lrf3d.base.errors import InputError, Lrf3dError, Lrf3dWarning, one_line, shown, storage
from lrf3d.base.formats import function
from lrf3d.base.interrupts import unfinished
from lrf3d.base.packing import receive, send

# Environment variable with a factor of the limits; 0 reads in this process.
FACTOR = "LRF3D_READING"

# Memory [bytes] and computing time [s] that a file of any size may take. Undamaged plans, maps,
# towns and logs of others up to 4 MB took up to 0.2 GB, and 4.6 s on an overloaded machine.
LEAST_MEMORY = 1_200_000_000
LEAST_SECONDS = 12

# Memory [bytes] and computing time [s] that each byte of a file adds to these limits. Texts of
# numbers take 17 bytes and 0.4 µs a byte, and ten times as much if they are packed.
MEMORY_OF_BYTE = 24
SECONDS_OF_BYTE = 2.5e-6

# A process that has not computed for this time [s] is ended: it waits for input that never comes,
# such as from a pipe.
PATIENCE = 20.0

# Longest duration of a process whose computing time is unknown, in limits of computing time.
SLOWEST = 8

# Time [s] between two checks of the process; on macOS each check starts a program.
STEP = 0.05 if sys.platform == "linux" else 0.5

# Exit status of a process that ran out of memory.
OUT_OF_MEMORY = 77

# The program of the other interpreter, which gets the module paths of this one.
START = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from lrf3d.base.confinement import main
main()
"""

# Threads of libraries take memory and time to start.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def read_file(
    reader: str | Callable[..., Any],
    path: Path,
    options: Mapping[str, Any],
    *,
    isolated: bool,
    error: type[InputError] = InputError,
) -> Any:
    """Return what a reader, ``module:function``, makes of a path: in its own process if isolated.

    Raises:
        InputError: The reader raised it, or a limit was exceeded; of the given class.
    """
    factor = _factor()
    # An error of the path itself needs no process.
    if not (isolated and factor > 0.0 and path.exists() and isinstance(reader, str)):
        return read_directly(reader, path, options, error)
    limits = _limits(path, factor)
    try:
        found, value, said = _ask(reader, str(path), dict(options), limits)
    except _Stopped as stopped:
        raise error(f"{path}: {stopped}") from None
    for name, message in said:
        warnings.warn(message, _named(name, Lrf3dWarning), stacklevel=4)
    if found:
        return value
    name, message, notes = value
    problem = _named(name, error)(message)
    for note in notes:
        problem.add_note(note)
    raise problem


def read_directly(
    reader: str | Callable[..., Any],
    path: str | Path,
    options: Mapping[str, Any],
    error: type[InputError] = InputError,
) -> Any:
    """Return what a reader returns; a library's error on a damaged file becomes one line."""
    path = Path(path)
    try:
        return function(reader)(path, **options)
    except (Lrf3dError, MemoryError):
        raise
    except RecursionError:
        raise error(
            f"{path}: nested too deeply, or within itself; save it without groups"
        ) from None
    except Exception as problem:
        check_memory(problem)
        if isinstance(problem, OSError) and problem.errno is not None:
            raise error(f"{path}: cannot be read: {problem.strerror}") from None
        reason = one_line(f"{type(problem).__name__}: {' '.join(str(problem).split())}", 120)
        raise error(
            f"{path}: damaged, or no {path.suffix[1:].lower()} file ({reason.strip(': ')});"
            " save it again"
        ) from problem


def check_memory(problem: Exception) -> None:
    """Raise MemoryError if a library's error means just that: the file is not damaged."""
    if isinstance(problem, MemoryError) or re.search("bad_?alloc|allocat", str(problem)):
        raise MemoryError from problem


class ReadingLimits(NamedTuple):
    """Limits of a reading process: memory [bytes] and computing time [s]."""

    memory: int
    seconds: int
    factor: float

    def advice(self, used: str) -> str:
        """The end of a message about a limit that was exceeded."""
        return (
            f"{used}; cut it down to what is needed, or raise the limit:"
            f" {FACTOR}={4 * self.factor:g}"
        )


class _Stopped(Exception):
    """Why a process gave no answer."""


def _factor() -> float:
    """The factor by which the user multiplies the limits; 0 where no process can be started."""
    name = os.path.basename(sys.executable or "").lower()
    # A program that embeds Python has no interpreter for another process.
    if "python" not in name or hasattr(sys, "frozen"):
        return 0.0
    text = os.environ.get(FACTOR, "1")
    with suppress(ValueError):
        if 0.0 <= (factor := float(text)) <= 1e6:
            return factor
    raise InputError(f"{FACTOR}={shown(text)}: expected a factor of the limits, such as 4, or 0")


def _limits(path: Path, factor: float) -> ReadingLimits:
    """The limits for a file or a folder by its size."""
    files = path.iterdir() if path.is_dir() else [path]
    size = sum(each.stat().st_size for each in files if each.is_file())
    return ReadingLimits(
        int(factor * (LEAST_MEMORY + MEMORY_OF_BYTE * size)),
        int(1 + factor * (LEAST_SECONDS + SECONDS_OF_BYTE * size)),
        factor,
    )


def _ask(reader: str, path: str, options: dict[str, Any], limits: ReadingLimits) -> Any:
    """The answer of another process: whether it succeeded, its value or error, and its warnings."""
    with _process() as process, _watched(process, limits) as watch:
        assert process.stdin is not None and process.stdout is not None
        try:
            send(process.stdin, [reader, path, options, limits.memory, limits.seconds])
            return receive(process.stdout, limits.memory)
        except TypeError as error:
            raise _Stopped(f"an option is {error}; give numbers and texts") from None
        except ValueError as error:
            raise _Stopped(f"its reader returns too much, or no value ({error})") from None
        except (EOFError, BrokenPipeError):
            status = process.wait()
            raise _Stopped(watch.reason or _end(status, limits, watch.most)) from None


@contextmanager
def _process() -> "Iterator[subprocess.Popen[bytes]]":
    """A fresh interpreter that waits for a request; it ends with the block."""
    paths = [*map(os.path.abspath, sys.path), str(Path(__file__).parents[2])]
    # Readers unpack into temporary files, which a killed reader leaves behind.
    folder = mkdtemp(prefix="lrf3d-")
    unfinished.add(folder)
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", START, json.dumps(paths)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)},
            # In a session of its own, so that Ctrl-C in a terminal reaches this process alone.
            start_new_session=os.name == "posix",
        )
        try:
            yield process
        finally:
            process.kill()
            # Closing raises this if the process has not read all of the request.
            with suppress(BrokenPipeError), process:
                pass
    finally:
        rmtree(folder, ignore_errors=True)
        unfinished.discard(folder)


def _end(status: int, limits: ReadingLimits, most: int) -> str:
    """Why a process ended without an answer, by its status and the most memory [bytes] it took."""
    signal = Signals(-status).name if status < 0 else ""
    if signal == "SIGXCPU":
        return limits.advice(f"reading it takes more than {limits.seconds} s of computing")
    if status == OUT_OF_MEMORY or most > 0.8 * limits.memory:
        return _memory(limits)
    if signal == "SIGKILL":
        return "reading it was stopped from outside; the memory may be full"
    return f"the library that reads it crashed ({signal or f'status {status}'}); save it again"


def _memory(limits: ReadingLimits) -> str:
    return limits.advice(f"reading it takes more than {storage(limits.memory)} of memory")


def _named(name: object, otherwise: type[Any]) -> type[Any]:
    """The class of errors or warnings of this name, or else the given one."""
    found = getattr(errors, name, None) if isinstance(name, str) else None
    base = Lrf3dWarning if issubclass(otherwise, Warning) else Lrf3dError
    return found if isinstance(found, type) and issubclass(found, base) else otherwise


@contextmanager
def _watched(process: "subprocess.Popen[bytes]", limits: ReadingLimits) -> Iterator[Any]:
    """Let a thread end a process that takes too much memory or waits forever.

    Yields the most memory [bytes] that it took, and why the thread ended it.
    """
    seen = SimpleNamespace(most=0, reason="")
    ended = threading.Event()

    def watch() -> None:
        computed: list[str] = []
        since = monotonic()
        while not ended.wait(STEP) and not seen.reason:
            before = computed
            computed, memory = _used(process.pid)
            seen.most = max(seen.most, memory)
            if computed != before:
                since = monotonic()
            longest = PATIENCE if computed else float(SLOWEST * limits.seconds)
            if memory > limits.memory:
                seen.reason = _memory(limits)
            elif monotonic() > since + longest:
                seen.reason = f"reading it waited for {longest:g} s for something that never comes"
            if seen.reason:
                process.kill()

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield seen
    finally:
        ended.set()


def _used(number: int) -> tuple[list[str], int]:
    """Computing times of a process, unknown on Windows, and its memory [bytes]."""
    if sys.platform == "linux":
        with suppress(OSError, LookupError):
            # Names of programs may contain spaces; the numbers come after them.
            values = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
            pages = int(values[21]) * os.sysconf("SC_PAGE_SIZE")
            return values[11:13], pages
    if sys.platform == "darwin":
        words = ["/bin/ps", "-o", "time=,rss=", "-p", str(number)]
        found = subprocess.run(words, capture_output=True, text=True).stdout.split()
        if len(found) == 2:
            return found[:1], 1024 * int(found[1])
    return [], 0
