"""Loop closures: key scans that show the same place as much older ones.

Key scans and their estimated poses enter; relative poses between key scans leave. Each was checked:
the scans overlap, no beam of the one passes through what the other saw, no other place in the
window fits as well, and enough closures of the same stretch agree with each other.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, wrap_angle
from lrf3d.slam.correlation import AMBIGUOUS, correlate
from lrf3d.slam.frames import between, compose, turned
from lrf3d.slam.graph_distance import DistanceGraph
from lrf3d.slam.pose_graph import Edges
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.surface import wall_map
from lrf3d.slam.violation import Key, contradicted

LEAST_WAY = 6.0
"""Two key scans are worth closing a loop if the way between them over the graph is longer [m]."""

NEAR = 4.0
"""Key scans up to this far apart [m], and their uncertainty more, may show the same walls."""

DRIFT, DRIFT_TURN = 0.01, 0.0015
"""How much farther [m], [rad] a robot may be off after each metre: twice what is usual."""

LEAST_WINDOW, MOST_WINDOW = 0.3, 4.0
"""Bounds of half the side of the window [m] that is searched."""

LOST_WAY = 10.0
"""Way [m] over which a robot drifts as far as in one scan that matches nothing: 0.1 m."""

FARTHEST_WAY = 0.5 * MOST_WINDOW / DRIFT
"""Ways over the graph are found up to this length [m]; beyond it the window is the largest."""

LEAST_WINDOW_TURN, MOST_WINDOW_TURN = 0.06, 0.45
"""Bounds of half its angle [rad]."""

MOST_TRIES = 2
"""Old key scans that are tried for each new one."""

OTHER_PLACE = 3.0
"""The next one that is tried lies farther from the last than this along the way [m]."""

LEAST_POINTS = 10
"""Points that a surface must have."""

CLOSURE_WAY = 0.5
"""What a closure counts as in the way over the graph [m]: the drift that it leaves."""

REACH = 0.3
"""How far off walls are looked for [m] when a closure is matched."""

AGREEING = 3
"""Closures that have to agree with each other before any of them is accepted."""

STRETCH = 12.0
"""Closures within this way [m] of each other, at both ends, are compared."""

DEVIATIONS = 3.5
"""Two closures agree if the loop that they form closes within this many deviations."""

CLOSURE_SHARE = 0.3
"""Share of the matching's information that a closure's edge counts with: old and new map were drawn
by the same drifting front end, and both are bent a little."""

FLOOR = np.diag([1.0, 1.0, 10.0])
"""Information that a closure has in any direction: 1 m and 0.3 rad, for it lay in the window."""


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """An old key scan and a new one that show the same place.

    Args:
        old: Number of the old key scan.
        new: Number of the new one.
        relative: (3,) pose of the new one as seen from the old one.
        information: (3, 3) its inverse covariance, along the axes of the old one.
    """

    old: int
    new: int
    relative: Float
    information: Float


class LoopCloser:
    """Finds closures for new key scans, and keeps them until enough agree."""

    def __init__(self, resolution: Resolution = DENSE) -> None:
        self.keys: list[Key] = []
        self.resolution = resolution
        self._drift = DRIFT * resolution.drift
        self._drift_turn = DRIFT_TURN * resolution.drift
        self.accepted: list[Closure] = []
        self._rejected: list[Closure] = []
        # Those of the last stretch: not accepted yet, and accepted.
        self._pending: list[Closure] = []
        self._recent: list[Closure] = []
        self.graph = DistanceGraph()
        # How far the robot had driven at each key scan [m], and by now.
        self.ways = np.empty(0)
        self.way = 0.0
        # Key scans that follow each other without a known place between them are of one stretch.
        self._stretches = np.empty(0, np.int64)

    @property
    def unconfirmed(self) -> list[Closure]:
        """Closures that were found and are rejected: too few others agree with them."""
        return self._rejected + self._pending

    def drive(self, step: Float, lost: int) -> float:
        """Note how the robot has moved; returns the way [m] over which it drifts as far.

        Args:
            step: (3,) pose now as seen from where it was.
            lost: How many scans on the way matched nothing.
        """
        # A turn in place lets the robot drift like a way of the length of its lever.
        way = float(np.hypot(step[0], step[1]) + abs(step[2])) + LOST_WAY * lost
        self.way += way
        return way

    def add_key(
        self, key: Key, reference: int = -1, way: float = 0.0, *, hung: bool = False
    ) -> None:
        """Take in the next key scan.

        Args:
            key: The key scan.
            reference: Number of the key scan that its pose is known from; -1 for the first.
            way: How far the robot has driven from it [m].
            hung: Whether a scan in a known place stands between the two.
        """
        new, stretch = len(self.keys), 0
        self.graph.add()
        if new:
            self.graph.link(reference, new, way)
            stretch = int(self._stretches[-1]) + hung
        self.ways = np.append(self.ways, self.way)
        self._stretches = np.append(self._stretches, stretch)
        self.keys.append(key)

    def ways_from_newest(self, limit: float) -> Float:
        """The ways (k,) [m] over the graph from the newest key scan, +inf beyond a limit [m]."""
        every = np.ones(len(self.keys), np.bool_)
        return self.graph.distances(len(self.keys) - 1, limit, every)

    def search(self, poses: Float) -> list[Closure]:
        """Closures of the newest key scan that are accepted now, and older ones that it confirms.

        Args:
            poses: (k, 3) estimated poses of all key scans.
        """
        new = len(self.keys) - 1
        found = self._found(new, poses)
        # What lies farther back is beside no closure to come.
        oldest = self.ways[new] - STRETCH
        self._rejected += [c for c in self._pending if self.ways[c.new] <= oldest]
        self._pending = [c for c in self._pending if self.ways[c.new] > oldest]
        self._recent = [c for c in self._recent if self.ways[c.new] > oldest]
        accepted: list[Closure] = []
        for closure in found:
            self._pending.append(closure)
            accepted += self._confirmed(closure)
        for closure in accepted:
            self.graph.link(closure.old, closure.new, CLOSURE_WAY)
        self.accepted += accepted
        self._recent += accepted
        return accepted

    def _found(self, new: int, poses: Float) -> list[Closure]:
        """Closures of a key scan with old ones near it."""
        key = self.keys[new]
        if len(key.surface) < LEAST_POINTS:
            return []
        apart = np.hypot(poses[:, 0] - poses[new, 0], poses[:, 1] - poses[new, 1])
        fits = (self.ways < self.ways[new] - LEAST_WAY) & (apart < NEAR + 0.5 * MOST_WINDOW)
        if not fits.any():
            return []
        ways = self.graph.distances(new, FARTHEST_WAY, fits)
        window = np.clip(2.0 * self._drift * ways + 0.1, LEAST_WINDOW, MOST_WINDOW)
        fits &= (ways > LEAST_WAY) & (apart < NEAR + 0.5 * window)
        closures: list[Closure] = []
        for _ in range(MOST_TRIES):
            candidates = np.flatnonzero(fits)
            if not len(candidates):
                break
            old = int(candidates[apart[candidates].argmin()])
            turn = float(
                np.clip(2.0 * self._drift_turn * ways[old], LEAST_WINDOW_TURN, MOST_WINDOW_TURN)
            )
            closure = self._matched(old, new, poses, float(window[old]), turn)
            if closure is not None:
                closures.append(closure)
                break
            # The next try is at another place than this one.
            fits &= np.abs(self.ways - self.ways[old]) > OTHER_PLACE
        return closures

    def _matched(
        self, old: int, new: int, poses: Float, window: float, turn: float
    ) -> Closure | None:
        """The closure between two key scans, if they show the same place."""
        key = self.keys[new]
        around = self.resolution.submap_of(old, new)
        near = [k for k in around if self._stretches[k] == self._stretches[old]]
        origin = self.keys[old].pose
        # Over a stretch so short the front end's poses are better than those of the graph.
        locals_ = between(origin, np.array([self.keys[k].pose for k in near]))
        grid = wall_map(
            ((self.keys[k].walls, pose) for k, pose in zip(near, locals_, strict=True)),
            self.resolution.along,
        )
        if grid is None or len(grid.surface) < LEAST_POINTS:
            return None
        guess = between(poses[old], poses[new])
        matches = correlate(
            key.surface,
            grid,
            guess,
            window=window,
            turn=turn,
            reach=REACH,
            sigma=self.resolution.sigma,
        )
        if not matches or matches[0].explained < self.resolution.overlap:
            return None
        best = matches[0]
        if any(match.explained > AMBIGUOUS * best.explained for match in matches[1:]):
            return None
        relatives = between(locals_, best.pose)
        if contradicted([self.keys[k] for k in near], key, relatives):
            return None
        information = CLOSURE_SHARE * best.information
        relative = np.array([*best.pose[:2], wrap_angle(best.pose[2])])
        return Closure(old, new, relative, information + FLOOR)

    def _confirmed(self, newest: Closure) -> list[Closure]:
        """The pending closures that are accepted, now that another one has come."""
        around = [other for other in self._pending if self._beside(other, newest)]
        agreeing = [other for other in around if self._agree(other, newest)]
        known = [other for other in self._recent if self._beside(other, newest)]
        backed = sum(self._agree(other, newest) for other in known)
        together = len(agreeing) + backed
        # Of sets that contradict each other the larger one is accepted.
        against = len(around) - len(agreeing) + len(known) - backed
        if together < AGREEING or together <= against:
            return []
        kept = {id(closure) for closure in agreeing}
        self._pending = [other for other in self._pending if id(other) not in kept]
        return agreeing

    def _beside(self, first: Closure, second: Closure) -> bool:
        """Whether two closures join the same two stretches of the way."""
        ways = self.ways
        return bool(
            abs(ways[first.new] - ways[second.new]) < STRETCH
            and abs(ways[first.old] - ways[second.old]) < STRETCH
        )

    def _agree(self, first: Closure, second: Closure) -> bool:
        """Whether the loop over two closures and the ways between their ends closes."""
        if first is second:
            return True
        old = between(self.keys[first.old].pose, self.keys[second.old].pose)
        new = between(self.keys[first.new].pose, self.keys[second.new].pose)
        error = between(compose(first.relative, new), compose(old, second.relative))
        way = abs(self.ways[first.old] - self.ways[second.old])
        way += abs(self.ways[first.new] - self.ways[second.new])
        spread = np.array(
            [0.05 + self._drift * way, 0.05 + self._drift * way, 0.015 + self._drift_turn * way]
        )
        lever = np.hypot(old[0], old[1]) * 0.015
        covariance = np.diag(spread**2 + np.array([lever, lever, 0.0]) ** 2)
        for closure in (first, second):
            own = np.asarray(np.linalg.inv(closure.information), dtype=np.float64)
            covariance = covariance + turned(own, -float(second.relative[2]))
        square = float(error @ np.linalg.solve(covariance, error))
        return square < DEVIATIONS**2


def closure_edges(closures: list[Closure]) -> Edges:
    """Closures as edges of the pose graph."""
    return Edges(
        np.array([closure.old for closure in closures]),
        np.array([closure.new for closure in closures]),
        np.array([closure.relative for closure in closures]),
        np.array([closure.information for closure in closures]),
        np.ones(len(closures), np.bool_),
        np.repeat(FLOOR[None], len(closures), axis=0),
    )
