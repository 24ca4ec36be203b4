"""How far off is the pose after an hour of driving, and what does each integrator cost?

Two hours are driven, with inputs that are held for a second each and with smooth ones. Their ends
are no integrator's: headings are sums of rationals or stand in closed form, and places are Gauss's
quadrature of smooth functions, added up without rounding. Euler and RK4 are written as one writes
them in Python; they are here to be measured, and drive nothing.
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import accumulate
from math import cos, fsum, sin, tau
from typing import Annotated, Any, NamedTuple

import numpy as np

from benchmarks.report import Figure, Report, scatter
from benchmarks.timing import timed
from lrf3d.geometry.lines import Float
from lrf3d.robot.kinematics import drive

HOUR = 3600.0
"""How long is driven [s]."""

NODES = 24
"""Nodes of Gauss's quadrature in a second: of these inputs it then leaves no digit out."""

SPEED, WAVES = (1.0, 0.4, 17.0), ((0.25, 23.0), (0.15, 11.0 * 2.0**0.5))
"""Smooth inputs: mean [m/s], amplitude [m/s] and period [s] of the speed; amplitudes [rad/s] and
periods [s] of the turn rate. No two periods are in step, so that no error cancels over a turn."""

DRIFT = 0.02
"""Mean turn rate [rad/s] of the smooth inputs."""


class Inputs(NamedTuple):
    """Speeds [m/s] and turn rates [rad/s] at times [s], numbers or arrays.

    They lead from the origin to an end (3,), whose theta [rad] counts full turns. Pieces (k,) are
    held for a second each; None where the inputs vary.
    """

    name: str
    v: Callable[[Any], Any]
    omega: Callable[[Any], Any]
    end: Float
    pieces: tuple[Float, Float] | None = None


def held_inputs(*, seconds: int = int(HOUR), seed: int = 0) -> Inputs:
    """Speeds and turn rates that change every second, as a controller of one hertz gives them."""
    rng = np.random.default_rng(seed)
    v, omega = rng.uniform(0.5, 1.5, seconds), rng.uniform(-0.5, 0.5, seconds)
    turned = accumulate(map(Fraction, omega.tolist()), initial=Fraction())
    headings = np.array([float(heading) for heading in turned])
    middles = headings[:-1] + 0.5 * omega
    chords = v * np.sinc(0.5 * omega / np.pi)
    end = [fsum(chords * np.cos(middles)), fsum(chords * np.sin(middles)), headings[-1]]

    def at(values: Float) -> Callable[[Any], Any]:
        last, plain = len(values) - 1, values.tolist()

        def value(t: Any) -> Any:
            if isinstance(t, np.ndarray):
                return values[np.minimum(t.astype(np.int64), last)]
            return plain[min(int(t), last)]

        return value

    return Inputs("inputs held for a second", at(v), at(omega), np.array(end), (v, omega))


def smooth_inputs(*, seconds: float = HOUR) -> Inputs:
    """Speeds and turn rates that change all the time."""
    (mean, swing, period), ((a, one), (b, other)) = SPEED, WAVES

    def v(t: Any) -> Any:
        return mean + swing * np.sin(tau / period * t)

    def omega(t: Any) -> Any:
        return DRIFT + a * np.sin(tau / one * t) + b * np.cos(tau / other * t)

    def heading(t: Any) -> Any:
        swings = a * one / tau * (1.0 - np.cos(tau / one * t))
        return DRIFT * t + swings + b * other / tau * np.sin(tau / other * t)

    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    count = int(np.ceil(seconds))
    width = seconds / count
    times = (np.arange(count)[:, None] + 0.5 * (1.0 + nodes)) * width
    steps = 0.5 * width * weights * v(times)
    theta = heading(times)
    x, y = fsum((steps * np.cos(theta)).ravel()), fsum((steps * np.sin(theta)).ravel())
    return Inputs("smooth inputs", v, omega, np.array([x, y, float(heading(np.array(seconds)))]))


START = (0.0, 0.0, 0.0)
"""Where each drive begins."""

STEPS, ARC_STEPS = (1.0, 0.1, 0.01), (1.0, 0.1, 0.01, 0.001)
"""Lengths of steps [s]."""

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""Tolerances of RK45."""

DEFAULT_TOLERANCE, SAMPLING = 1e-9, 0.1
"""What `lrf3d.drive` takes if not given: tolerance, and time between poses [s]."""

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


def bench(
    *,
    seconds: Annotated[float, "How long is driven [s]."] = HOUR,
    figure: Figure = None,
) -> Report:
    """Drive an hour with Euler, RK4, RK45 and exact arcs: run time against error."""
    report = Report(__doc__.splitlines()[0])
    for inputs in (held_inputs(seconds=int(seconds)), smooth_inputs(seconds=seconds)):
        for family, setting, end, default in integrators(inputs, seconds):
            end()
            off = end() - inputs.end
            took = min(timed(end) for _ in range(1 if family in ("Euler", "RK4") else 3))
            report.add(
                "integrators",
                inputs=inputs.name,
                integrator=family,
                setting=setting,
                drive_s=took,
                off_m=float(np.hypot(off[0], off[1])),
                heading_off_rad=f"{abs(float(off[2])):.1e}",
                default="default" if default else "",
            )
    held = {row["setting"]: row for row in report.tables["integrators"][:20]}
    report.save("integrating inputs that are held: exact arcs instead of RK45 at 1e-09",
                held[""]["drive_s"], held["1e-09"]["drive_s"])  # fmt: skip
    report.notes.append(
        "setting: the step, or the tolerance of RK45; default: what lrf3d.drive does"
    )
    if figure is not None:
        labels = "time of the whole drive [s]", "end off by [m]"
        rows = report.tables["integrators"]
        scatter(figure, rows, "drive_s", "off_m", "integrator", labels, "setting")
    return report


def _euler(inputs: Inputs, seconds: float, step: float) -> Float:
    (x, y, theta), v, omega = START, inputs.v, inputs.omega
    for number in range(round(seconds / step)):
        t = number * step
        ahead = float(v(t)) * step
        x += ahead * cos(theta)
        y += ahead * sin(theta)
        theta += float(omega(t)) * step
    return np.array([x, y, theta])


def _rk4(inputs: Inputs, seconds: float, step: float) -> Float:
    (x, y, theta), v, omega = START, inputs.v, inputs.omega
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
    return _end(inputs.v, inputs.omega, duration=seconds, dt=dt, tolerance=tolerance)


def _arcs(inputs: Inputs, seconds: float, step: float) -> Float:
    """Inputs held over each step as they are in its middle."""
    middles = np.asarray(step * (np.arange(round(seconds / step)) + 0.5), dtype=np.float64)
    return _end(inputs.v(middles), inputs.omega(middles), duration=step, dt=seconds)


def _pieces(inputs: Inputs) -> Float:
    assert inputs.pieces is not None
    return _end(*inputs.pieces, duration=1.0, dt=SAMPLING)


def _end(v: Any, omega: Any, **how: float) -> Float:
    return np.asarray(drive(START, v, omega, **how).poses[-1], dtype=np.float64)
