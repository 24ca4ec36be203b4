"""Share work over the cores by threads: for compiled code and libraries that free the GIL."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

PIECES = 8
"""Pieces for each core: fewer wait for the slowest core, more for Python's lock in between."""

LEAST = 8
"""Items that are worth a piece of their own."""


def core_count() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share(work: Callable[[int, int], None], count: int) -> None:
    """Call work(start, stop) for pieces of range(count), as many at a time as there are cores."""
    cores = core_count()
    size = max(LEAST, -(-count // (PIECES * cores)))
    starts = range(0, count, size)
    if len(starts) < 2 or cores < 2:
        work(0, count)
        return
    with ThreadPoolExecutor(min(cores, len(starts))) as pool:
        for _ in pool.map(lambda start: work(start, min(start + size, count)), starts):
            pass
