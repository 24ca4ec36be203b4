"""Share work over the cores by threads: for compiled code and libraries that free the GIL."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache

from lrf3d.cores import core_count

PIECES_A_CORE = 8
"""Pieces for each core: fewer wait for the slowest core, more for Python's lock in between."""

LEAST = 8
"""Items that are worth a piece of their own."""


def share(work: Callable[[int, int], None], count: int) -> None:
    """Call work(start, stop) for pieces of range(count), as many at a time as there are cores."""
    cores = core_count()
    size = max(LEAST, -(-count // (PIECES_A_CORE * cores)))
    starts = range(0, count, size)
    if len(starts) < 2 or cores < 2:
        work(0, count)
        return
    # Python hands out the next piece under its lock, so each goes to one thread alone.
    rest = iter(starts)

    def work_on() -> None:
        for start in rest:
            work(start, min(start + size, count))

    others = [_pool(cores - 1).submit(work_on) for _ in range(min(cores, len(starts)) - 1)]
    try:
        work_on()
    finally:
        wait(others)
    for other in others:
        other.result()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that stay: new ones for each batch would cost a sixth of its time."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lrf3d")


if hasattr(os, "register_at_fork"):
    # A forked process has none of its parent's threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)
