"""The cases of driving: a million steps of exact arcs, against sums that round nothing.

Turn rates are whole multiples of 2⁻²⁰ rad/s, so that every heading is a float64 and the reference
knows each chord to its last place; `fsum` adds the chords up.
"""

from math import fsum

import numpy as np

from lrf3d.geometry import Float
from lrf3d.robot.driving import drive
from lrf3d.robot.unicycle import Unicycle
from stress.cases import check

STEPS = 1_000_000
"""Steps of a long drive."""

GRAIN = 2.0**-20
"""What turn rates are whole multiples of [rad/s]; a step takes a second."""

METRES = "m"


def _inputs(rng: np.random.Generator, count: int) -> tuple[Float, Float, Float]:
    """A start with an exact heading, speeds [m/s] and turn rates [rad/s], some of them 0."""
    far = rng.choice([0.0, 1e3, 1e6])
    start = np.array([*(far + rng.uniform(-1.0, 1.0, 2)), GRAIN * rng.integers(-(2**22), 2**22)])
    v = rng.uniform(-1.0, 2.0, count)
    omega = GRAIN * rng.integers(-(2**19), 2**19, count) * rng.choice([0.0, 1.0, 1.0], count)
    return start, v, omega


def _end(start: Float, v: Float, omega: Float) -> Float:
    """The true end (3,) of steps of a second."""
    headings = start[2] + np.concatenate([[0.0], np.cumsum(omega)])
    middles = headings[:-1] + 0.5 * omega
    chords = v * np.sinc(0.5 * omega / np.pi)
    x = fsum([start[0], *(chords * np.cos(middles)).tolist()])
    y = fsum([start[1], *(chords * np.sin(middles)).tolist()])
    return np.array([x, y, headings[-1]])


def _off(found: Float, true: Float) -> Float:
    """How far an end is off [m]; a heading that is off at all is wrong."""
    off = float(np.hypot(*(found - true)[:2]))
    return np.array([off if found[2] == true[2] else np.inf])


def chained(rng: np.random.Generator) -> Float:
    """A million pieces of constant input in one drive."""
    start, v, omega = _inputs(rng, STEPS)
    found = drive(start, v, omega, duration=1.0, dt=float(STEPS)).poses[-1]
    return _off(found, _end(start, v, omega))


def stepped(rng: np.random.Generator) -> Float:
    """Steps taken one by one, as a simulation that reacts takes them."""
    start, v, omega = _inputs(rng, STEPS // 10)
    robot, pose = Unicycle(), start.tolist()
    for ahead, turn in zip(v.tolist(), omega.tolist(), strict=True):
        pose = robot.move(pose, ahead, turn, 1.0)
    return _off(np.array(pose), _end(start, v, omega))


def tiny_turns(rng: np.random.Generator) -> Float:
    """Turn rates down to the smallest floats: a straight line, with no 0 / 0 on the way to it."""
    omega = rng.choice([-1.0, 1.0], 200) * 10.0 ** rng.uniform(-320.0, -6.0, 200)
    errors = []
    for turn in omega.tolist():
        x, y, theta = Unicycle().move((0.0, 0.0, 0.0), 1.0, turn, 10.0)
        # sin(wt)/w and (1 − cos wt)/w to two terms, whose third is below 1e-22.
        true = 10.0 - turn**2 * 1000.0 / 6.0, 50.0 * turn
        errors.append(max(abs(x - true[0]), abs(y - true[1]), abs(theta - 10.0 * turn)))
    return np.array(errors)


DRIVES = (
    check("driving", "a million arcs in one drive", chained, bound=1e-5, unit=METRES, tries=8,
          each=2, heavy=True),
    check("driving", "100,000 steps one by one", stepped, bound=1e-5, unit=METRES, tries=4,
          each=1, heavy=True),
    check("driving", "turns of 1e-320 to 1e-6 rad/s", tiny_turns, bound=1e-14, unit=METRES,
          tries=10_000),
)  # fmt: skip
"""The cases of driving."""
