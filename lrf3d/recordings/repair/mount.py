"""Mount: where a laser stands on its robot if its log does not say, as the robot's turns show it.

Poses of the odometry are the robot's. While it turns, a laser away from its centre moves along an
arc: the motion of the laser, by its scans, and that of the robot give the pose between them, as in
hand-eye calibration (Censi et al. 2013, "Simultaneous calibration of odometry and sensor parameters
for mobile robots").
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import ROUNDING, Float
from lrf3d.geometry.pose import Pose, between, compose
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.pairs import (
    CLEARLY,
    LEAST_COMPARED,
    SHOWN_TURN,
    motion_of,
    pairs_along,
)
from lrf3d.recordings.repair.recording import Recording

# Least distance of the laser from the centre [m], or turn [rad], that is corrected: less moves a
# map no more than the odometry's own noise does.
LEAST = 0.1

# Residual [m] beyond which pairs of scans count linearly: the noise of matching and of odometry.
NOISE = 0.02

# Largest distance of a laser from the centre of its robot along x and y [m], and turn [rad].
FARTHEST = 3.5

# Largest error of the distances by odometry, as a share.
LARGEST_ERROR = 0.2

# Covariance of the window in which the motion of the laser is searched: 0.4 m and 0.1 rad.
WINDOW: Float = 0.1**2 * np.diag([4, 4, 1]) ** 2


def find(recording: Recording) -> Pose | None:
    """The pose of a laser that is taken to be in the middle, if its motions show another one."""
    log = recording.log
    is_said = recording.scans[0].mount != CENTRE or log.odometry.laser_offset or log.parts
    if is_said or not log.placed:
        return None
    driven, seen = _motions(recording)
    if not _show_a_mount(driven, seen):
        return None
    (_, centred), straight, turned = (
        _fitted(driven, seen, farthest)
        for farthest in ((ROUNDING, ROUNDING), (FARTHEST, ROUNDING), (FARTHEST, FARTHEST))
    )
    # A robot that turns on the spot does not show a turn of its laser.
    mount, off = turned if straight[1] > CLEARLY * turned[1] else straight
    is_away = max(np.hypot(mount.x, mount.y), abs(mount.theta)) > LEAST
    return mount if is_away and centred > CLEARLY * off else None


def _show_a_mount(driven: Float, seen: Float) -> bool:
    """Whether motions (k, 3) of the robot and of its laser are enough, and turn alike.

    No mount explains turns that scans do not show: those are poses of another drive.
    """
    turns = driven[:, 2]
    return len(turns) >= LEAST_COMPARED and bool(
        np.abs(turns).mean() < SHOWN_TURN or seen[:, 2] @ turns > 0.5 * turns @ turns
    )


def _motions(recording: Recording) -> tuple[Float, Float]:
    """Motions (k, 3) of the robot by its odometry, and of the laser by its scans."""
    poses = recording.path.at(recording.taken_at)
    motions = []
    for pair in pairs_along(poses):
        check()
        step = between(*poses[pair])
        scans = [recording.scans[number] for number in pair]
        motion = motion_of(recording.converter, scans, step, WINDOW)
        motions += [] if motion is None else [(step, motion)]
    driven, seen = np.array(motions).reshape(-1, 2, 3).swapaxes(0, 1)
    return driven, seen


def _fitted(driven: Float, seen: Float, farthest: tuple[float, float]) -> tuple[Pose, float]:
    """Fit the mount and the error of distances to motions (k, 3) of the robot and of the laser.

    The mount is at most as far [m], [rad] from the centre. Returned with it is the median distance
    [m] that remains, which a few wrong matches do not change.
    """
    cos = np.cos(seen[:, 2])
    sin = np.sin(seen[:, 2])

    def left(values: Float) -> Float:
        x, y, turn, scale = values
        moved = compose(np.array([0.0, 0.0, turn]), seen)
        ahead = (cos - 1.0) * x - sin * y + (1.0 + scale) * driven[:, 0] - moved[:, 0]
        aside = sin * x + (cos - 1.0) * y + (1.0 + scale) * driven[:, 1] - moved[:, 1]
        return np.concatenate([ahead, aside])

    distance, turned = farthest
    bounds = np.array([distance, distance, turned, LARGEST_ERROR])
    turns = (0.0, 0.5 * np.pi, -0.5 * np.pi, np.pi)
    starts = (np.array([0.0, 0.0, turn, 0.0]) for turn in turns if abs(turn) < turned)
    fits = [
        least_squares(left, start, bounds=(-bounds, bounds), loss="huber", f_scale=NOISE)
        for start in starts
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    x, y, turn, _ = best.x.tolist()
    return Pose(x, y, turn), float(np.median(np.hypot(*best.fun.reshape(2, -1))))


def apply(recording: Recording, mount: Pose) -> Recording:
    """The recording with its laser at a mount; poses that were its robot's are now the laser's."""

    def moved(scan: LaserScan) -> LaserScan:
        pose = compose(np.array(scan.pose), np.array(mount))
        return replace(scan, mount=mount, pose=Pose(*pose.tolist()))

    log = replace(recording.log, scans=[*map(moved, recording.log.scans)])
    scans = [*map(moved, recording.scans)]
    return replace(recording, log=log, scans=scans)


def sentence(mount: Pose) -> str:
    """Where the laser is found on the robot."""
    turn = round(np.degrees(mount.theta))
    return (
        f"the poses are not the laser's: by its scans in turns it stands {mount.x:.2f} m ahead of"
        f" them and {mount.y:.2f} m to the left, turned by {turn}°: corrected"
    )


MOUNT = Repair("mount", find, apply, sentence)
