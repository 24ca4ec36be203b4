"""The cases of angles: at ±π, after many turns, and through chains of poses, against rationals."""

from fractions import Fraction

import numpy as np

from lrf3d.geometry import Float, normal_lines, wrap_angle
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.localization.pairing import innovation
from lrf3d.mapping import LineMap
from lrf3d.pose import as_pose
from stress.cases import check, ulps
from stress.rational import pi, wrapped

HAIRS = 8
"""Floats on either side of ±π that angles are taken from."""


def _by_half_turns(rng: np.random.Generator, count: int, turns: int) -> Float:
    """Odd and even multiples of π, to some floats on either side."""
    angles = np.pi * rng.integers(-turns, turns + 1, count)
    hairs = rng.integers(-HAIRS, HAIRS + 1, count)
    return np.asarray(angles + hairs * np.spacing(np.abs(angles)), dtype=np.float64)


def wraps(rng: np.random.Generator) -> Float:
    """Angles wrapped into (−π, π]; a full turn of difference is none, but outside is wrong."""
    near = _by_half_turns(rng, 200, 3)
    far = _by_half_turns(rng, 200, 10 ** int(rng.integers(1, 7)))
    angles = np.concatenate([near, far, rng.uniform(-1e6, 1e6, 100)])
    found = wrap_angle(angles)
    turn = 2 * pi()
    gaps = [
        float(abs(gap - turn * round(gap / turn)))
        for gap in (
            Fraction(a) - wrapped(b) for a, b in zip(found.tolist(), angles.tolist(), strict=True)
        )
    ]
    errors = ulps(np.array(gaps), np.maximum(np.abs(angles), np.pi))
    errors[(found <= -np.pi) | (found > np.pi)] = np.inf
    kept = (angles > -np.pi) & (angles <= np.pi)
    errors[kept & (found != angles)] = np.inf
    return errors


def compositions(rng: np.random.Generator) -> Float:
    """Poses that look back, composed with what undoes them."""
    heading = float(_by_half_turns(rng, 1, 3)[0])
    place = rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(0.0, 7.0, 2)
    pose = as_pose((*place.tolist(), heading))
    x, y, theta = pose @ pose.inverse()
    there = float(np.hypot(x, y)) / np.spacing(np.abs(place).max())
    return np.array([max(there, abs(float(theta)) / np.spacing(3.0 * np.pi))])


def expected_lines(rng: np.random.Generator) -> Float:
    """Walls with normals along −x, seen by robots that look back: where they are expected."""
    count = 40
    middle = rng.uniform(-20.0, 20.0, (count, 2))
    turn = 0.5 * np.pi * rng.integers(-2, 3, count) + rng.choice([0.0, 1e-16, 1e-9, -1e-9], count)
    half = rng.uniform(0.5, 5.0, count)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    segments = np.column_stack([middle - half, middle + half])
    far = rng.choice([0.0, 1e3, 1e6])
    pose = as_pose((*(far + rng.uniform(-3.0, 3.0, 2)), _by_half_turns(rng, 1, 1)[0]))
    cos, sin = np.cos(pose.theta), np.sin(pose.theta)
    world = segments + far
    # Differences from the pose are exact to half an ulp of the place, whatever the heading.
    ends = world - np.tile([pose.x, pose.y], 2)
    local = np.empty_like(ends)
    for k in (0, 2):
        local[:, k] = cos * ends[:, k] + sin * ends[:, k + 1]
        local[:, k + 1] = cos * ends[:, k + 1] - sin * ends[:, k]
    zeros, ones = np.zeros(count, dtype=np.int64), np.full(count, 10)
    known = KnownLines.from_map(LineMap(world, zeros, ones))
    own = LocalLines(local, normal_lines(local), np.tile(np.eye(2), (count, 1, 1)))
    rows = np.arange(count)
    found = innovation(own, known, pose, rows=rows, known_rows=rows)
    size = np.spacing(max(far, 32.0))
    near = np.abs(found.offset) / size
    # A turn moves a wall's ends by as much as half its length.
    return np.asarray(np.maximum(near, np.abs(found.angle) * half.max() / size))


ANGLES = (
    check("angles", "wrapped, up to a million turns", wraps, bound=2.0, unit="ulp of the angle",
          tries=50_000, each=10_000),
    check("angles", "poses that look back, undone", compositions, bound=4.0,
          unit="ulp of the place", tries=20_000, each=5_000),
    check("angles", "walls expected behind", expected_lines, bound=16.0,
          unit="ulp of the place", tries=40_000, each=8_000),
)  # fmt: skip
"""The cases of angles."""
