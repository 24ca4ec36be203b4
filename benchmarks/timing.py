"""Timing: how long rivals take, in one process, so that what slows the machine slows all alike.

A turn of a fast rival is a short burst of calls. Alone, each call would pay for the caches that the
rival before it has filled with its own, which is not how programs use any of them.
"""

import gc
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

LEAST_TURNS = 3
"""Turns of even the slowest rival: fewer have no median."""

MOST_TURNS = 400
"""Turns after which a median no longer moves."""

BURST, BURST_SECONDS = 8, 2e-3
"""Calls in a turn at most, and how long a turn of several calls may take [s]."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How long one rival took.

    Args:
        median: Median of its calls [s].
        low: Lower quartile [s].
        high: Upper quartile [s].
        calls: How many calls were timed.
    """

    median: float
    low: float
    high: float
    calls: int

    @classmethod
    def of(cls, spent: list[float]) -> "Timing":
        """The timing of calls that took so long each [s]."""
        low, median, high = np.percentile(spent, [25.0, 50.0, 75.0]).tolist()
        return cls(median, low, high, len(spent))

    def as_dict(self) -> dict[str, float]:
        """The timing in JSON's types; the quartiles tell its noise."""
        return {
            "median_s": self.median,
            "low_s": self.low,
            "high_s": self.high,
            "calls": self.calls,
        }


def take_turns(
    rivals: Mapping[str, Callable[[int], object]],
    *,
    seconds: float,
    burst_seconds: float = BURST_SECONDS,
    seed: int = 0,
) -> dict[str, Timing]:
    """Time rivals that take turns, each time in another order.

    Each may use its share of the time; a slow rival so has fewer turns, and at least three.

    Args:
        rivals: What to call for each name, with the number of the call.
        seconds: Time for all together [s].
        burst_seconds: How long a turn of several calls may take [s].
        seed: Seed of the order.
    """
    rng = np.random.default_rng(seed)
    spent: dict[str, list[float]] = {name: [] for name in rivals}
    left = dict.fromkeys(rivals, seconds / max(1, len(rivals)))
    bursts = {}
    for name, call in rivals.items():
        call(0)
        once = _timed(call, 0)
        bursts[name] = int(np.clip(burst_seconds / once, 1, BURST))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(MOST_TURNS):
            playing = [name for name in rivals if left[name] > 0.0 or turn < LEAST_TURNS]
            if not playing:
                break
            for k in rng.permutation(len(playing)):
                name = playing[k]
                # The numbers of a turn are the same for all, so that all cast the same scans.
                took = [_timed(rivals[name], BURST * turn + n) for n in range(bursts[name])]
                spent[name] += took
                left[name] -= sum(took)
    finally:
        if collecting:
            gc.enable()
    return {name: Timing.of(times) for name, times in spent.items()}


def _timed(call: Callable[[int], object], number: int) -> float:
    start = time.perf_counter()
    call(number)
    return time.perf_counter() - start
