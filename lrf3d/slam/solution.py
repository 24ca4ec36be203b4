"""SolvedLog: the poses of a recorded drive, with its warnings and figures, and the drive as a run.

The scans of a log and their poses enter; a `Run` leaves, whose world is the map of the drive.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.interrupts import Progress, check, silent
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Bool, Float, lengths, usual_step
from lrf3d.geometry.pose import Pose, compose
from lrf3d.laser import LaserRangeFinder, LaserScan, doubtful_ranges
from lrf3d.laser.range_finder import CENTRE
from lrf3d.laser.unrolling import together, unrolled
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.matching.key_scans import Key, Moment
from lrf3d.recordings import LaserLog
from lrf3d.recordings.log import on_one_fan
from lrf3d.recordings.repair.mirror import MIRROR
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.repairs import figures_of
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.estimated_trajectory import NO_COVARIANCES, NO_POSES, NO_SCANS
from lrf3d.simulation.run import Run, is_snapshot
from lrf3d.slam import Slam
from lrf3d.slam.checks import SelfCheck, doubtful_mount, leaps
from lrf3d.slam.closures import Refusal
from lrf3d.slam.lifts import lifts
from lrf3d.slam.places.joining import Joined
from lrf3d.world import World

# Half axis [m] of the 95 % ellipse of a position from which the drive is reported as uncertain. In
# a street the error along the walls grows with each scan.
MOST_UNSURE = 0.4

# The same for drives with odometry, as a share of their extent, if that is more: an error this
# large bends the map by 6°. Drives that are right reach 0.03; one that was bent by 20°, without
# scans that contradict each other, reached 0.14.
BENT_SHARE = 0.1

# Distance [m] along bare walls, in total, from which a drive by the laser alone is reported: such
# walls do not show how far the robot moved.
MOST_UNSEEN = 1.0

# Key scans whose covariances are kept, at most: each takes a step over the whole pose graph.
MOST_COVARIANCES = 128

# Time [s] between two drives in their joint run.
PAUSE = 1.0


class LiftedParts(NamedTuple):
    """The parts of a drive whose robot was lifted: scans that were placed, their poses (k, 3).

    ``placed`` (n,) says which odometry lines belong to them, and each has one of the ``slams``.
    """

    recording: Recording
    poses: Float
    words: list[str]
    placed: Bool
    slams: list[Slam]


@dataclass(frozen=True, eq=False, repr=False)
class SolvedLog:
    """The solution of a log: poses of the robot x, y [m], theta [rad] by the clock of its laser.

    ``poses`` (k, 3) are those at the scans (k,) of the recording, which reports what was repaired.
    The drive was solved ``passes`` times: more than once if its wheels' errors turned out to
    differ from their first estimate. If it was joined with an earlier drive, all poses are in the
    frame of that one, and the run is that of both. Of a drive in ``parts``, the last one is joined
    with the others in this way.
    """

    recording: Recording
    slam: Slam
    poses: Float
    passes: int
    joined: Joined | None = None
    parts: LiftedParts | None = None

    def __repr__(self) -> str:
        return f"SolvedLog({self.log.name}, {self.slam}, {len(self.line_poses)} odometry lines)"

    @property
    def log(self) -> LaserLog:
        """The log as it was read, with the scans of several lasers at one moment as one."""
        return self.recording.log

    @property
    def scans(self) -> list[LaserScan]:
        """The scans (k,) in the order in which they were taken, each once, and repaired."""
        return self.recording.scans

    @cached_property
    def line_poses(self) -> Float:
        """Poses (n, 3) of the robot at the odometry lines, as logged."""
        recording, poses, *_ = self.parts or (self.recording, self.poses)
        return recording.line_poses(poses)

    @cached_property
    def check(self) -> SelfCheck:
        """How the scans agree where the robot came by again."""
        return self.slam.self_check() if self.joined is None else self.joined.check

    @property
    def warnings(self) -> list[str]:
        """What users should know of the solution, a sentence each."""
        mirrored = [MIRROR.sentence(True)] * (MIRROR.name in self.recording.found)
        mount = doubtful_mount(self.log.scans, mirrored=False)
        doubts = [*([mount] if mount else []), *self._put_down(), *self._unseen()]
        doubts += self.check.sentences()
        return [*mirrored, *doubts, *self.tried]

    @cached_property
    def lifted(self) -> list[int]:
        """The numbers of the scans at which the robot had been lifted and put down."""
        shares = np.array([scan.explained for scan in self.slam.tracked])
        return lifts(self.slam.converter, self.scans, self.poses, shares)

    def _put_down(self) -> list[str]:
        """Where the robot was lifted and put down, and what became of the parts, in sentences."""
        if self.parts is not None:
            return self.parts.words
        advice = "what follows is misplaced: solve both parts on their own and join them by --on"
        return [f"{nothing_in_common(number)}; {advice}" for number in self.lifted]

    def _unseen(self) -> list[str]:
        """What the scans do not show of the drive, in a sentence."""
        if self.log.placed:
            return self._unsure()
        weak = np.array([0, *(scan.weak for scan in self.slam.tracked[1:]), 0], dtype=np.int64)
        steps = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        if weak.sum() * steps.mean() < MOST_UNSEEN:
            return self._unsure()
        starts, ends = np.flatnonzero(np.diff(weak)).reshape(-1, 2).T
        longest = int((ends - starts).argmax())
        where = f"{counted(int(weak.sum()), 'scan')}, as {starts[longest] + 1} to {ends[longest]}"
        return [f"{where}, see bare walls and not how far the robot moved: the map may be wrong"]

    def _unsure(self) -> list[str]:
        """Where the position is least certain, in a sentence."""
        if self.joined is not None or (estimate := self.run.estimate) is None:
            return []
        axes = np.linalg.norm(estimate.ellipses, 2, axis=(1, 2))
        extent = float(np.hypot(*np.ptp(self.poses[:, :2], axis=0)))
        if (most := axes.max()) < max(MOST_UNSURE, BENT_SHARE * extent * self.log.placed):
            return []
        where = f"the position at scan {estimate.known_scans[axes.argmax()]}"
        if self.log.placed:
            advice = "the map may be bent; --close A:B joins scans that show one place"
            return [f"{where} is known to {most:.2f} m in {extent:.0f} m: {advice}"]
        return [f"by the laser alone {where} is known to {most:.2f} m: the map may be stretched"]

    @property
    def refused(self) -> list[Refusal]:
        """The loop closures that were refused in the worst stretch of the self-check."""
        first, last = self.check.worst_scans
        scans = [key.scan for key in self.key_scans[0]]
        before = len(scans) - len(self.slam.closer.keys)
        shifted = [
            each._replace(old=before + each.old, new=before + each.new)
            for each in self.slam.closer.refusals
        ]
        return [
            each for each in shifted
            if first <= scans[each.old] <= last or first <= scans[each.new] <= last
        ]  # fmt: skip

    @property
    def key_scans(self) -> tuple[list[Key], Float]:
        """The key scans (k,) of all drives, and their poses (k, 3)."""
        if self.joined is not None:
            return self.joined.key_scans, self.joined.key_poses
        return self.slam.closer.keys, self.slam.key_poses

    @property
    def tried(self) -> list[str]:
        """What was tried where the map contradicts itself, in a sentence; else an empty list."""
        if not self.refused or not self.check.sentences():
            return []
        first, last = self.check.worst_scans
        reasons = Counter(each.why for each in self.refused)
        why = ", ".join(f"{count} as {reason}" for reason, count in reasons.most_common())
        refused = counted(len(self.refused), "loop closure")
        tried = f"scans {first} to {last}: {refused} refused: {why}"
        return [f"{tried}; --close A:B and --not A:B say what is known of two scans"]

    @property
    def odometry(self) -> str:
        """Where the odometry comes from, in words."""
        if not self.log.placed:
            return "none: by the laser alone"
        return "the poses of the scans" if self.log.wheels is None else "ODOM lines"

    @property
    def moments(self) -> list[Moment]:
        """The moments (k,) of the drive, each with the scans of all lasers.

        The scans of a moment stay merged into one if a laser turns on its robot, or clockwise.
        """
        mounts = {tuple(scan.mount for scan in moment) for moment in self.log.parts}
        if len(mounts) != 1 or MIRROR.name in self.recording.found:
            return [(scan,) for scan in self.scans]
        taken = dict(zip([scan.time for scan in self.log.scans], self.log.parts, strict=True))
        return [taken[scan.time] for scan in self.scans]

    @property
    def mount(self) -> Pose:
        """The pose of the laser on the robot."""
        mount = self.scans[0].mount
        return Pose(self.log.odometry.laser_offset, 0.0, 0.0) if mount == CENTRE else mount

    @cached_property
    def run(self) -> Run:
        """The drive as a run, in the walls that its key scans show."""
        slam = self.slam
        keys = slam.key_scans
        mount = self.mount
        poses = compose(self.poses, np.array(mount))
        poses[:, 2] = np.unwrap(poses[:, 2])
        if self.joined is not None:
            return joint_run(self.joined, slam, self.moments, poses, self.log.name)
        chosen = np.unique(np.linspace(0, len(keys) - 1, MOST_COVARIANCES).astype(np.int64))
        wheels = NO_POSES
        if self.log.placed:
            driven = self.recording.path.at(self.recording.taken_at)
            wheels = compose(driven, np.array(mount))
        estimate = slam.estimate(poses, keys[chosen], slam.covariances(chosen), wheels)
        maps = maps_of(self.scans, poses, keys.tolist(), LineMapper())
        return run_of(self.log.name, self.moments, poses, maps, estimate, self.log.path)

    @property
    def placed_lines(self) -> tuple[Float, Float]:
        """Times (n,) [s] of the odometry lines whose scans were placed, and poses (n, 3)."""
        lines = slice(None) if self.parts is None else self.parts.placed
        return self.log.odometry.times[lines], self.line_poses[lines]

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        line_map = self.run.map
        slams = [self.slam] if self.parts is None else self.parts.slams
        tracked = [scan for each in slams for scan in each.tracked[1:]]
        keys = self.key_scans[0]
        errors = "turn_share", "turn_rad_per_m", "distance_share"
        steps = np.hypot(*np.diff(self.run.trajectory.poses[:, :2], axis=0).T)
        # The leap to each part, or from one drive to the next, is no part of the path.
        from_end = np.cumsum([len(each.tracked) for each in slams[::-1]])
        steps[-from_end[from_end <= len(steps)]] = 0.0
        earlier = slice(-from_end[-1])  # The scans of earlier drives may have leaps, too.
        steps[earlier][leaps(steps)[earlier]] = 0.0
        return {
            "name": self.log.name,
            "log": {
                **self.log.counts,
                "odometry_lines": len(self.line_poses),
                "odometry": self.odometry,
                **figures_of(self.recording),
            },
            "map": {"segments": len(line_map), "objects": line_map.object_count},
            "wheels": {
                "lag_lines": float(self.recording.lags.mean()),
                **dict(zip(errors, self.slam.wheels.biases.tolist(), strict=True)),
                "solved_times": self.passes,
            },
            "slam": {
                "length_m": float(steps.sum()),
                "key_scans": sum(len(each.key_scans) for each in slams),
                "loop_closures": sum(len(each.closures) for each in slams),
                "loop_closures_dropped": sum(len(each.closer.unconfirmed) for each in slams),
                "scans_by_odometry_alone": sum(not scan.matched for scan in tracked),
                "scans_with_a_weak_direction": sum(scan.weak for scan in tracked),
            },
            "self_check": {"passed": self.check.passed, **self.check._asdict()},
            "refused": [
                {"scans": [keys[each.old].scan, keys[each.new].scan], "why": each.why}
                for each in self.refused * bool(self.tried)
            ],
            # Of a drive in parts, warnings say where each was found.
            "joined": self.joined.summary() if self.joined and not self.parts else None,
        }


def nothing_in_common(number: int) -> str:
    """What happened before a scan at which a robot had been put down, in words."""
    return (
        f"scans {number - 1} and {number} show nothing in common: the robot was lifted or pushed"
        " elsewhere, or the log was cut"
    )


def maps_of(
    scans: Sequence[LaserScan],
    poses: Float,
    keys: Sequence[int],
    mapper: LineMapper,
    *,
    snapshots: int | None = None,
    progress: Progress = silent,
) -> dict[int, LineMap]:
    """Map snapshots of the key scans, by the number of the scan (k,) after which each was taken.

    Progress is called with the number of mapped key scans, and of all.
    """
    maps: dict[int, LineMap] = {}
    for done, number in enumerate(keys, 1):
        mapper.update(unrolled(replace(scans[number], pose=Pose(*poses[number].tolist()))))
        if is_snapshot(done - 1, len(keys), snapshots):
            maps[number] = mapper.map
        progress(done, len(keys))
        check()
    # The last map is that of all scans: those after the last key scan show nothing new.
    maps[len(scans) - 1] = maps.pop(keys[-1])
    return maps


def run_of(
    name: str,
    moments: Sequence[Moment],
    poses: Float,
    maps: dict[int, LineMap],
    estimate: EstimatedTrajectory | None = None,
    path: str = "",
) -> Run:
    """The scans of moments (k,) as a run, whose world is the last of the maps.

    The poses (k, 3) are those of the laser, or of the robot if there are several. Errors name the
    path of the log.
    """
    fans = [list(map(unrolled, own)) for own in zip(*moments, strict=True)]
    line_map = maps[len(moments) - 1]
    solid = lengths(line_map.segments) > 0.0
    if not solid.any():
        reason = (
            doubtful_ranges([scan for own in fans for scan in own])
            or "expected walls within the laser's range"
        )
        where = f"{path or name}: no wall in {counted(len(moments), 'scan')}"
        raise InputError(f"{where}, so that there is no map; {reason}")
    (lrf, ranges), *others = (_laser_of(own, mounted=len(fans) > 1) for own in fans)
    ranges = np.hstack([ranges, *(each for _, each in others)])
    # Stamps count from 1970; the clock of a run begins with it.
    times = rising(np.array([scan.time for scan in fans[0]]))
    return Run(
        World(line_map.segments[solid], line_map.objects[solid], name=name),
        lrf,
        Trajectory(times - times[0], poses),
        ranges,
        ranges,
        np.full(ranges.shape, -1),
        tuple(maps),
        tuple(maps.values()),
        estimate=estimate,
        further=tuple(each for each, _ in others),
    )


def _laser_of(scans: Sequence[LaserScan], *, mounted: bool) -> tuple[LaserRangeFinder, Float]:
    """The range finder that took scans (k,), and their ranges (k, beams)."""
    angles, ranges = on_one_fan(scans)
    begin, end = angles[[0, -1]].tolist()
    nearest = min(s.range_min for s in scans)
    farthest = max(s.range_max for s in scans)
    if farthest == np.inf:
        # Some drivers give no limit: it is the usual one, or what was measured beyond it.
        usual = LaserRangeFinder().range_max
        farthest = float(ranges.max(initial=usual, where=np.isfinite(ranges)))
    lrf = LaserRangeFinder(begin, end, len(angles), nearest, farthest)
    if mounted:
        name = re.sub(r"\W", "_", scans[0].laser, flags=re.ASCII)
        lrf = replace(lrf, mount=scans[0].mount, name=name if name[:1].isalpha() else f"l{name}")
    return lrf, ranges


def joint_run(both: Joined, slam: Slam, moments: Sequence[Moment], poses: Float, name: str) -> Run:
    """Two drives as one run: the first, and after it the scans of moments (k,) of the second.

    Its poses (k, 3) are those that joining has found. If the drives have different lasers, or
    mount them differently, the scans of each moment are merged into one.
    """
    first = both.run
    before = both.first_poses
    if len(first.lasers) == 1:
        before = compose(before, np.array(first.lrf.mount))
    whole = np.vstack([before, poses])
    whole[:, 2] = np.unwrap(whole[:, 2])
    later = first.trajectory.times[-1] + PAUSE - moments[0][0].time
    shown = [*map(first.scans_at, range(len(first)))]
    shown += [tuple(replace(scan, time=scan.time + later) for scan in each) for each in moments]
    scans = [*map(together, shown)]
    one, other = (np.array([each.mount for each in own]) for own in (first.lasers, moments[0]))
    if one.shape != other.shape or not np.allclose(one, other):
        shown = [(scan,) for scan in scans]
    keys = [*both.keys.tolist(), *(len(first) + slam.key_scans).tolist()]
    earlier = first.estimate or EstimatedTrajectory(before)
    own = slam.estimate(poses, NO_SCANS, NO_COVARIANCES)
    count = len(before)
    dropped = np.vstack([earlier.dropped_closures, count + own.dropped_closures])
    ties = both.ties + np.array([0, count])
    closures = np.vstack([earlier.closures, count + own.closures, ties])
    estimate = EstimatedTrajectory(whole, closures=closures, dropped_closures=dropped)
    return run_of(name, shown, whole, maps_of(scans, whole, keys, LineMapper()), estimate)


def rising(stamps: Float) -> Float:
    """Stamps (k,) [s] made to rise: those that do not are interpolated between their neighbours."""
    latest = np.maximum.accumulate(stamps)
    knots = np.flatnonzero(np.concatenate([[True], np.diff(latest) > 0.0]))
    usual = usual_step(stamps) or 1.0
    number = np.arange(len(stamps), dtype=np.float64)
    times = np.interp(number, knots, latest[knots])
    times[knots[-1] :] = latest[knots[-1]] + usual * (number[knots[-1] :] - knots[-1])
    return np.asarray(times)
