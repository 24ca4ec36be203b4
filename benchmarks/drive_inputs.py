"""An hour of driving with a known end: inputs over time, and the pose that they lead to.

The end is no integrator's: headings are sums of rationals or stand in closed form, and places are
Gauss's quadrature of smooth functions, added up without rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import fsum, tau

import numpy as np

from lrf3d.geometry import Float

HOUR = 3600.0
"""How long is driven [s]."""

NODES = 24
"""Nodes of Gauss's quadrature in a second: of these inputs it then leaves no digit out."""

SPEED, WAVES = (1.0, 0.4, 17.0), ((0.25, 23.0), (0.15, 11.0 * 2.0**0.5))
"""Smooth inputs: mean [m/s], amplitude [m/s] and period [s] of the speed; amplitudes [rad/s] and
periods [s] of the turn rate. No two periods are in step, so that no error cancels over a turn."""

DRIFT = 0.02
"""Mean turn rate [rad/s] of the smooth inputs."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Inputs of an hour, and where they lead from the origin.

    Args:
        name: What kind of inputs.
        v: Speed [m/s] at times [s], a number or an array.
        omega: Turn rate [rad/s], likewise.
        end: Pose (3,) after the hour; theta [rad] counts full turns.
        pieces: Speeds and turn rates (k,) that are held for a second each; None where they vary.
    """

    name: str
    v: Callable[[Float], Float]
    omega: Callable[[Float], Float]
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

    def at(values: Float) -> Callable[[Float], Float]:
        last = len(values) - 1
        plain = values.tolist()

        def value(t: Float) -> Float:
            if isinstance(t, np.ndarray):
                return np.asarray(values[np.minimum(t.astype(np.int64), last)])
            found: Float = plain[min(int(t), last)]
            return found

        return value

    return Inputs("inputs held for a second", at(v), at(omega), np.array(end), (v, omega))


def smooth_inputs(*, seconds: float = HOUR) -> Inputs:
    """Speeds and turn rates that change all the time."""
    mean, swing, period = SPEED

    def v(t: Float) -> Float:
        return mean + swing * np.sin(tau / period * t)

    def omega(t: Float) -> Float:
        (a, one), (b, other) = WAVES
        return np.asarray(DRIFT + a * np.sin(tau / one * t) + b * np.cos(tau / other * t))

    def heading(t: Float) -> Float:
        (a, one), (b, other) = WAVES
        swings = a * one / tau * (1.0 - np.cos(tau / one * t))
        return np.asarray(DRIFT * t + swings + b * other / tau * np.sin(tau / other * t))

    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    count = int(np.ceil(seconds))
    width = seconds / count
    times = (np.arange(count)[:, None] + 0.5 * (1.0 + nodes)) * width
    steps = 0.5 * width * weights * v(times)
    theta = heading(times)
    x, y = fsum((steps * np.cos(theta)).ravel()), fsum((steps * np.sin(theta)).ravel())
    return Inputs("smooth inputs", v, omega, np.array([x, y, float(heading(np.array(seconds)))]))
