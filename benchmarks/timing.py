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

from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap, LineMapper

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
        """The timing of calls that took so long each [s]."""
        low, median, high = np.percentile(spent, [25.0, 50.0, 75.0]).tolist()
        return cls(median, low, high, len(spent))

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> "Timing":
        """The timing that `as_dict` wrote."""
        return cls(table["median_s"], table["low_s"], table["high_s"], table["calls"])

    def as_dict(self) -> dict[str, float]:
        return {
            "median_s": self.median,
            "low_s": self.low,
            "high_s": self.high,
            "calls": self.calls,
        }


@dataclass(frozen=True, slots=True)
class Method:
    """One method to do a thing, with its time and its error.

    Args:
        thing: What is done, such as a scan among 400 walls.
        family: The method's kind.
        setting: What distinguishes it from others of its kind; may be empty.
        time: Its time [s].
        error: Its error, in the unit of the part.
        least_error: Least error where several runs were made with random numbers, else the error.
        largest_error: Largest error, likewise.
        default: Whether lrf3d does so by default.
    """

    thing: str
    family: str
    setting: str
    time: Timing
    error: float
    least_error: float
    largest_error: float
    default: bool = False

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> "Method":
        """The method that JSON holds."""
        return cls(**{**entry, "time": Timing.from_dict(entry["time"])})

    @classmethod
    def of(
        cls,
        thing: str,
        family: str,
        setting: str,
        time: Timing,
        error: float,
        *,
        default: bool = False,
    ) -> "Method":
        """A method whose error has nothing random."""
        return cls(thing, family, setting, time, error, error, error, default)

    @property
    def title(self) -> str:
        """Its name."""
        return f"{self.family}, {self.setting}" if self.setting else self.family


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
        bursts[name] = int(np.clip(burst_seconds / _timed(call, 0), 1, BURST))
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
                took = [_timed(methods[name], BURST * turn + n) for n in range(bursts[name])]
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


class TimedMapper:
    """A mapper under a stopwatch; `spent` holds the time of each update [s]."""

    def __init__(self, mapper: LineMapper) -> None:
        self.spent: list[float] = []
        self._mapper = mapper

    def update(self, scan: LaserScan) -> LineMap:
        """Take in a scan."""
        start = time.perf_counter()
        line_map = self._mapper.update(scan)
        self.spent.append(time.perf_counter() - start)
        return line_map
