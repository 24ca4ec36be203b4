"""Recording: a log that is repaired, with the path of its robot by odometry and what was found.

A log and a purpose enter. Each repair returns a new recording; `repairs.repair` runs them all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int, usual_step
from lrf3d.geometry.pose import Pose, bent, between, compose
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.recordings.log import COARSE, LaserLog
from lrf3d.recordings.repair import Applied, Repair
from lrf3d.recordings.repair.pairs import (
    ENOUGH_TURNS,
    SHOWN_TURN,
    explained,
    is_clear,
    pairs_along,
    turns_between,
)
from lrf3d.recordings.repair.refusal import refuse_unplaced, refuse_unsolvable
from lrf3d.recordings.repair.wheel_path import WheelPath

# Least lag of the scans [s] that is reported: larger ones blur maps of fast turns.
LATE = 0.03

# Accept the lag, or its drift, only if the cost without it is 1.3 times higher. In logs that have a
# lag it is 1.7 times and more. Without one it may be 1.1 times higher: between two odometry lines
# the noise of both cancels in part, which looks like a lag.
COST_RATIO = 1.3

# Least share of odometry lines with a stamp of their own; below it the stamps are not used.
STAMPED = 0.25


# Least share of scans whose stamps lie between those of the lines before and after them: then both
# have the same clock.
ONE_CLOCK = 0.9


class Purpose(NamedTuple):
    """What a log is repaired for.

    Repairs named in ``left_out`` are not made. A lag is accepted if the cost without it is ``sure``
    times higher and it reaches ``least_lag`` [s]. Where the poses of the scans are ``known``, they
    are the path of the laser; else the path is that of the odometry.
    """

    left_out: tuple[str, ...] = ()
    sure: float = COST_RATIO
    least_lag: float = 0.0
    known: bool = False


@dataclass(frozen=True, eq=False)
class Recording:
    """Scans (k,) of a log, and the path of their robot through poses (n, 3) at times (n,) [s].

    ``poses_before`` (k,) holds for each scan the index of the last pose before it, and ``rows``
    (lines,) for each odometry line the index of its pose: lines that are copies share one.
    ``stamped`` says whether poses have times of their own, as known ones always do; ``converter``
    prepares scans for matching. Scans are late by ``lags`` (k,) or (1,) [odometry lines]. ``found``
    holds what repairs found, by their names, and ``seen_turns`` (k − 1,) [rad] the turns between
    scans, if a repair has computed them.
    """

    log: LaserLog
    purpose: Purpose
    scans: list[LaserScan]
    poses: Float
    times: Float
    poses_before: Int
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
        """Turns (k − 1,) [rad] from each scan to the next, by matching them; NaN where unknown."""
        if self.seen_turns is None:
            return turns_between(self.converter, self.scans, self.path, self.stamped_at)
        return self.seen_turns

    @cached_property
    def stamped_at(self) -> Float:
        """Where on the path scans were stamped (k,), as indices of poses: at the pose before each.

        Where odometry is coarse, they lie between two poses by the stamps.
        """
        places = self.poses_before.astype(np.float64)
        if len(self.times) < 2 or self.path.interval < COARSE:
            return places
        before = self.times[self.poses_before]
        after = self.times[np.minimum(self.poses_before + 1, len(self.times) - 1)]
        since = np.array([scan.time for scan in self.scans]) - before
        share = since / np.where(after > before, after - before, np.inf)
        inside = (since >= 0.0) & (share <= 1.0)
        return places + np.where(inside, share, 0.0) if inside.mean() > ONE_CLOCK else places

    @property
    def taken_at(self) -> Float:
        """Where on the path scans were taken (k,), by stamps and lag, as indices of poses."""
        return self.stamped_at - self.lags

    @property
    def increments(self) -> list[Float] | list[None]:
        """Motion (k, 3) of the robot to each scan by odometry; a list of None without odometry."""
        steps = self.path.increments(self.taken_at)
        return list(steps) if self.log.placed else [None] * len(steps)

    @property
    def sentences(self) -> list[str]:
        """What was wrong and what was done, a sentence each."""
        said = (each.repair.sentence(each.finding) for each in self.found.values())
        return [*filter(None, said)]

    def part(self, chosen: Sequence[int]) -> "Recording":
        """The recording of some of its scans, along the whole path."""
        numbers = np.array(chosen)
        return replace(
            self,
            scans=[self.scans[k] for k in chosen],
            poses_before=self.poses_before[numbers],
            lags=self.lags[numbers] if len(self.lags) > 1 else self.lags,
            seen_turns=None,
        )

    def repaired(self, repair: Repair) -> "Recording":
        """The recording after a repair; unchanged if that is left out or finds nothing.

        A repair is proposed by local evidence; it is taken back if scans of the whole drive explain
        each other clearly worse with it.
        """
        finding = None if repair.name in self.purpose.left_out else repair.find(self)
        if finding is None:
            return self
        after: Recording = repair.apply(self, finding)
        if self._is_worse(after):
            return self
        return replace(after, found={**after.found, repair.name: Applied(repair, finding)})

    def _is_worse(self, after: "Recording") -> bool:
        """Whether scans explain each other clearly worse after a repair that keeps their number."""
        if len(after.scans) != len(self.scans) or not after.log.placed:
            return False
        pairs = pairs_along(self.path.at(self.taken_at))
        # Most repairs make the scans agree better, which a third of the pairs shows.
        for tried in (pairs[::3], pairs):
            before, now = (
                explained(
                    each.converter, each.scans.__getitem__, each.path.at(each.taken_at), tried
                )
                for each in (self, after)
            )
            losses = before - now
            if losses.sum() <= 0.0:
                return False
        return is_clear(losses)

    def shown_share(self, least: Float | float = 0.0) -> float:
        """Median share of the robot's turns above a least one [rad] that scans show; or inf."""
        turned = np.abs(np.diff(self.path.at(self.stamped_at)[:, 2]))
        known = np.isfinite(self.turns) & (turned > SHOWN_TURN) & (turned > least)
        if known.sum() < ENOUGH_TURNS:
            return np.inf
        return float(np.median(np.abs(self.turns[known]) / turned[known]))

    def placed_scans(self) -> list[LaserScan]:
        """The scans with the poses at which they were taken, corrected for their lag."""
        if not self.lags.any() and not (self.stamped_at % 1.0).any():
            return self.scans
        robots = self.path.at(self.taken_at)
        return [
            replace(scan, pose=Pose(*compose(robot, np.array(scan.mount)).tolist()))
            for scan, robot in zip(self.scans, robots, strict=True)
        ]

    def line_poses(self, scan_poses: Float) -> Float:
        """Poses (lines, 3) at all odometry lines: those of scans, and odometry between them.

        The last line before a scan gets the pose of the scan, whatever its lag is: the poses follow
        the clock of the laser, since they are compared with the laser's measurements.
        """
        numbers = np.arange(len(self.poses))
        wheels = self.path.at(
            numbers + np.interp(numbers, self.poses_before, self.taken_at - self.poses_before)
        )
        known, last = np.unique(self.poses_before[::-1], return_index=True)
        # The difference between odometry and scans is spread in proportion to the motion, plus a
        # little for each line, also where the robot stands.
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
