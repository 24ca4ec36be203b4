"""``bench drive``: how far off is the pose after an hour of driving, and what does that cost?

Two hours are driven, with inputs that are held for a second each and with smooth ones; the ends
of both are known (`lrf3d.study.bench.hour`).
"""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from lrf3d.cores import core_count
from lrf3d.geometry import Float
from lrf3d.study.bench.ablation import Saving
from lrf3d.study.bench.hour import HOUR, Hour, held_inputs, smooth_inputs
from lrf3d.study.bench.integrators import Integrator, integrators
from lrf3d.study.timing import Timing, take_turns

SECONDS = 60.0
"""Time for all [s], where none is given."""

CALLS = 6
"""Calls that a turn-taking rival has at least, the untimed ones included."""


@dataclass(frozen=True, slots=True)
class Driven:
    """How one integrator did.

    Args:
        inputs: What kind of inputs.
        integrator: The integrator.
        timing: Time of the whole drive [s].
        position: Distance of its end from the true one [m].
        heading: The same of the heading [rad].
    """

    inputs: str
    integrator: Integrator
    timing: Timing
    position: float
    heading: float

    def as_dict(self) -> dict[str, Any]:
        """The entry in JSON's types."""
        return {
            "inputs": self.inputs,
            "integrator": self.integrator.family,
            "setting": self.integrator.setting,
            "default": self.integrator.chosen,
            "drive": self.timing.as_dict(),
            "position_error_m": self.position,
            "heading_error_rad": self.heading,
        }


@dataclass
class DriveBenchmark:
    """What was measured.

    Args:
        driven: How long the drives are [s].
        entries: Each integrator with each kind of inputs.
        took: How long all took [s].
    """

    driven: float = HOUR
    entries: list[Driven] = field(default_factory=list)
    took: float = 0.0

    @property
    def savings(self) -> list[Saving]:
        """What is saved where arcs make integration needless."""
        arcs = next((e for e in self.entries if e.integrator.family == "exact arcs"), None)
        if arcs is None:
            return []
        name = "integrating inputs that are held: exact arcs instead of RK45 at 1e-09"
        return [
            Saving(name, arcs.timing.median, entry.timing.median)
            for entry in self.entries
            if entry.inputs == arcs.inputs and entry.integrator.setting == "1e-09"
        ]

    def as_dict(self) -> dict[str, Any]:
        """The benchmark in JSON's types."""
        return {
            "benchmark": "drive",
            "machine": {"system": platform.platform(), "cores": core_count()},
            "driven_s": self.driven,
            "entries": [entry.as_dict() for entry in self.entries],
            "savings": [saving.as_dict() for saving in self.savings],
            "took_s": self.took,
        }


def bench_drive(
    *,
    seconds: float = SECONDS,
    driven: float = HOUR,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> DriveBenchmark:
    """Drive an hour with all integrators.

    Args:
        seconds: Time for all [s]; an integrator for whose turns it does not suffice drives once.
        driven: How long each drive is [s].
        progress: Called with the steps done, and of how many.
    """
    begin = time.monotonic()
    result = DriveBenchmark(driven)
    hours = (held_inputs(seconds=int(driven)), smooth_inputs(seconds=driven))
    chosen = [(hour, one) for hour in hours for one in integrators(hour, driven)]
    steps = iter(range(1, len(chosen) + len(hours) + 1))
    total = len(chosen) + len(hours)
    ends: dict[str, Float] = {}
    once: dict[str, float] = {}
    for hour, one in chosen:
        start = time.perf_counter()
        ends[_key(hour, one)] = one.end()
        once[_key(hour, one)] = time.perf_counter() - start
        progress(next(steps), total)
    left = max(0.0, seconds - (time.monotonic() - begin))
    for hour in hours:
        result.entries += _timed(
            hour, [one for of, one in chosen if of is hour], ends, once, left / len(hours)
        )
        progress(next(steps), total)
    result.took = time.monotonic() - begin
    return result


def _timed(
    hour: Hour,
    rivals: list[Integrator],
    ends: dict[str, Float],
    once: dict[str, float],
    left: float,
) -> list[Driven]:
    """Time the integrators by turns, the fast ones first where time is short."""
    playing: dict[str, Callable[[int], object]] = {}
    for one in sorted(rivals, key=lambda one: once[_key(hour, one)]):
        key = _key(hour, one)
        share = sum(once[name] for name in (*playing, key))
        if CALLS * share <= left:
            playing[key] = partial(_call, one)
    timings = take_turns(playing, seconds=left - CALLS * sum(once[name] for name in playing) / 2)
    found = []
    for one in rivals:
        key = _key(hour, one)
        off = ends[key] - hour.end
        timing = timings.get(key, Timing.of([once[key]]))
        place = float(np.hypot(off[0], off[1]))
        found.append(Driven(hour.name, one, timing, place, abs(float(off[2]))))
    return found


def _call(integrator: Integrator, number: int) -> Float:
    return integrator.end()


def _key(hour: Hour, one: Integrator) -> str:
    return f"{hour.name}: {one.title}"
