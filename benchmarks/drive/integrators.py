"""Integrators of Eq. 2: the textbook's, SciPy's and exact arcs, each with one face.

Euler and RK4 are written as one writes them in Python; they are here to be measured, and drive
nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import cos, sin
from typing import Any

import numpy as np

from benchmarks.drive.inputs import Inputs
from lrf3d.geometry import Float
from lrf3d.robot.driving import drive
from lrf3d.robot.trajectory import Trajectory

START = (0.0, 0.0, 0.0)
"""Where each drive begins."""

EULER_STEPS, RK4_STEPS, ARC_STEPS = (1.0, 0.1, 0.01), (1.0, 0.1, 0.01), (1.0, 0.1, 0.01, 0.001)
"""Lengths of steps [s]."""

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""Tolerances of RK45."""

DEFAULT_TOLERANCE, SAMPLING = 1e-9, 0.1
"""What `lrf3d.drive` takes where nothing is said: tolerance, and time between poses [s]."""


@dataclass(frozen=True, slots=True)
class Integrator:
    """One way to integrate, with its setting.

    Args:
        family: Its kind.
        setting: Step or tolerance, as words.
        end: Gives the pose (3,) at the end of a drive.
        default: Whether lrf3d does so by default.
    """

    family: str
    setting: str
    end: Callable[[], Float]
    default: bool = False

    @property
    def title(self) -> str:
        """Its name with the setting."""
        return f"{self.family}, {self.setting}" if self.setting else self.family


def integrators(inputs: Inputs, seconds: float) -> list[Integrator]:
    """All integrators, ready to drive so long [s] with some inputs."""
    held = inputs.pieces is not None
    found = [
        Integrator("Euler", f"{step:g} s", partial(_euler, inputs, seconds, step))
        for step in EULER_STEPS
    ]
    found += [
        Integrator("RK4", f"{step:g} s", partial(_rk4, inputs, seconds, step)) for step in RK4_STEPS
    ]
    found += [
        Integrator("RK45", f"{tol:.0e}", partial(_rk45, inputs, seconds, tol, 1.0))
        for tol in TOLERANCES
    ]
    if held:
        return [*found, Integrator("exact arcs", "", partial(_pieces, inputs), default=True)]
    found += [
        Integrator("arcs", f"{step:g} s", partial(_arcs, inputs, seconds, step))
        for step in ARC_STEPS
    ]
    usual = Integrator(
        "RK45",
        f"{DEFAULT_TOLERANCE:.0e}, a pose every {SAMPLING:g} s",
        partial(_rk45, inputs, seconds, DEFAULT_TOLERANCE, SAMPLING),
        default=True,
    )
    return [*found, usual]


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
    return _end(drive(START, v, omega, duration=seconds, dt=dt, tolerance=tolerance))


def _arcs(inputs: Inputs, seconds: float, step: float) -> Float:
    """Inputs held over each step as they are in its middle."""
    middles = np.asarray(step * (np.arange(round(seconds / step)) + 0.5), dtype=np.float64)
    v, omega = inputs.v(middles), inputs.omega(middles)
    return _end(drive(START, v, omega, duration=step, dt=seconds))


def _pieces(inputs: Inputs) -> Float:
    assert inputs.pieces is not None
    v, omega = inputs.pieces
    return _end(drive(START, v, omega, duration=1.0, dt=SAMPLING))


def _end(trajectory: Trajectory) -> Float:
    return np.asarray(trajectory.poses[-1], dtype=np.float64)
