"""Mirror: a laser that turns clockwise, which its log does not say, has its beams reversed."""

import warnings
from dataclasses import replace

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.geometry.lines import Float, sealed
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.pairs import CLEARLY, ENOUGH_TURNS, SHOWN_TURN
from lrf3d.recordings.repair.recording import Recording

# Turn from scan to scan [rad] that odometry in radians seldom exceeds; degrees often do. Scans that
# seem to stand still, as in a bare corridor, fit turns in degrees, too.
HUGE = 0.5

# Least share of the robot's turns, by odometry, that its scans show. Below it the laser does not
# scan a level plane, or the poses are not those of its robot.
LEAST_SHOWN = 0.1

# Turn per metre of path [rad/m] above which it is no error of the wheels.
BENT = 0.1

# Sum of the turns above `BENT` [rad] from which on scans must show them.
WHOLE = np.pi


def find(recording: Recording) -> bool | None:
    """Whether the laser turns clockwise, by the turns between its scans."""
    steps = np.diff(recording.path.at(recording.stamped_at), axis=0)
    mirrored = _is_mirrored(recording.turns, steps[:, 2])
    _warn_of_another_plane(recording, steps)
    return mirrored or None


def _is_mirrored(turns: Float, wheels: Float) -> bool:
    """Whether the turns (k − 1,) [rad] of scans are opposite to those of the odometry."""
    known = np.isfinite(turns) & (np.abs(wheels) > SHOWN_TURN)
    if known.sum() < ENOUGH_TURNS:
        return False
    alike, mirrored, in_degrees = (
        float(np.median(np.abs(turns[known] - share * wheels[known])))
        for share in (1.0, -1.0, np.radians(1.0))
    )
    if CLEARLY * in_degrees < alike and np.quantile(np.abs(wheels), 0.9) > HUGE:
        raise InputError("the odometry turns in degrees, by its scans; expected radians")
    return CLEARLY * mirrored < alike


def _warn_of_another_plane(recording: Recording, steps: Float) -> None:
    """Warn of scans that do not turn with the robot, whose steps between scans are (k − 1, 3)."""
    turned = np.abs(steps[:, 2])
    clear = BENT * np.hypot(*steps[:, :2].T)
    if turned[turned > clear].sum() > WHOLE and recording.shown_share(clear) < LEAST_SHOWN:
        warnings.warn(
            f"{recording.log.name}: its scans do not turn with the robot: the laser does not scan"
            " a level plane, or the poses are not those of its robot",
            Lrf3dWarning, stacklevel=5,
        )  # fmt: skip


def apply(recording: Recording, _: bool) -> Recording:
    """The recording with the beams of all scans reversed."""
    # Reversed beams are no longer in the order in which they were sent.
    fans = {id(scan.angles): sealed(-scan.angles[::-1]) for scan in recording.scans}
    scans = [
        replace(scan, angles=fans[id(scan.angles)], ranges=scan.ranges[::-1], time_increment=0.0)
        for scan in recording.scans
    ]
    return replace(recording, scans=scans, seen_turns=-recording.turns)


MIRROR = Repair(
    "mirror",
    find,
    apply,
    lambda _: "the laser turns clockwise, unlike the odometry: its beams were reversed",
    lambda mirrored: {"mirrored": mirrored is not None},
)
