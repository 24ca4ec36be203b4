"""Timing: how long methods take, in one process, so that what slows the machine slows all alike.

A turn of a fast method is a short burst of calls. Alone, each call would pay for the caches that
the method before it has filled with its own, which is not how programs use any of them.
"""

import gc
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

LEAST_TURNS = 3
"""Turns of even the slowest method: fewer have no median."""

MOST_TURNS = 400
"""Turns after which a median no longer moves."""

BURST, BURST_SECONDS = 8, 2e-3
"""Calls in a turn at most, and how long a turn of several calls may take [s]."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How long calls took [s]: their median and quartiles, and how many there were."""

    median: float
    low: float
    high: float
    calls: int

    @classmethod
    def of(cls, spent: list[float]) -> "Timing":
        """The timing of calls by the time that each took [s]."""
        low, median, high = np.percentile(spent, [25.0, 50.0, 75.0]).tolist()
        return cls(median, low, high, len(spent))


def take_turns(
    methods: Mapping[str, Callable[[int], object]],
    *,
    seconds: float,
    burst_seconds: float = BURST_SECONDS,
    seed: int = 0,
) -> dict[str, Timing]:
    """Time methods that take turns, each time in another order.

    Each may use its share of the time; a slow method so has fewer turns, and at least three.

    Args:
        methods: What to call for each name, with the number of the call.
        seconds: Time for all together [s].
        burst_seconds: How long a turn of several calls may take [s].
        seed: Seed of the order.
    """
    rng = np.random.default_rng(seed)
    spent: dict[str, list[float]] = {name: [] for name in methods}
    left = dict.fromkeys(methods, seconds / max(1, len(methods)))
    bursts = {}
    for name, call in methods.items():
        call(0)
        bursts[name] = int(np.clip(burst_seconds / timed(call, 0), 1, BURST))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(MOST_TURNS):
            playing = [name for name in methods if left[name] > 0.0 or turn < LEAST_TURNS]
            if not playing:
                break
            for k in rng.permutation(len(playing)):
                name = playing[k]
                # The numbers of a turn are the same for all, so that all cast the same scans.
                took = [timed(methods[name], BURST * turn + n) for n in range(bursts[name])]
                spent[name] += took
                left[name] -= sum(took)
    finally:
        if collecting:
            gc.enable()
    return {name: Timing.of(times) for name, times in spent.items()}


def timed(call: Callable[..., object], *arguments: object) -> float:
    """How long a call takes [s]."""
    start = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - start


def time_updates(mapper: Any) -> list[float]:
    """Put a mapper under a stopwatch; the list grows by the time [s] of each update."""
    spent: list[float] = []
    update = mapper.update
    mapper.update = lambda scan: spent.append(timed(update, scan))
    return spent
