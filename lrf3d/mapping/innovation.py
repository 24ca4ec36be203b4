"""Innovation: by how much the lines of a scan differ from where a known map has them.

The known line is taken to the frame of the robot, where it is expected at alpha − theta and at
the distance p = n·(middle − place). Both are linear in the pose, and no large number enters: the
innovation does not depend on where the world has its origin.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, wrap_angle
from lrf3d.mapping.known_lines import KnownLines
from lrf3d.mapping.local_lines import LocalLines
from lrf3d.pose import Pose


class Innovation(NamedTuple):
    """Differences of pairs of lines, in the robot's frame; all arrays have the pairs' shape.

    Args:
        angle: Measured less expected alpha [rad].
        offset: Measured less expected p [m].
        normal_x: x and y of the known line's normal in the world, pointing away from the robot.
        normal_y: See above.
        variance_angle: Variances [rad², rad·m, m²] of the difference, but for the pose's share.
        covariance: See above.
        variance_offset: See above.
        faces: Whether the robot stands on the side that the known line is seen from.
    """

    angle: Float
    offset: Float
    normal_x: Float
    normal_y: Float
    variance_angle: Float
    covariance: Float
    variance_offset: Float
    faces: Bool

    def with_pose(self, pose_covariance: Float) -> tuple[Float, Float, Float]:
        """Variances of the difference, with the share of a pose's covariance (3, 3)."""
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = pose_covariance.tolist()
        x, y = self.normal_x, self.normal_y
        return (
            self.variance_angle + tt,
            self.covariance + x * xt + y * yt,
            self.variance_offset + x * x * xx + 2.0 * x * y * xy + y * y * yy,
        )

    def squared_distance(self, pose_covariance: Float) -> Float:
        """Mahalanobis distance squared, of two degrees of freedom."""
        aa, ap, pp = self.with_pose(pose_covariance)
        angle, offset = self.angle, self.offset
        return np.asarray(
            (pp * angle**2 - 2.0 * ap * angle * offset + aa * offset**2) / (aa * pp - ap**2)
        )


def innovation(
    local: LocalLines, known: KnownLines, pose: Pose, *, rows: Int, known_rows: Int
) -> Innovation:
    """Compare lines of a scan with known lines, for a robot at a predicted pose.

    Args:
        local: The lines of the scan.
        known: The known map.
        pose: Where the robot is thought to be.
        rows: Rows of the scan's lines, of any shape that broadcasts with known_rows.
        known_rows: Rows of the known lines.
    """
    x, y = known.units[known_rows, 1], -known.units[known_rows, 0]
    dx = known.middles[known_rows, 0] - pose.x
    dy = known.middles[known_rows, 1] - pose.y
    turn = wrap_angle(local.lines[rows, 0] - np.arctan2(y, x) + pose.theta)
    faces = np.abs(turn) <= 0.5 * np.pi
    side = np.where(faces, 1.0, -1.0)
    angle = turn - np.where(faces, 0.0, np.copysign(np.pi, turn))
    # The expected p turns with the known line's direction by the lever from foot to middle.
    expected, lever = side * (x * dx + y * dy), side * (x * dy - y * dx)
    turn_variance = known.deviations[known_rows, 0] ** 2
    covariances = local.covariances[rows]
    return Innovation(
        angle,
        local.lines[rows, 1] - expected,
        side * x,
        side * y,
        covariances[..., 0, 0] + turn_variance,
        covariances[..., 0, 1] + lever * turn_variance,
        covariances[..., 1, 1] + lever**2 * turn_variance + known.deviations[known_rows, 1] ** 2,
        faces | (not known.one_sided),
    )
