"""The process that reads an untrusted file: it confines itself, reads, answers and ends.

`lrf3d.base.isolation` starts it and sends a request to its input: the reader, the path and the
options. Its memory and computing time are limited before it reads. Once it opens the file, Linux
(Landlock, where available) lets it write only in its own temporary folder, start no program and
open no connection. The answer goes to its output. It ends when its input ends.
"""

import ctypes
import os
import sys
import threading
import warnings
from shutil import rmtree
from tempfile import gettempdir
from typing import Any

from lrf3d.base.errors import Lrf3dError, Lrf3dWarning
from lrf3d.base.isolation import OUT_OF_MEMORY, read_directly
from lrf3d.base.lean import lean_loading
from lrf3d.base.packing import receive, send

# Largest request [bytes]: a reader, a path, and options that users give.
LARGEST_QUESTION = 1 << 26

# Numbers of Landlock's system calls, the same on all processors.
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = range(444, 447)

# Option of prctl that keeps a process from gaining privileges, which Landlock requires.
NO_NEW_PRIVILEGES = 38

# Number of kinds of access to files, one bit each, that each version of Landlock knows: version 2
# adds moving between folders, version 3 truncating. All are denied but reading files and folders,
# bits 2 and 3.
FILE_BITS = {1: 13, 2: 14, 3: 15}
READING = 0b1100

# Kinds of access to the network, from version 4 on: to listen, and to connect.
NETWORK = 0b11


def main() -> None:
    """Read a file and answer."""
    # Keep what libraries print out of the answer.
    out = os.dup(1)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)
    try:
        reader, path, options, memory, seconds = receive(sys.stdin.buffer, LARGEST_QUESTION)
    except EOFError:
        _end_with_parent()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    status = 1
    try:
        with lean_loading(), os.fdopen(out, "wb") as stream:
            _limit(memory, seconds)
            _confine_at(path)
            try:
                send(stream, _answer(reader, path, options))
            except TypeError as error:
                # A reader returned a value that `packing` cannot send.
                send(stream, [False, ["Lrf3dError", f"{path}: {error}", []], []])
        status = 0
    except MemoryError:
        status = OUT_OF_MEMORY
    finally:
        # The usual exit would wait for threads of libraries.
        os._exit(status)


def _answer(reader: str, path: str, options: dict[str, Any]) -> list[Any]:
    """The reader's value, or the class, text and notes of its error; and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", Lrf3dWarning)
        try:
            found = [True, read_directly(reader, path, options)]
        except Lrf3dError as error:
            notes = getattr(error, "__notes__", [])
            found = [False, [type(error).__name__, str(error), notes]]
    return [*found, [[each.category.__name__, str(each.message)] for each in caught]]


def _end_with_parent() -> None:
    """End when the parent process ends, in whatever way."""
    sys.stdin.buffer.read()
    # A parent that was killed leaves the folder behind.
    rmtree(gettempdir(), ignore_errors=True)
    os._exit(0)


def _limit(memory: int, seconds: int) -> None:
    """Limit the memory [bytes] and the computing time [s] of this process, where possible."""
    try:
        import resource
    except ImportError:  # Windows.
        return
    limits = {
        resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: seconds, resource.RLIMIT_FSIZE: memory,
    }  # fmt: skip
    if sys.platform == "linux":
        # The memory that libraries took to load does not count.
        with open("/proc/self/statm") as file:
            own = int(file.read().split()[5]) * os.sysconf("SC_PAGE_SIZE")
        limits[resource.RLIMIT_DATA] = own + memory
    for kind, most in limits.items():
        # A shell or a batch system may have set a lower limit, which cannot be raised.
        hard = resource.getrlimit(kind)[1]
        low = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (low, hard))


def _confine_at(path: str) -> None:
    """Confine this process once it opens the file; until then Python may write compiled modules."""
    opening = {"open", "os.listdir", "os.scandir"}

    def hook(event: str, values: tuple[Any, ...]) -> None:
        if event in opening and str(values[0]).startswith(path):
            opening.clear()
            if sys.platform == "linux":
                _confine()

    sys.addaudithook(hook)


def _confine() -> None:
    """Let this process write only in its temporary folder; does nothing without Landlock."""
    libc = ctypes.CDLL(None)
    version = libc.syscall(CREATE_RULESET, None, 0, 1)
    if version < 1:
        return
    changing = (1 << FILE_BITS.get(version, 15)) - 1 & ~READING
    limited = (ctypes.c_uint64 * 2)(changing, NETWORK)
    rules = libc.syscall(CREATE_RULESET, limited, 16 if version > 3 else 8, 0)
    folder = os.open(gettempdir(), os.O_RDONLY)
    # A packed struct: the allowed kinds of access, and the descriptor of an open folder.
    rule = changing.to_bytes(8, "little") + folder.to_bytes(4, "little")
    libc.syscall(ADD_RULE, rules, 1, rule, 0)
    libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.syscall(RESTRICT_SELF, rules, 0)
