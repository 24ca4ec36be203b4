"""Recording: a log that is repaired, with the path of its robot by odometry and what was found.

A log enters, for a purpose. Repairs make one recording of another; `repair` runs them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int, usual_step
from lrf3d.geometry.pose import Pose, bent, between, compose
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.recordings.log import LaserLog
from lrf3d.recordings.repair import Applied, Repair
from lrf3d.recordings.repair.refusal import refuse_unplaced, refuse_unsolvable
from lrf3d.recordings.repair.turns import LEAST_PAIRS, LEAST_TURN, turns_between
from lrf3d.recordings.repair.wheel_path import WheelPath

# Lag of the scans [s] that is reported: by more than that maps of fast turns are blurred.
LATE = 0.03

# Accept the lag, or its drift, only if the cost without it is 1.3 times higher. In logs it is by
# 1.7 and more; between two lines the noise of both cancels in part, which looks like a lag of 1.1.
SURE = 1.3

# Share of lines that must have a stamp of their own, for stamps to be of any use.
STAMPED = 0.25


class Purpose(NamedTuple):
    """What a log is repaired for.

    Repairs are left out by their names. A lag is accepted if the cost without it is ``sure`` times
    higher and it reaches ``least_lag`` [s]. Where the poses of the scans are ``known``, they are
    the path of the laser; else the path is that of the odometry.
    """

    left_out: tuple[str, ...] = ()
    sure: float = SURE
    least_lag: float = 0.0
    known: bool = False


@dataclass(frozen=True, eq=False)
class Recording:
    """Scans (k,) of a log, and the path of their robot through poses (n, 3) at times (n,) [s].

    Places (k,) are for each scan the index of the last pose before it, and rows (lines,) for each
    odometry line of the log that of its pose. Scans are late by lags (k,) or (1,) [lines]. What
    repairs found is kept by their names; they have seen turns (k − 1,) [rad] between the scans.
    """

    log: LaserLog
    purpose: Purpose
    scans: list[LaserScan]
    poses: Float
    times: Float
    places: Int
    rows: Int
    stamped: bool
    converter: ScanConverter
    lags: Float = field(default_factory=partial(np.zeros, 1))
    found: Mapping[str, Applied] = field(default_factory=dict)
    seen_turns: Float | None = None

    @cached_property
    def path(self) -> WheelPath:
        """The path of the robot by odometry."""
        return WheelPath(self.poses, usual_step(self.times) if self.stamped else 0.0)

    @cached_property
    def turns(self) -> Float:
        """Turns (k − 1,) [rad] between following scans as they show them; NaN where unknown."""
        if self.seen_turns is None:
            return turns_between(self.converter, self.scans, self.path, self.places)
        return self.seen_turns

    @property
    def increments(self) -> list[Float] | list[None]:
        """How the robot moved (k, 3) to each scan by odometry; None each if there is none."""
        steps = self.path.increments(self.places - self.lags)
        return list(steps) if self.log.placed else [None] * len(steps)

    @property
    def sentences(self) -> list[str]:
        """What was wrong and what was done, a sentence each, but for notes of the log."""
        said = [each.repair.sentence(each.finding) for each in self.found.values()]
        return [sentence for sentence in said if sentence and sentence not in self.log.notes]

    def repaired(self, repair: Repair) -> "Recording":
        """The recording after a repair; itself if that is left out or finds nothing."""
        finding = None if repair.name in self.purpose.left_out else repair.find(self)
        if finding is None:
            return self
        after: Recording = repair.apply(self, finding)
        return replace(after, found={**after.found, repair.name: Applied(repair, finding, self)})

    def shown_share(self, least: Float | float = 0.0) -> float:
        """How much of the robot's turns over a least one [rad] the scans show; inf if unknown."""
        turned = np.abs(np.diff(self.path.at(self.places)[:, 2]))
        known = np.isfinite(self.turns) & (turned > LEAST_TURN) & (turned > least)
        if known.sum() < LEAST_PAIRS:
            return np.inf
        return float(np.median(np.abs(self.turns[known]) / turned[known]))

    def placed_scans(self) -> list[LaserScan]:
        """The scans with the poses of when they were taken."""
        if not self.lags.any():
            return self.scans
        robots = self.path.at(self.places - self.lags)
        return [
            replace(scan, pose=Pose(*compose(robot, np.array(scan.mount)).tolist()))
            for scan, robot in zip(self.scans, robots, strict=True)
        ]

    def line_poses(self, scan_poses: Float) -> Float:
        """Poses (lines, 3) at all odometry lines, which follow the odometry between scans.

        The pose of a line that a scan follows is that of the scan: the poses are by the clock of
        the laser, for it is the laser's measurements that they are compared with.
        """
        numbers = np.arange(len(self.poses))
        lags = np.broadcast_to(self.lags, self.places.shape)
        wheels = self.path.at(numbers - np.interp(numbers, self.places, lags))
        known, last = np.unique(self.places[::-1], return_index=True)
        # The difference between odometry and scans is spread by the motion, and a little by lines.
        steps = np.abs(between(wheels[:-1], wheels[1:])).sum(axis=1) + 1e-3
        driven = np.concatenate([[0.0], np.cumsum(steps)])
        lines = bent(wheels, known, scan_poses[::-1][last], driven)[self.rows]
        lines[:, 2] = np.unwrap(lines[:, 2])
        return lines


def recordings_of(log: LaserLog, purpose: Purpose) -> list[Recording]:
    """The recording of a log along its odometry; or those of its lasers, along known poses."""
    if purpose.known:
        refuse_unplaced(log)
        scans = [[scan for scan in log.scans if scan.laser == name] for name in log.lasers]
        return [_begun(replace(log, scans=own, wheels=None), purpose) for own in scans]
    log = log.of_moments()
    refuse_unsolvable(log)
    return [_begun(log, purpose)]


def _begun(log: LaserLog, purpose: Purpose) -> Recording:
    """A recording before its first repair."""
    line = log.odometry
    stamped = len(np.unique(line.times)) >= STAMPED * len(line.times)
    return Recording(
        log, purpose, list(log.scans), line.poses, line.times, np.maximum(line.places, 0),
        np.arange(len(line.times)), stamped or purpose.known, ScanConverter(line.laser_offset),
    )  # fmt: skip
