"""Timing: how long methods take, in one process, so that what slows the machine slows all alike.

A turn of a fast method is a short burst of calls. Alone, each call would pay for the caches that
the method before it has filled with its own, which is not how programs use any of them.
"""

import gc
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

LEAST_TURNS = 3
"""Turns of even the slowest method: fewer have no median."""

MOST_TURNS = 400
"""Turns after which a median no longer moves."""

BURST, BURST_SECONDS = 8, 2e-3
"""Calls in a turn at most, and how long a turn of several calls may take [s]."""


class Timing(NamedTuple):
    """How long calls took [s]: their median and their lower quartile."""

    median: float
    low: float


def take_turns(
    methods: Mapping[str, Callable[[int], object]], *, seconds: float
) -> dict[str, Timing]:
    """Time methods, called with the number of the call, that take turns in a random order.

    Each may use its share of the time [s]; a slow method so has fewer turns, and at least three.
    """
    rng = np.random.default_rng(0)
    spent: dict[str, list[float]] = {name: [] for name in methods}
    bursts = {}
    for name, call in methods.items():
        call(0)
        bursts[name] = int(np.clip(BURST_SECONDS / max(timed(call, 0), 1e-9), 1, BURST))
    share, collecting = seconds / max(1, len(methods)), gc.isenabled()
    gc.disable()
    try:
        for turn in range(MOST_TURNS):
            playing = [n for n in methods if sum(spent[n]) < share or turn < LEAST_TURNS]
            for name in rng.permutation(playing).tolist():
                # The numbers of a turn are the same for all, so that all cast the same scans.
                numbers = range(BURST * turn, BURST * turn + bursts[name])
                spent[name] += [timed(methods[name], number) for number in numbers]
    finally:
        if collecting:
            gc.enable()
    return {n: Timing(*np.percentile(times, [50.0, 25.0]).tolist()) for n, times in spent.items()}


def timed(call: Callable[..., object], *arguments: object) -> float:
    """The CPU time that a call takes on all cores [s], which other programs hardly change."""
    start = time.process_time()
    call(*arguments)
    return time.process_time() - start


def time_updates(mapper: Any) -> list[float]:
    """Put a mapper under a stopwatch; the list grows by the time [s] from a scan to its map."""
    spent: list[float] = []
    update = mapper.update

    def timed_update(scan: Any) -> Any:
        start = time.perf_counter()
        found = update(scan)
        found = getattr(mapper, "map", found)
        spent.append(time.perf_counter() - start)
        return found

    mapper.update = timed_update
    return spent
