"""``scripts/bench drive``: how far off is the pose after an hour of driving, and at what cost?

Two hours are driven, with inputs that are held for a second each and with smooth ones; the ends
of both are known (`benchmarks.drive.inputs`).
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from benchmarks.drive.inputs import HOUR, held_inputs, smooth_inputs
from benchmarks.drive.integrators import Integrator, integrators
from benchmarks.panels import Rows, TradeOff
from benchmarks.results import Result, Saving
from benchmarks.text import duration, quartiles
from benchmarks.timing import Method, Timing, take_turns
from lrf3d.geometry import Float
from lrf3d.tables import table

SECONDS = 60.0
"""Time for all [s], where none is given."""

CALLS = 6
"""Calls of an integrator that takes turns, at least, the untimed ones included."""


@dataclass(frozen=True, slots=True)
class Driven:
    """How one integrator did.

    Args:
        inputs: What kind of inputs.
        integrator: The integrator's family.
        setting: Its step or tolerance.
        default: Whether lrf3d takes it by default.
        drive: Time of the whole drive [s].
        position_error_m: Distance of its end from the true one [m].
        heading_error_rad: The same of the heading [rad].
    """

    inputs: str
    integrator: str
    setting: str
    default: bool
    drive: Timing
    position_error_m: float
    heading_error_rad: float

    @property
    def method(self) -> Method:
        """Its time and its error."""
        words = self.inputs, self.integrator, self.setting
        return Method.of(*words, self.drive, self.position_error_m, default=self.default)


@dataclass(kw_only=True)
class DriveResult(Result):
    """What was measured of drives.

    Args:
        driven_s: How long the drives are [s].
        entries: Each integrator with each kind of inputs.
    """

    benchmark = "drive"
    driven_s: float = HOUR
    entries: list[Driven] = field(default_factory=list)

    def tables(self) -> Iterable[str]:
        head = ("inputs", "integrator", "setting", "drive", "quartiles", "off", "heading off", "")
        rows = [
            (
                entry.inputs,
                entry.integrator,
                entry.setting,
                duration(entry.drive.median),
                quartiles(entry.drive.low, entry.drive.high) if entry.drive.calls > 1 else "",
                f"{entry.position_error_m:.1e} m",
                f"{entry.heading_error_rad:.1e} rad",
                "default" if entry.default else "",
            )
            for entry in self.entries
        ]
        yield table(head, rows, left=(0, 1, 2))
        yield (
            f"the pose after {self.driven_s:g} s of driving against the true one; setting: the"
            " step, or the tolerance\nof RK45; default: what lrf3d.drive does where nothing is said"
        )

    def panels(self) -> tuple[Rows, tuple[str, str]]:
        methods = [entry.method for entry in self.entries]
        row = [
            TradeOff(thing, "time of the whole drive", "end off by [m]",
                     [method for method in methods if method.thing == thing])
            for thing in dict.fromkeys(method.thing for method in methods)
        ]  # fmt: skip
        return [row], (
            "Driving: run time against error",
            f"the place after {self.driven_s:,.0f} s of driving, against the true one  ·  beside"
            " the points: the step, or the tolerance of RK45",
        )


def bench_drive(
    *,
    seconds: float = SECONDS,
    driven: float = HOUR,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> DriveResult:
    """Drive an hour with all integrators.

    Args:
        seconds: Time for all [s]; an integrator for whose turns it does not suffice drives once.
        driven: How long each drive is [s].
        progress: Called with the steps done, and of how many.
    """
    begin = time.monotonic()
    result = DriveResult(driven_s=driven)
    kinds = (held_inputs(seconds=int(driven)), smooth_inputs(seconds=driven))
    chosen = {inputs.name: integrators(inputs, driven) for inputs in kinds}
    total = sum(map(len, chosen.values())) + len(kinds)
    steps = iter(range(1, total + 1))
    ends: dict[tuple[str, str], Float] = {}
    once: dict[tuple[str, str], float] = {}
    for name, some in chosen.items():
        for one in some:
            start = time.perf_counter()
            ends[name, one.title] = one.end()
            once[name, one.title] = time.perf_counter() - start
            progress(next(steps), total)
    left = max(0.0, seconds - (time.monotonic() - begin))
    for inputs in kinds:
        some = chosen[inputs.name]
        mine = {one.title: once[inputs.name, one.title] for one in some}
        timings = _timings(some, mine, left / len(kinds))
        for one in some:
            off = ends[inputs.name, one.title] - inputs.end
            result.entries.append(
                Driven(
                    inputs.name, one.family, one.setting, one.default, timings[one.title],
                    float(np.hypot(off[0], off[1])), abs(float(off[2])),
                )
            )  # fmt: skip
        progress(next(steps), total)
    result.savings = _savings(result.entries)
    result.took_s = time.monotonic() - begin
    return result


def _timings(some: list[Integrator], once: dict[str, float], left: float) -> dict[str, Timing]:
    """Time integrators by turns, only the fast ones where time is short: the others took `once`."""
    playing: dict[str, Callable[[int], object]] = {}
    for one in sorted(some, key=lambda one: once[one.title]):
        if CALLS * sum(once[name] for name in (*playing, one.title)) <= left:
            playing[one.title] = partial(_call, one)
    used = CALLS * sum(once[name] for name in playing) / 2
    timed = take_turns(playing, seconds=left - used)
    return {name: timed.get(name, Timing.of([spent])) for name, spent in once.items()}


def _call(integrator: Integrator, number: int) -> Float:
    return integrator.end()


def _savings(entries: list[Driven]) -> list[Saving]:
    """What is saved where arcs make integration needless."""
    arcs = [entry for entry in entries if entry.integrator == "exact arcs"]
    name = "integrating inputs that are held: exact arcs instead of RK45 at 1e-09"
    return [
        Saving(name, exact.drive.median, entry.drive.median)
        for exact in arcs
        for entry in entries
        if entry.inputs == exact.inputs and entry.setting == "1e-09"
    ]
