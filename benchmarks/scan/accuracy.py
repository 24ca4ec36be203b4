"""Accuracy: how far the ranges of a baseline are off, and how often its wall is wrong.

The exact answers are PlanarCaster's: `scripts/stress` certifies them, beam by beam, by error
bounds and by rational numbers. Beams of plain scans hardly ever come near what is hard, so as many
again are aimed at corners.
"""

import time
from dataclasses import dataclass

import numpy as np

from benchmarks.result import Row
from benchmarks.scan.baselines import Baseline
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World

ONE_BEAM = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1)
"""One beam ahead: its direction is that of the pose."""

OFFSETS = (-9.0, -5.0)
"""Powers of ten between which beams pass beside the corners that they are aimed at [rad]."""

CHUNK = 25
"""Scans that are judged at once; a slow baseline is judged by as few, a fast one by all."""

GROSS = 0.01
"""A range is grossly wrong when it is off by more than this [m]: less is within what lasers err."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Beams from poses (k, 3), with their exact ranges [m] and walls (k, beams)."""

    lrf: LaserRangeFinder
    poses: Float
    ranges: Float
    walls: Int


def scan_trial(caster: PlanarCaster, lrf: LaserRangeFinder, poses: Float) -> Trial:
    """The beams of plain scans."""
    return Trial(lrf, poses, *caster.scan_batch(lrf, poses))


def corner_trial(caster: PlanarCaster, world: World, poses: Float, *, seed: int = 0) -> Trial:
    """A beam from each pose, aimed beside one end of the wall that it sees ahead."""
    rng = np.random.default_rng(seed)
    seen = caster.scan_batch(ONE_BEAM, poses)[1][:, 0]
    poses, seen = poses[seen >= 0].copy(), seen[seen >= 0]
    ends = world.segments[seen].reshape(-1, 2, 2)[
        np.arange(len(seen)), rng.integers(0, 2, len(seen))
    ]
    aside = rng.choice([-1.0, 1.0], len(seen)) * 10.0 ** rng.uniform(*OFFSETS, len(seen))
    to_end = ends - poses[:, :2]
    poses[:, 2] = np.arctan2(to_end[:, 1], to_end[:, 0]) + aside
    return scan_trial(caster, ONE_BEAM, poses)


def judge(baseline: Baseline, trial: Trial, *, seconds: float) -> Row:
    """Compare a baseline's answers with the exact ones, for as many scans as the time allows.

    A beam without return counts as one of range_max. The share of wrong walls is None where the
    baseline names no walls.
    """
    end = time.monotonic() + seconds
    errors, wrong = [], []
    size, start = CHUNK, 0
    while start < len(trial.poses) and (start == 0 or time.monotonic() < end):
        part = slice(start, start + size)
        ranges, walls = baseline.answers(trial.lrf, trial.poses[part])
        far = trial.lrf.range_max
        errors.append(np.abs(np.clip(ranges, 0.0, far) - np.clip(trial.ranges[part], 0.0, far)))
        if walls is not None:
            wrong.append(walls != trial.walls[part])
        start, size = start + size, 2 * size
    off = np.concatenate(errors)
    return {
        "beams": off.size,
        "largest_error_m": float(off.max()),
        "median_error_m": float(np.median(off)),
        "over_1_cm_share": float((off > GROSS).mean()),
        "wrong_wall_share": float(np.concatenate(wrong).mean()) if wrong else None,
    }
