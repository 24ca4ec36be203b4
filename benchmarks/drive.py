"""``scripts/bench drive``: how far off is the pose after an hour of driving, and at what cost?

Two hours are driven, with inputs that are held for a second each and with smooth ones; the ends
of both are known (`benchmarks.drive_inputs`). Euler and RK4 are written as one writes them in
Python; they are here to be measured, and drive nothing.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from math import cos, sin
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.chart import RING, draw, trade_offs
from benchmarks.drive_inputs import HOUR, Inputs, held_inputs, smooth_inputs
from benchmarks.result import Result, Table
from benchmarks.timing import Timing, take_turns, timed
from lrf3d.geometry import Float
from lrf3d.progress import Progress, silent
from lrf3d.robot.driving import drive

SECONDS = 60.0
"""Time for all [s], if none is given."""

CALLS = 6
"""Calls of an integrator that takes turns, at least, the untimed ones included."""

START = (0.0, 0.0, 0.0)
"""Where each drive begins."""

STEPS, ARC_STEPS = (1.0, 0.1, 0.01), (1.0, 0.1, 0.01, 0.001)
"""Lengths of steps [s]."""

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""Tolerances of RK45."""

DEFAULT_TOLERANCE, SAMPLING = 1e-9, 0.1
"""What `lrf3d.drive` takes if not given: tolerance, and time between poses [s]."""

ENTRIES = Table(
    "entries",
    {
        "inputs": "inputs",
        "integrator": "integrator",
        "setting": "setting",
        "drive": "drive",
        "drive.quartiles": "quartiles",
        "position_error_m": ("off", "{:.1e} m".format),
        "heading_error_rad": ("heading off", "{:.1e} rad".format),
        "default": "",
    },
    "the pose after the drive against the true one; setting: the step, or the tolerance of RK45;\n"
    "default: what lrf3d.drive does if not given",
    names=("inputs", "integrator", "setting"),
    time="drive",
    error="position_error_m",
    left=3,
)
"""Each integrator with each kind of inputs."""

Integrator = tuple[str, str, Callable[[], Float], bool]
"""Its kind, its setting, what drives and returns the pose (3,) at the end, and whether lrf3d does
so by default."""


def integrators(inputs: Inputs, seconds: float) -> Iterator[Integrator]:
    """All integrators, ready to drive for a time [s] with some inputs."""
    for family, steps, end in (("Euler", STEPS, _euler), ("RK4", STEPS, _rk4)):
        for step in steps:
            yield family, f"{step:g} s", partial(end, inputs, seconds, step), False
    for tolerance in TOLERANCES:
        yield "RK45", f"{tolerance:.0e}", partial(_rk45, inputs, seconds, tolerance, 1.0), False
    if inputs.pieces is not None:
        yield "exact arcs", "", partial(_pieces, inputs), True
        return
    for step in ARC_STEPS:
        yield "arcs", f"{step:g} s", partial(_arcs, inputs, seconds, step), False
    usual = f"{DEFAULT_TOLERANCE:.0e}, a pose every {SAMPLING:g} s"
    yield "RK45", usual, partial(_rk45, inputs, seconds, DEFAULT_TOLERANCE, SAMPLING), True


def bench_drive(
    *, seconds: float = SECONDS, driven: float = HOUR, progress: Progress = silent
) -> Result:
    """Drive an hour with all integrators.

    Args:
        seconds: Time for all [s]; an integrator for whose turns it does not suffice drives once.
        driven: How long each drive is [s].
        progress: Called with the steps done, and of how many.
    """
    begin = time.monotonic()
    result = Result(
        "drive",
        f"How far is the robot off its true place after {driven:,.0f} s of driving, and how long"
        " does it take to compute?",
        {"driven_s": driven},
        chart,
    )
    kinds = (held_inputs(seconds=int(driven)), smooth_inputs(seconds=driven))
    chosen = [list(integrators(inputs, driven)) for inputs in kinds]
    total = sum(map(len, chosen)) + len(kinds)
    steps = iter(range(1, total + 1))
    ends: list[list[Float]] = []
    once: list[list[float]] = []
    for some in chosen:
        ends.append([])
        once.append([])
        for _, _, end, _ in some:
            once[-1].append(timed(lambda end=end: ends[-1].append(end())))
            progress(next(steps), total)
    left = max(0.0, seconds - (time.monotonic() - begin)) / len(kinds)
    for inputs, some, reached, spent in zip(kinds, chosen, ends, once, strict=True):
        timings = _timings([end for _, _, end, _ in some], spent, left)
        for (family, setting, _, default), pose, timing in zip(some, reached, timings, strict=True):
            off = pose - inputs.end
            result.add(
                ENTRIES,
                inputs=inputs.name,
                integrator=family,
                setting=setting,
                default=default,
                drive=timing,
                position_error_m=float(np.hypot(off[0], off[1])),
                heading_error_rad=abs(float(off[2])),
            )
        progress(next(steps), total)
    held = {row["setting"]: row for row in result[ENTRIES] if row["inputs"] == kinds[0].name}
    name = "integrating inputs that are held: exact arcs instead of RK45 at 1e-09"
    result.save(name, held[""]["drive"].median, held["1e-09"]["drive"].median)
    result.took_s = time.monotonic() - begin
    return result


def _timings(ends: list[Callable[[], Float]], once: list[float], left: float) -> list[Timing]:
    """Time drives by turns, only the fast ones where time is short: the others took `once`."""
    playing: dict[str, Callable[[int], object]] = {}
    used = 0.0
    for k in np.argsort(once).tolist():
        if used + CALLS * once[k] <= left:
            used += CALLS * once[k]
            playing[str(k)] = lambda _, end=ends[k]: end()  # type: ignore[misc]
    timings = take_turns(playing, seconds=left - 0.5 * used)
    return [timings.get(str(k), Timing.of([spent])) for k, spent in enumerate(once)]


def chart(result: Result) -> Figure:
    """Time and error of each integrator, for both kinds of inputs."""
    panels = trade_offs(
        result[ENTRIES],
        things="inputs",
        x="drive",
        y="position_error_m",
        by="integrator",
        labels=("time of the whole drive", "end off by [m]"),
        note="setting",
    )
    return draw([panels], (
        "Driving: run time against error",
        f"the place after {result.facts['driven_s']:,.0f} s of driving, against the true one  ·"
        f"  beside the points: the step, or the tolerance of RK45  ·  {RING}",
    ))  # fmt: skip


def _euler(inputs: Inputs, seconds: float, step: float) -> Float:
    x, y, theta = START
    v: Any = inputs.v
    omega: Any = inputs.omega
    for number in range(round(seconds / step)):
        t = number * step
        ahead = float(v(t)) * step
        x += ahead * cos(theta)
        y += ahead * sin(theta)
        theta += float(omega(t)) * step
    return np.array([x, y, theta])


def _rk4(inputs: Inputs, seconds: float, step: float) -> Float:
    x, y, theta = START
    v: Any = inputs.v
    omega: Any = inputs.omega
    for number in range(round(seconds / step)):
        t = number * step
        v1, v2, v4 = float(v(t)), float(v(t + 0.5 * step)), float(v(t + step))
        w1, w2, w4 = float(omega(t)), float(omega(t + 0.5 * step)), float(omega(t + step))
        a, b, c = theta + 0.5 * step * w1, theta + 0.5 * step * w2, theta + step * w2
        x += step / 6.0 * (v1 * cos(theta) + 2.0 * v2 * (cos(a) + cos(b)) + v4 * cos(c))
        y += step / 6.0 * (v1 * sin(theta) + 2.0 * v2 * (sin(a) + sin(b)) + v4 * sin(c))
        theta += step / 6.0 * (w1 + 4.0 * w2 + w4)
    return np.array([x, y, theta])


def _rk45(inputs: Inputs, seconds: float, tolerance: float, dt: float) -> Float:
    v: Any = inputs.v
    omega: Any = inputs.omega
    return _end(v, omega, duration=seconds, dt=dt, tolerance=tolerance)


def _arcs(inputs: Inputs, seconds: float, step: float) -> Float:
    """Inputs held over each step as they are in its middle."""
    middles = np.asarray(step * (np.arange(round(seconds / step)) + 0.5), dtype=np.float64)
    return _end(inputs.v(middles), inputs.omega(middles), duration=step, dt=seconds)


def _pieces(inputs: Inputs) -> Float:
    assert inputs.pieces is not None
    return _end(*inputs.pieces, duration=1.0, dt=SAMPLING)


def _end(v: Any, omega: Any, **how: float) -> Float:
    return np.asarray(drive(START, v, omega, **how).poses[-1], dtype=np.float64)
