"""Slam: poses and map from scans and odometry increments alone.

The poses are current after every scan; on a long drive the map follows within seconds.

A scan and the odometry increment since the last one enter. The front end places the scan. Every
half metre or half radian, unless the place is known, a scan becomes a key scan: a vertex of the
pose graph, for which loop closures are searched. Where a loop closes, the graph is optimised, the
poses move, and the map is drawn again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lrf3d.base.errors import InputError, shown
from lrf3d.geometry.lines import Float, Int, Records, is_finite, whole_number
from lrf3d.geometry.pose import Pose, as_pose, bent, between, compose, turned
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.laser.range_finder import CENTRE, lasers_of
from lrf3d.laser.unrolling import unrolled
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.matching.key_scans import Key, Moment, ScanConverter
from lrf3d.matching.scan_matching import SIGMA
from lrf3d.robot import EstimatedTrajectory
from lrf3d.robot.estimated_trajectory import NO_POSES
from lrf3d.slam.checks import SelfCheck, self_check
from lrf3d.slam.closures import MATCHING_SHARE, Closure, LoopCloser, closure_edges
from lrf3d.slam.front_end import KEY_DISTANCE, FrontEnd, Tracked, refined
from lrf3d.slam.motion import Wheels
from lrf3d.slam.pose_graph import (
    EDGE,
    edge_errors,
    edges_of,
    optimised,
    pose_covariances,
    variance_factor,
)
from lrf3d.slam.revisits import Anchor, revisit

# Key scans that may be mapped again for each new scan, on average: mapping them takes as long as
# tracking the robot. On a long drive the map lags behind the poses by some seconds.
REDRAWN_PER_SCAN = 2

# Longest step of the odometry [m], and largest turn [rad]: no robot moves as far between scans.
FARTHEST_STEP = 1000.0

# Error of a closure [m] up to which the graph is not optimised, and motion of a key scan [m] up to
# which the map is not drawn again. In an office that saves a tenth of the time.
NEGLIGIBLE = 0.02


class Tracker:
    """Places scans one after another, in a frame that drifts: closes no loops, draws no map."""

    def __init__(
        self,
        lasers: tuple[LaserRangeFinder, ...] = (),
        start: Pose = CENTRE,
        laser_offset: float = 0.0,
        key_distance: float = KEY_DISTANCE,
        wheels: Wheels | None = None,
    ) -> None:
        self._lasers = lasers
        self._time: float | None = None
        self.converter = ScanConverter(laser_offset)
        self.front = FrontEnd(start, key_distance, wheels)
        # How the front end placed each scan, in its own drifting frame.
        self.tracked: list[Tracked] = []

    def track(
        self, scan: object, odometry: Sequence[float] | Float | None
    ) -> tuple[Moment, Key, Key | None]:
        """Place the next scan; returns it, checked and converted, and the key scan it becomes."""
        scans, increment, since = self._checked(scan, odometry)
        candidate = self.converter.candidate(scans, len(self.tracked))
        self.tracked.append(self.front.track(candidate, increment, since))
        key = self.front.add_key(candidate) if self.front.key_due() else None
        return scans, candidate, key

    def _checked(
        self, scan: object, odometry: Sequence[float] | Float | None
    ) -> tuple[Moment, Float | None, float]:
        """Check the scans and unroll them; return also the increment, and the time since the last.

        Without stamps, scans are taken to come once a second.
        """
        scans = self._checked_scans(scan)
        increment = None if odometry is None else _checked_increment(odometry)
        time = scans[0].time
        since = 0.0 if self._time is None else time - self._time
        self._time = time
        rate = np.zeros(3) if increment is None or since <= 0.0 else increment / since
        scans = tuple(
            unrolled(each, each.duration * rate if each.motion is None else None)
            if each.time_increment
            else each
            for each in scans
        )
        return scans, increment, since if since > 0.0 else 1.0

    def _checked_scans(self, scan: object) -> Moment:
        """Check that a moment has one scan of each laser, each with all its beams."""
        scans = tuple(scan) if isinstance(scan, list | tuple) else (scan,)
        found = tuple(each for each in scans if isinstance(each, LaserScan))
        if not 0 < len(scans) == len(found):
            raise InputError(f"slam: {shown(scan)}: expected a LaserScan")
        if self._lasers and len(found) != len(self._lasers):
            raise InputError(f"slam: {len(found)} scans of {len(self._lasers)} lasers")
        for number, each in enumerate(found):
            beams = len(each.ranges)
            expected = self._lasers[number].beams if self._lasers else max(beams, 1)
            if beams != expected:
                due = f"{expected}, as its laser" if self._lasers else "at least one"
                raise InputError(f"slam: scan of {beams} beams; expected {due}")
        return found


class Slam:
    """Tracks a robot and maps its world, from scans and odometry increments alone.

    Args:
        lrf: The laser range finder, or several; if given, scans with another number of beams are
            refused.
        start: Pose of the robot at its first scan.
        laser_offset: Distance of the laser ahead of the robot's centre [m], for scans whose laser
            has no mount.
        key_distance: Distance from one key scan to the next [m].
        wheels: The wheels' errors as estimated in an earlier drive; they are copied.
        close: Pairs of scans, by number, that are known to show the same place.
        apart: Pairs of scans that are known to show different places: no loop is closed there.

    Raises:
        InputError: A number is not finite, or a distance not positive.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> drive = [(1 + 0.1 * k, 1, 0) for k in range(10)]
        >>> slam = lrf3d.Slam(start=drive[0])
        >>> steps = [(0, 0, 0), *lrf3d.odometry_increments(drive)]
        >>> for step, increment in zip(lrf3d.Simulation(room, drive), steps):
        ...     slam.update(step.scan, increment)
        >>> bool(abs(slam.pose.x - 1.9) < 0.02), len(slam.trajectory())
        (True, 10)
    """

    def __init__(
        self,
        lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None = None,
        *,
        start: Sequence[float] | Float = (0.0, 0.0, 0.0),
        laser_offset: float = 0.0,
        key_distance: float = KEY_DISTANCE,
        wheels: Wheels | None = None,
        close: Sequence[tuple[int, int]] = (),
        apart: Sequence[tuple[int, int]] = (),
    ) -> None:
        values = (laser_offset, key_distance)
        if not (is_finite(*values) and key_distance > 0.0):
            raise InputError(
                f"slam: laser_offset and key_distance are {shown(values)}; expected finite numbers,"
                " the second one positive"
            )
        lasers = () if lrf is None else lasers_of(lrf)
        self._tracker = Tracker(lasers, as_pose(start), laser_offset, key_distance, wheels)
        self.converter = self._tracker.converter
        self.tracked = self._tracker.tracked
        self.closer = LoopCloser(self._tracker.front.mixed_pixels)
        self.closer.ruled_out = [*apart]
        self._known = [*close]
        self._anchors: list[Anchor] = []
        # The pose graph: the estimated poses (k, 3) of the key scans, and the measured relative
        # poses between them.
        self.key_poses = np.empty((0, 3))
        self.edges = np.empty(0, EDGE)
        self._key_scans: list[Moment] = []
        self._redraw()

    def _redraw(self) -> None:
        """Draw the map again, from the current key poses, when it is read next."""
        self._mapper = LineMapper()
        # The poses (k, 3) of the key scans in the map, and the number of these mapped so far.
        self._map_poses = self.key_poses
        self._mapped = 0
        # The number of key scans that may be mapped again.
        self._redraw_budget = 0

    def __repr__(self) -> str:
        return (
            f"Slam({len(self.tracked)} scans, {len(self.closer.keys)} key scans,"
            f" {len(self.closer.accepted)} closures)"
        )

    def update(
        self,
        scan: LaserScan | Sequence[LaserScan],
        odometry: Sequence[float] | Float | None = None,
    ) -> None:
        """Add the next scan; the pose that it carries is ignored.

        A scan that took some time is unrolled: its beams are moved to one moment (deskewed), by
        the motion that the scan carries, or else by the odometry.

        Args:
            scan: The scan, or those of several lasers at one moment.
            odometry: Increment of the wheels since the last scan: ahead, to the left [m], turn
                [rad]; None without odometry.

        Raises:
            InputError: It is not a scan, its number of beams is 0 or not that of the range finder,
                or the odometry is not three finite numbers that a robot can have moved by.
        """
        scans, _, key = self._tracker.track(scan, odometry)
        if key is not None:
            self._add_to_graph(key, scans)
        self._update_map_poses()

    def _add_to_graph(self, key: Key, scans: Moment) -> None:
        """Attach a scan to a known place, or make it a vertex of the graph and close loops."""
        closer = self.closer
        new_stretch = False
        if self._anchors:
            last = self._anchors[-1]
            lost = self._lost()
            closer.drive(between(last.front, key.pose), lost)
            if place := revisit(closer, key, last, self.key_poses):
                self._anchors.append(place)
                return
            edge = self._edge_to_last()
            # A scan in a known place, or a lost one, ends the stretch of adjacent key scans.
            new_stretch = last.scan != closer.keys[last.key].scan or lost > 0
            self.edges = np.concatenate([self.edges, edge])
            covariance = np.linalg.inv(edge["information"][-1])
            drifted = last.drifted + closer.distance - last.driven
            closer.paths.link(last.key, len(self._key_scans), drifted, covariance)
        number = len(self._key_scans)
        self.key_poses = np.vstack([self.key_poses, self._robot])
        self._key_scans.append(scans)
        closer.add_key(key, new_stretch=new_stretch)
        self._anchors.append(Anchor(key.scan, number, np.zeros(3), key.pose, closer.distance))
        self._close_known()
        if closures := closer.search(self.key_poses):
            edges = closure_edges(closures)
            self.edges = np.concatenate([self.edges, edges])
            # A radian counts as 4 m.
            errors = np.abs(edge_errors(self.key_poses, edges)) * [1.0, 1.0, 4.0]
            if (errors > NEGLIGIBLE).any():
                self.key_poses = optimised(self.key_poses, self.edges, 1)

    def _close_known(self) -> None:
        """Close the loops that the user knows, up to the newest key scan."""
        closer = self.closer
        new = len(closer.keys) - 1
        for pair in [pair for pair in self._known if max(pair) <= closer.keys[new].scan]:
            self._known.remove(pair)
            closure = closer.known(closer.number_at(min(pair)), new, self.key_poses)
            if closure is None:
                names = ":".join(map(str, pair))
                raise InputError(
                    f"close {names}: these scans show nothing in common, or what lies between them"
                    " is no loop but a few metres"
                )
            self.edges = np.concatenate([self.edges, closure_edges([closure])])
            self.key_poses = optimised(self.key_poses, self.edges)

    def _edge_to_last(self) -> Records:
        """The edge from the key scan of the last anchor to the last scan."""
        last = self._anchors[-1]
        relative = self._since_key()
        *_, turn = relative.tolist()
        since = (scan.covariance for scan in self.tracked[last.scan + 1 :])
        covariance = sum(since, last.covariance)
        # The information is along the axes of the new pose; the edge's is along the old one's.
        wheels = turned(np.diag(1.0 / covariance.diagonal()), turn)
        information = turned(MATCHING_SHARE * self.tracked[-1].information, turn) + wheels
        return edges_of(last.key, len(self._key_scans), relative[None], information, wheels)

    def _lost(self) -> int:
        """The number of scans after the last anchor that match nothing."""
        return sum(not scan.matched for scan in self.tracked[self._anchors[-1].scan + 1 :])

    def _since_key(self) -> Float:
        """Pose (3,) of the last scan as seen from the key scan of the last anchor."""
        last = self._anchors[-1]
        return compose(last.relative, between(last.front, self.tracked[-1].pose))

    @property
    def _robot(self) -> Float:
        """Pose (3,) of the robot at the last scan."""
        if not self._anchors:
            return self._tracker.front.pose
        return compose(self.key_poses[self._anchors[-1].key], self._since_key())

    @property
    def pose(self) -> Pose:
        """Estimated pose of the robot at the last scan; before the first, the start."""
        return Pose(*self._robot.tolist())

    def covariance(self) -> Float:
        """Covariance (3, 3) of the last scan's pose, relative to the first; solves the graph."""
        poses = self.key_poses
        edges = self.edges
        if self.tracked and self.closer.keys[-1].scan < len(self.tracked) - 1:
            poses = np.vstack([poses, self._robot])
            edges = np.concatenate([edges, self._edge_to_last()])
        (newest,) = self._covariances(poses, edges, np.array([max(len(poses) - 1, 0)]))
        return np.asarray(newest)

    def covariances(self, numbers: Sequence[int] | Int) -> Float:
        """Covariances (m, 3, 3) of the poses of some key scans (m,), x, y [m], theta [rad].

        Raises:
            InputError: There is no such key scan.
        """
        most = len(self._key_scans) - 1
        checked = [whole_number(number, "key scan", least=0, most=most) for number in numbers]
        return self._covariances(self.key_poses, self.edges, np.array(checked, dtype=np.int64))

    def _covariances(self, poses: Float, edges: Records, numbers: Int) -> Float:
        """Covariances (m, 3, 3) of some poses by number (m,).

        They are scaled down where closures show smaller errors than matching assumes, never up.
        """
        deviations = [scan.deviation for scan in self.tracked if scan.matched]
        deviation = float(np.median(deviations)) / SIGMA if deviations else 1.0
        variance = min(variance_factor(poses, edges, deviation), 1.0)
        return pose_covariances(poses, edges, numbers, variance)

    @property
    def map(self) -> LineMap:
        """The map of the key scans, which is computed when it is read."""
        for number in range(self._mapped, len(self._map_poses)):
            robot = Pose(*self._map_poses[number].tolist())
            for scan in self._key_scans[number]:
                self._mapper.update(replace(scan, pose=robot @ self.converter.mount(scan)))
        self._mapped = len(self._map_poses)
        return self._mapper.map

    def _update_map_poses(self) -> None:
        """Add new key scans to the map, or draw it again where older ones have moved.

        A mapper cannot remove a scan: all are mapped again, when the budget allows it.
        """
        self._redraw_budget += REDRAWN_PER_SCAN
        mapped = self._map_poses
        moved = np.abs(self.key_poses[: len(mapped)] - mapped)[:, :2].max(initial=0.0) > NEGLIGIBLE
        if moved and self._redraw_budget >= len(mapped):
            self._redraw()
        else:
            self._map_poses = np.concatenate([mapped, self.key_poses[len(mapped) :]])

    def trajectory(self) -> Float:
        """Estimated poses (k, 3) of the robot at all scans; theta is continuous.

        They are the front end's path, bent to meet the pose graph at the anchors.
        """
        front = np.array([scan.pose for scan in self.tracked]).reshape(-1, 3)
        keys = [anchor.key for anchor in self._anchors]
        relative = np.array([anchor.relative for anchor in self._anchors]).reshape(-1, 3)
        poses = bent(front, self._anchored, compose(self.key_poses[keys], relative))
        poses[:, 2] = np.unwrap(poses[:, 2])
        return poses

    @property
    def _anchored(self) -> Int:
        """The numbers (m,) of the anchors among all scans: key scans, and scans in known places."""
        return np.array([anchor.scan for anchor in self._anchors], dtype=np.int64)

    @property
    def key_scans(self) -> Int:
        """The numbers (m,) of the key scans among all scans."""
        return np.array([key.scan for key in self.closer.keys], dtype=np.int64)

    @property
    def closures(self) -> list[Closure]:
        """The loops that were closed, by the numbers of key scans."""
        return list(self.closer.accepted)

    def estimate(
        self, poses: Float, known: Int, covariances: Float, odometry: Float = NO_POSES
    ) -> EstimatedTrajectory:
        """Poses (k, 3) of all scans, closures, and covariances (m, 3, 3) at known scans (m,)."""
        closed, dropped = (
            self.key_scans[np.array([(each.old, each.new) for each in found], np.int64)]
            .reshape(-1, 2)
            for found in (self.closer.accepted, self.closer.unconfirmed)
        )  # fmt: skip
        return EstimatedTrajectory(poses, known, covariances, closed, dropped, odometry)

    @property
    def wheels(self) -> Wheels:
        """The wheels' errors as estimated so far; ``wheels.biases`` are the systematic ones."""
        return self._tracker.front.wheels

    def finish(self) -> None:
        """Settle all closures and optimise all poses, after the last scan."""
        # A scan after the last key scan belongs to that key scan.
        last = self.closer.keys[-1].scan if self.closer.keys else 0
        self._known = [(min(pair), min(max(pair), last)) for pair in self._known]
        self._close_known()
        self.closer.settle(self.key_poses)
        self.edges = self.edges[~self.edges["may_be_wrong"]]
        if closed := [closure for closure in self.closer.accepted if not closure.certain]:
            self.edges = np.concatenate([self.edges, closure_edges(closed)])
        if len(self.edges):
            self.key_poses = optimised(self.key_poses, self.edges)
            self._redraw()

    def refined(self, scans: Sequence[LaserScan | Moment]) -> Float:
        """Match all scans (k,) again with the key scans around them; returns their poses (k, 3).

        Scans that took some time must carry their motion: here no odometry unrolls them.

        Raises:
            InputError: The number of scans is not that of the updates.
        """
        if len(scans) != len(self.tracked):
            raise InputError(
                f"slam: {len(scans)} scans to refine; expected all {len(self.tracked)}"
            )
        poses = refined(
            map(self.converter.surface, scans),
            self.trajectory(),
            self.closer.keys,
            self.key_poses,
            self._anchored,
        )
        poses[:, 2] = np.unwrap(poses[:, 2])
        return poses

    def self_check(self) -> SelfCheck:
        """Compare the key scans, at their current poses, where the robot came by again."""
        closer = self.closer
        return self_check(closer.keys, self.key_poses, closer.driven, closer.mixed_pixels.rate)


def _checked_increment(odometry: Sequence[float] | Float) -> Float:
    """Check that an increment (3,) of the odometry is one that a robot can have moved by."""
    increment = np.array(as_pose(odometry))
    if np.abs(increment).max() > FARTHEST_STEP:
        raise InputError(
            f"slam: odometry {increment.tolist()}; expected the step from the last scan, at most"
            f" {FARTHEST_STEP:g} m and rad"
        )
    return increment
