"""TrajectoryScore: a trajectory against relative poses that are known (Kümmerle et al. 2009)."""

from dataclasses import dataclass

import numpy as np

from lrf3d.errors import InputError, expect
from lrf3d.geometry import Bool, Float, Int, Value, wrap_angle
from lrf3d.pose import as_poses, between
from lrf3d.scoring.report import Report


@dataclass(frozen=True, eq=False, repr=False)
class Relations(Value):
    """Known relative poses (r, 3) x, y [m], theta [rad] between poses of a trajectory.

    Each is that of a second pose in the frame of a first one, by their indices (r,), which may both
    be certain (r,) or not.
    """

    first: Int
    second: Int
    relative: Float
    certain: Bool

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True, slots=True)
class TrajectoryScore(Report):
    """How far the relative poses of a trajectory are from known ones.

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
    before, after = poses[relations.first], poses[relations.second]
    off = between(before, after) - relations.relative
    apart, turned = np.hypot(off[:, 0], off[:, 1]), np.degrees(np.abs(wrap_angle(off[:, 2])))
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
