"""Faults: a piece of work is made to fail at its k-th call, for each k.

This is how SQLite's tests treat its file system and its allocator. Calls of Python functions and of
C functions both count, so a fault comes at any place where a lack of memory can.
"""

import errno
import gc
import os
import resource
import sys
from contextlib import contextmanager

import numpy as np

from lrf3d.errors import OutputError

WRITING = {
    "fsync", "ftruncate", "link", "mkdir", "open", "rename", "replace", "truncate", "write",
    "writelines",
}  # fmt: skip
"""Functions written in C that fail when the disk is full."""


def out_of_memory():
    return MemoryError()


def disk_full():
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def any_call(frame, event, function):
    return event in ("call", "c_call")


def writing_call(frame, event, function):
    if event != "c_call" or function.__name__ not in WRITING:
        return False
    # A zip file is written to an open file; only to be read does it open one.
    return not (function.__name__ == "open" and frame.f_code.co_filename.endswith("zipfile.py"))


def calls_within(*files):
    """The calls that come from, or go to, functions of some files."""

    def counts(frame, event, function):
        return event in ("call", "c_call") and frame.f_code.co_filename.endswith(files)

    return counts


class Calls:
    """Counts the calls of a block, and raises an exception in place of the k-th.

    Args:
        counts: Which of the events of `sys.setprofile` count as a call.
        at: The call that fails; none if 0.
        fault: Makes the exception.

    Attributes:
        made: The number of calls so far.
        place: The call that failed.
    """

    def __init__(self, counts=any_call, at=0, fault=out_of_memory):
        self.made, self.place = 0, ""
        self._counts, self._at, self._fault = counts, at, fault

    def __enter__(self):
        sys.setprofile(self._called)
        return self

    def __exit__(self, *_):
        sys.setprofile(None)

    def _called(self, frame, event, function):
        # A descriptor is closed even if closing it reports an error, so that one fails afterwards.
        if event in ("c_call", "c_return") and function.__name__ == "close":
            event = "c_call" if event == "c_return" else ""
        if frame.f_code is Calls.__exit__.__code__ or not self._counts(frame, event, function):
            return
        # The end of the block is no call of the work.
        if function == sys.setprofile:
            return
        self.made += 1
        if self.made == self._at:
            name = frame.f_code.co_name if event == "call" else function.__name__
            self.place = f"{frame.f_code.co_filename}:{frame.f_lineno}: {name}"
            raise self._fault()


@contextmanager
def room_for(size):
    """Files can grow to a number of bytes; what is beyond fails, after a part of it is written."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def contents(folder):
    """All files of a folder, hidden ones too, with their bytes."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def open_files(folder):
    """The files of a folder that this process has open."""
    names = [os.path.realpath(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd")]
    return [name for name in names if name.startswith(f"{os.path.realpath(folder)}{os.sep}")]


def still_open(folder):
    """The files of a folder that stay open, also when what waits to be collected is collected."""
    if open_files(folder):
        gc.collect()
    return open_files(folder)


FAULTS = {
    "memory": (any_call, out_of_memory, MemoryError),
    "disk": (writing_call, disk_full, OutputError),
}
"""The calls that fail, how they do, and the error that comes out."""


def spread(total, most):
    """Whole numbers from 1 to a total, all or evenly spread."""
    return sorted({*np.linspace(1, total, min(most, total)).round().astype(int).tolist()})
