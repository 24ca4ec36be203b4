"""Errors of a trajectory: against known relative poses, or against the true trajectory.

Relations are scored as by Kümmerle et al. (2009). An estimate and the true trajectory are matched
by their stamps; absolute errors after the best rigid alignment leave, and relative ones from each
pose to the next, as evo defines them (Sturm et al. 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log10
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, expect
from lrf3d.geometry.lines import Bool, Float, Int, Value, wrap_angle
from lrf3d.geometry.pose import Pose, as_poses, between, compose
from lrf3d.robot import Trajectory
from lrf3d.scoring.map_score import Report

# Largest difference of two stamps [s] that are taken for one, as in evo.
MATCHED = 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Relations(Value):
    """Known relative poses (r, 3) x, y [m], theta [rad] between poses of a trajectory.

    Each is the second pose in the frame of the first, by their indices (r,), certain (r,) or not.
    """

    first: Int
    second: Int
    relative: Float
    certain: Bool

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True, slots=True)
class TrajectoryScore(Report):
    """Errors of the relative poses of a trajectory.

    Errors of the translation are in [m], absolute errors of the rotation in [°], each with its mean
    and its standard deviation over the relations; the mean over certain ones is NaN without any.
    """

    relations: int
    translation_mean: float
    translation_std: float
    rotation_mean: float
    rotation_std: float
    certain_translation_mean: float
    certain_rotation_mean: float


def score_trajectory(poses: Float, relations: Relations) -> TrajectoryScore:
    """Score poses (n, 3) by relations between them.

    Raises:
        InputError: A relation refers to a pose that does not exist.

    Examples:
        >>> import numpy as np
        >>> from lrf3d.scoring import Relations, score_trajectory
        >>> there = np.array([[2.0, 0.0, 0.0]])
        >>> known = Relations(np.array([0]), np.array([1]), there, np.array([True]))
        >>> float(round(score_trajectory([(0, 0, 0), (2, 0.5, 0)], known).translation_mean, 3))
        0.5
    """
    poses = as_poses(poses)
    expect(relations, Relations, "relations")
    last = int(max(relations.first.max(), relations.second.max()))
    if last >= len(poses):
        raise InputError(
            f"relations: one is of pose {last}, the trajectory has {len(poses)}; they belong to"
            " another log"
        )
    off = between(poses[relations.first], poses[relations.second]) - relations.relative
    apart = np.hypot(off[:, 0], off[:, 1])
    turned = np.degrees(np.abs(wrap_angle(off[:, 2])))
    certain = relations.certain
    return TrajectoryScore(
        relations=len(relations),
        translation_mean=float(apart.mean()),
        translation_std=float(apart.std()),
        rotation_mean=float(turned.mean()),
        rotation_std=float(turned.std()),
        certain_translation_mean=float(apart[certain].mean()) if certain.any() else np.nan,
        certain_rotation_mean=float(turned[certain].mean()) if certain.any() else np.nan,
    )


@dataclass(frozen=True, eq=False, repr=False)
class PoseErrors:
    """The errors of a trajectory, in metres and degrees.

    Args:
        absolute: (m,) distances of the positions after the alignment.
        unaligned: (m,) distances without it.
        relative: (m − 1,) errors of the steps from pose to pose [m].
        turned: (m − 1,) errors of their turns [°].
        alignment: Pose of the estimate's frame in the true one.
        matched: Number of matched poses, of all that the estimate has.
        interpolated: Whether truth was interpolated, as no stamps are alike.
    """

    absolute: Float
    unaligned: Float
    relative: Float
    turned: Float
    alignment: Pose
    matched: tuple[int, int]
    interpolated: bool

    def as_dict(self) -> dict[str, Any]:
        """The figures of each kind of error by evo's names, in JSON's types."""
        return {
            "matched_poses": self.matched[0],
            "poses": self.matched[1],
            "alignment": list(self.alignment),
            "ape_m": _figures(self.absolute),
            "ape_unaligned_m": _figures(self.unaligned),
            "rpe_m": _figures(self.relative),
            "rpe_deg": _figures(self.turned),
        }


def pose_errors(truth: Trajectory, estimate: Trajectory) -> PoseErrors:
    """Compare an estimated trajectory with the true one, of one robot by one clock.

    Raises:
        InputError: Their times do not overlap, or fewer than three poses match.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.scoring.trajectory_score import pose_errors
        >>> truth = lrf3d.Trajectory([0, 1, 2], [(0, 0, 0), (1, 0, 0), (2, 0, 0)])
        >>> turned = lrf3d.Trajectory([0, 1, 2], [(5, 0, 1.57), (5, 1, 1.57), (5, 2.1, 1.57)])
        >>> pose_errors(truth, turned).absolute.round(3).tolist()
        [0.033, 0.033, 0.067]
    """
    first = estimate.times[0]
    last = estimate.times[-1]
    begin = truth.times[0]
    end = truth.times[-1]
    spans = f"stamps from {first:.6g} to {last:.6g} s, the run's from {begin:.6g} to {end:.6g} s"
    if last < begin - MATCHED or first > end + MATCHED:
        raise InputError(f"trajectory: {spans}: they do not overlap{_other_clock(truth, estimate)}")
    ours, theirs = _matched(truth.times, estimate.times)
    least_matched = 3  # Poses that an alignment needs.
    interpolated = len(ours) < least_matched
    if interpolated:
        theirs = np.flatnonzero((estimate.times >= begin) & (estimate.times <= end))
        if len(theirs) < least_matched:
            hint = _other_clock(truth, estimate)
            raise InputError(f"trajectory: {len(theirs)} of its poses match, {spans}{hint}")
        true = truth.at(estimate.times[theirs])
    else:
        true = truth.poses[ours]
    found = estimate.poses[theirs]
    sizes = [float(np.hypot(*np.ptp(each[:, :2], axis=0))) for each in (found, true)]
    if 900.0 * sizes[1] < sizes[0] < 1100.0 * sizes[1]:
        raise InputError("trajectory: 1000 times as large as the run's; expected metres")
    alignment = rigid_alignment(found[:, :2], true[:, :2])
    steps = between(between(true[:-1], true[1:]), between(found[:-1], found[1:]))
    return PoseErrors(
        np.hypot(*(compose(np.array(alignment), found) - true)[:, :2].T),
        np.hypot(*(found - true)[:, :2].T),
        np.hypot(steps[:, 0], steps[:, 1]),
        np.degrees(np.abs(wrap_angle(steps[:, 2]))),
        alignment,
        (len(theirs), len(estimate)),
        interpolated,
    )


def _other_clock(truth: Trajectory, estimate: Trajectory) -> str:
    """How the stamps of an estimate may be brought to the clock of the true trajectory."""
    theirs = float(np.ptp(estimate.times))
    ours = float(np.ptp(truth.times))
    late = float(estimate.times[0] - truth.times[0])
    said = {
        9: "; expected seconds, they look like nanoseconds",
        6: "; expected seconds, they look like microseconds",
        3: "; expected seconds, they look like milliseconds",
        0: f"; shifted by {-late:.6f} s they would",
    }
    return said.get(round(log10(theirs / ours)), "") if theirs else ""


def rigid_alignment(points: Float, onto: Float) -> Pose:
    """The motion that brings points (n, 2) nearest to others (n, 2) (Umeyama 1991, no scale)."""
    middle = points.mean(axis=0)
    target = onto.mean(axis=0)
    a = points - middle
    b = onto - target
    theta = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    x, y = target - Pose(0.0, 0.0, theta).apply(middle[None])[0]
    return Pose(float(x), float(y), theta)


def _matched(truth: Float, estimate: Float) -> tuple[Int, Int]:
    """Indices of equal stamps: for each of the shorter series the nearest of the other."""
    short, long = (truth, estimate) if len(truth) < len(estimate) else (estimate, truth)
    after = np.clip(np.searchsorted(long, short), 1, max(len(long) - 1, 1))
    after = np.minimum(after, len(long) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(short - long[before] <= long[after] - short, before, after)
    alike = np.flatnonzero(np.abs(long[nearest] - short) <= MATCHED)
    pair = alike, nearest[alike]
    return pair if len(truth) < len(estimate) else pair[::-1]


def _figures(errors: Float) -> dict[str, float]:
    """Statistics of errors (n,) as evo prints them."""
    return {
        "rmse": float(np.sqrt((errors**2).mean())),
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "std": float(errors.std()),
        "min": float(errors.min()),
        "max": float(errors.max()),
    }
