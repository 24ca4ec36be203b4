"""The process that reads a stranger's file: it confines itself, reads, answers and ends.

`lrf3d.base.isolation` starts it, with a question on its input: the reader, the path and the
options. What it may use is limited before it reads, and from when it opens the file on it writes
in its own temporary folder alone, starts no program and opens no connection, where Linux can see
to that (Landlock). The answer goes to its output; the end of its input ends it.
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
from lrf3d.base.packing import receive, send

# Largest question [bytes]: a reader, a path, and options that users give.
LARGEST_QUESTION = 1 << 26

# Numbers of the system calls of Landlock, which are the same on all processors.
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = range(444, 447)

# Code of prctl: no program gains rights.
NO_NEW_PRIVILEGES = 38

# Kinds of access to files: all that Landlock knows but reading files and folders (bits 2 and 3), up
# to the bit that each version of it knows; the kinds of the first versions lack moving and cutting.
FILE_BITS = {1: 13, 2: 14, 3: 15}
READING = 0b1100

# Kinds of access to the network: to listen, and to connect; from the fourth version on.
NETWORK = 0b11


def main() -> None:
    """Read a file and answer."""
    # What libraries print does not reach the answer.
    out = os.dup(1)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)
    try:
        reader, path, options, memory, seconds = receive(sys.stdin.buffer, LARGEST_QUESTION)
    except EOFError:
        _end_with_parent()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _limit(memory, seconds)
    _confine_at(path)
    status = 1
    try:
        with os.fdopen(out, "wb") as stream:
            try:
                send(stream, _answer(reader, path, options))
            except TypeError as error:
                # A reader of ours returns what `packing` does not know.
                send(stream, [False, ["Lrf3dError", f"{path}: {error}", []], []])
        status = 0
    except MemoryError:
        status = OUT_OF_MEMORY
    finally:
        # Not by the usual end, which waits for threads of libraries.
        os._exit(status)


def _answer(reader: str, path: str, options: dict[str, Any]) -> list[Any]:
    """What the reader returns, or the class, the text and the notes of its error; its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", Lrf3dWarning)
        try:
            found = [True, read_directly(reader, path, options)]
        except Lrf3dError as error:
            notes = [str(note) for note in getattr(error, "__notes__", ())]
            found = [False, [type(error).__name__, str(error), notes]]
    return [*found, [[each.category.__name__, str(each.message)] for each in caught]]


def _end_with_parent() -> None:
    """End when the parent does, however it ends."""
    sys.stdin.buffer.read()
    # A parent that was killed has left it.
    rmtree(gettempdir(), ignore_errors=True)
    os._exit(0)


def _limit(memory: int, seconds: int) -> None:
    """Limit the memory [bytes] and the computing time [s] of this process, where systems can."""
    try:
        import resource
    except ImportError:  # Windows.
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (memory, memory))
    if sys.platform == "linux":
        # What libraries take before they read does not count.
        with open("/proc/self/statm") as file:
            own = int(file.read().split()[5]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_DATA, (own + memory, own + memory))


def _confine_at(path: str) -> None:
    """Confine this process once it opens the file; Python may write what it compiles until then."""
    opening = {"open", "os.listdir", "os.scandir"}

    def hook(event: str, values: tuple[Any, ...]) -> None:
        if event in opening and str(values[0]).startswith(path):
            opening.clear()
            if sys.platform == "linux":
                _confine()

    sys.addaudithook(hook)


def _confine() -> None:
    """Let this process write in its temporary folder alone; nothing where Landlock is unknown."""
    libc = ctypes.CDLL(None)
    version = libc.syscall(CREATE_RULESET, None, 0, 1)
    if version < 1:
        return
    changing = (1 << FILE_BITS.get(version, 15)) - 1 & ~READING
    limited = (ctypes.c_uint64 * 2)(changing, NETWORK)
    rules = libc.syscall(CREATE_RULESET, limited, 16 if version > 3 else 8, 0)
    folder = os.open(gettempdir(), os.O_RDONLY)
    # A rule is the kinds of access that it allows, and an open folder, without a gap.
    rule = changing.to_bytes(8, "little") + folder.to_bytes(4, "little")
    libc.syscall(ADD_RULE, rules, 1, rule, 0)
    libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.syscall(RESTRICT_SELF, rules, 0)
