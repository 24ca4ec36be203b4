"""Front end: follows the robot from scan to scan, against the map of the last few key scans.

Key-scan candidates and odometry increments enter; poses in the drifting frame of the front end
leave. Every half metre a key scan is due: loops are closed with these, and the pose graph is made
of them.
"""

from collections import deque
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Float, Int, Records, wrap_angle
from lrf3d.pose import between, compose, turned
from lrf3d.slam.key_scans import BEHIND, Key, MixedPixels, clearest, evidence, views_of
from lrf3d.slam.motion import Coasting, Prediction, Wheels, size_of
from lrf3d.slam.scan_matching import PRIOR_SCALE, Match, match_scan
from lrf3d.slam.search import field_of, search
from lrf3d.slam.surface import SURFACE, SurfaceGrid, moved, thinned, wall_map

KEY_DISTANCE, KEY_TURN = 0.5, 0.5
"""Distance [m] or turn [rad] to the next key scan. Errors hardly change from 0.4 to 0.6 m."""

LOCAL_KEYS = 8
"""Key scans that a scan is matched with: more cost time, fewer let the robot drift."""

SLIPPED = 3.0
"""Standard deviations of a match from the prediction beyond which the places around are searched: a
slip turns the robot, which walls show, and moves it aside, which they may not."""

RARE = 3.0
"""Log odds against a slip: one step in twenty is off by more than the wheels' noise."""

BROKEN, USUAL_HITS = 0.25, 0.98
"""Share of the usual number of hits below which a scan is broken: it fits in many places, so it is
not searched, and is no key scan. The second is the weight of earlier scans in the running mean."""

TURN, ENOUGH_TURNED = np.pi / 3.0, 40
"""Standard deviation of a window of all turns [rad], and least points of a scan to search it."""

SURE, LEAST_TURNED = 2.0, 0.6
"""Least evidence for a place that is found in any turn, and least share of the scan explained."""

ADJACENT = 4
"""Key scans before a new one that show the rate of mixed pixels."""

LEAST_EXPLAINED = 0.1
"""Minimum inlier ratio to accept a match."""

LEAST_POINTS = 8
"""Least points of a scan to search it: among trees and cars there are a dozen."""

ENOUGH, RECENT = 150, 32
"""Points that show walls well; a key scan of fewer adds some of the last few scans."""

WATCHED, THROUGH = 12, 2
"""A point belongs to a dynamic obstacle if beams of at least the second number of the last key
scans, out of the first, passed it."""

WEAK = 2500.0
"""Information [1/m²] below which scans leave a direction to the odometry: 0.02 m."""

REFINED_PRIOR = np.diag([2500.0, 2500.0, 10000.0])
"""Information of a pose that is refined: 0.02 m and 0.01 rad."""

REFINED_ITERATIONS = 8
"""Most Gauss-Newton steps of a refinement."""

REFINED_WITH = 12
"""Key scans that a scan is refined with. More take longer, and move the mean error by some
thousandths."""

LEAST_REFINED = 0.3
"""Minimum inlier ratio to move a scan in refinement."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """One scan as the front end placed it, in its drifting frame.

    The information (3, 3) of matching is along the axes of the pose (3,); the covariance (3, 3) is
    that of the odometry since the scan before. The deviation is the RMS distance [m] of the points
    from the walls.
    """

    pose: Float
    information: Float
    matched: bool
    deviation: float
    covariance: Float

    @property
    def weak(self) -> bool:
        """Whether matching leaves a direction to the odometry, as along a corridor."""
        return weakest_direction(self.information)[1] < WEAK


def weakest_direction(information: Float) -> tuple[Float, float]:
    """The direction (2,) that information (3, 3) fixes worst, and how well [1/m²].

    The heading is marginalised.
    """
    coupling, turn = information[:2, 2], max(float(information[2, 2]), 1e-9)
    place = information[:2, :2] - np.outer(coupling, coupling) / turn
    (weakest, _), directions = np.linalg.eigh(place)
    return directions[:, 0], float(max(weakest, 0.0))


class FrontEnd:
    """Follows the robot by matching scans with a local map."""

    def __init__(self, *, key_distance: float = KEY_DISTANCE, wheels: Wheels | None = None) -> None:
        self.key_distance = key_distance
        self.pose = np.zeros(3)
        self.wheels = Wheels() if wheels is None else deepcopy(wheels)
        self._coasting = Coasting()
        self.mixed_pixels = MixedPixels()
        # The number of key scans since a scan that was lost: their relative poses are certain.
        self._certain = 0
        # Running mean of a scan's hits, and whether the last scan has far fewer.
        self._hits, self._broken = 0.0, False
        # What the last scan saw that stands still, in the frame of the robot.
        self.surface = np.empty(0, SURFACE)
        # And the last few scans since the key scan, with their poses.
        self._recent: deque[tuple[Float, Records]] = deque(maxlen=RECENT)
        self._keys: deque[Key] = deque(maxlen=WATCHED)
        self._grid: SurfaceGrid | None = None
        self._lost = False
        # The motion since the last key scan by the wheels and by scans, and what scans fixed of it.
        self._raw, self._found = np.zeros(3), np.zeros(3)
        self._turn_known = self._ahead_known = True

    def track(self, scan: Key, increment: Float | None) -> Tracked:
        """Place the next scan, by the odometry's increment (3,) if there is one."""
        coasting = self._coasting.predict()
        expected = coasting if increment is None else self.wheels.predict(increment)
        guess, covariance = compose(self.pose, expected.step), expected.covariance
        still = replace(
            scan,
            surface=self._standing(scan.surface, guess, expected),
            hits=self._standing(scan.hits, guess, expected),
        )
        self._broken = len(scan.hits) < BROKEN * self._hits
        kept = USUAL_HITS if self._hits else 0.0
        self._hits = kept * self._hits + (1.0 - kept) * len(scan.hits)
        match, accepted = self._match(still, expected)
        self.surface = still.surface
        if not accepted and (turned_to := self._in_any_turn(scan, expected)):
            match, accepted, self.surface = turned_to, True, scan.surface
        if self._lost or not accepted:
            # Around a lost scan, points of different scans do not fit together.
            self._recent.clear()
        self._lost = not accepted
        x, y, heading = match.pose if accepted else guess
        pose = np.array([x, y, wrap_angle(heading)])
        found, information = between(self.pose, pose), np.zeros((3, 3))
        if accepted:
            information = turned(match.information, -float(wrap_angle(heading)))
            self._coasting.found(coasting, found)
            if increment is not None:
                self.wheels.excess.update(expected, found)
            # Where wheels have slipped, the directions that scans do not fix are uncertain, too.
            slip = self._slip(match, expected)
            covariance = covariance * (1.0 + slip / PRIOR_SCALE**2)
        else:
            self._coasting.lost()
            self._certain = 0
            if not expected.trusted or self._passed(replace(scan, surface=self.surface), guess):
                # The wheels have slipped by an unknown step.
                covariance = covariance + np.diag(expected.window**2)
        known = accepted and increment is not None
        self._turn_known &= known
        self._ahead_known &= known and information[0, 0] > WEAK
        self._raw += 0.0 if increment is None else increment
        self._found += found
        self.pose = pose
        self._recent.append((pose, self.surface))
        return Tracked(pose, information, accepted, match.deviation, covariance)

    def _local(self) -> list[Key]:
        """The key scans of the local map."""
        return list(self._keys)[-LOCAL_KEYS:]

    def _passed(self, scan: Key, guess: Float) -> bool:
        """Whether beams of the local map pass through what a scan saw from a pose (3,)."""
        keys = self._local()
        seen_from = between(np.array([key.pose for key in keys]).reshape(-1, 3), guess)
        return bool(keys) and self.mixed_pixels.contradict(keys, scan, seen_from)

    def _match(self, scan: Key, expected: Prediction) -> tuple[Match, bool]:
        """A match with the local map, and whether it is accepted."""
        guess, surface = compose(self.pose, expected.step), scan.surface
        if self._grid is None or not len(surface):
            return Match(guess, np.zeros((3, 3)), 0.0, np.inf), False
        *_, heading = self.pose.tolist()
        prior = turned(np.asarray(np.linalg.inv(expected.uncertain)), heading)
        match = match_scan(surface, self._grid, guess, prior)
        if not np.isfinite(match.pose).all():
            return match, False
        slipped = self._slip(match, expected) > SLIPPED**2
        searched = len(surface) >= LEAST_POINTS and not self._broken
        if searched and (slipped or match.explained < expected.doubtful):
            return self._searched(scan, self._grid, match, expected)
        return match, match.explained > LEAST_EXPLAINED

    def _slip(self, match: Match, expected: Prediction) -> float:
        """Squared distance of a match from the prediction in units of the variance."""
        error = between(expected.step, between(self.pose, match.pose))
        return float(error @ np.linalg.solve(expected.uncertain, error))

    def _searched(
        self, scan: Key, grid: SurfaceGrid, match: Match, expected: Prediction
    ) -> tuple[Match, bool]:
        """The likeliest place around the prediction, and whether it is accepted.

        Wheels slip and spin, and robots are pushed, but seldom, and the farther the less: by
        Cauchy's distribution. Where a robot enters a new room, the right place explains little, and
        that of the last scan more; but only at a wrong one do beams pass through what was hit.
        """
        guess, window = compose(self.pose, expected.step), expected.window
        places, worth = self._places(scan, grid, guess, window, match)
        odds = np.array(worth)
        if expected.trusted:
            slips = between(guess, np.array([place.pose for place in places])) / window
            noise = [self._slip(place, expected) for place in places]
            odds -= np.minimum(np.log1p(noise), RARE + np.log1p((slips**2).sum(axis=1)))
        best = int(np.argmax(odds))
        return places[best], worth[best] > 0.0

    def _places(
        self, scan: Key, grid: SurfaceGrid, guess: Float, window: Float, *others: Match
    ) -> tuple[list[Match], list[float]]:
        """The places in a window of deviations (3,), and others, and the evidence for them."""
        keys = self._local()
        seen_from = np.array([key.pose for key in keys])
        found = search(scan, grid, field_of(keys, seen_from), guess, np.diag(window**2))
        places = [*found, *others]
        return places, [
            evidence(scan.hits, place.explained, between(seen_from, place.pose), keys)
            for place in places
        ]

    def _in_any_turn(self, scan: Key, expected: Prediction) -> Match | None:
        """The place that a lost scan fits clearly best, whichever way it is turned."""
        if self._grid is None or self._broken or len(scan.surface) < ENOUGH_TURNED:
            return None
        guess, window = compose(self.pose, expected.step), np.array([*expected.window[:2], TURN])
        places, worth = self._places(scan, self._grid, guess, window)
        best = clearest([place.pose for place in places], worth)
        if best is None or worth[best] < SURE or places[best].explained < LEAST_TURNED:
            return None
        return None if self._passed(scan, places[best].pose) else places[best]

    def _standing(self, points: Records, guess: Float, expected: Prediction) -> Records:
        """Those of a scan's points that no beams passed when the robot came by."""
        if len(self._keys) < THROUGH:
            return points
        # Where a guess may be off by more than `BEHIND`, nothing is known.
        x, y, turn = np.sqrt(expected.uncertain.diagonal())
        far = np.hypot(points["x"], points["y"])
        known = 3.0 * (max(x, y) + turn * far) < BEHIND
        poses = between(np.array([key.pose for key in self._keys]), guess)
        gone = known & ((views_of(points, poses, self._keys) == 2).sum(axis=0) >= THROUGH)
        # Where most is new the guess is wrong.
        return points if 2 * gone.sum() >= len(gone) else points[~gone]

    def key_due(self) -> bool:
        """Whether the robot has moved far enough since the last key scan."""
        if self._broken or not self._keys:
            return not self._keys
        length, turn = size_of(between(self._keys[-1].pose, self.pose))
        return length >= self.key_distance or turn >= KEY_TURN

    def key(self, scan: Key) -> Key:
        """The scan that was just placed, as a key scan."""
        return replace(scan, pose=self.pose, surface=self.surface, walls=self._walls())

    def _walls(self) -> Records:
        """The walls that the last scan and some scans before saw, in the frame of the last one.

        A scan of few beams alone would show single points of a wall.
        """
        count = min(ENOUGH // max(len(self.surface), 1) + 1, len(self._recent))
        chosen = np.linspace(0, len(self._recent) - 1, count + 1).astype(np.int64)[1:]
        parts = [self._recent[k] for k in chosen.tolist()]
        seen = [moved(thinned(part), between(self.pose, pose)) for pose, part in parts]
        return np.concatenate(seen)

    def add_key(self, key: Key) -> None:
        """Add the scan that was just placed to the local map, as a key scan."""
        if self._turn_known:
            self.wheels.learn(self._raw, self._found, self._ahead_known)
        self._raw, self._found = np.zeros(3), np.zeros(3)
        self._turn_known = self._ahead_known = True
        self._recent.clear()
        self.mixed_pixels.learn(list(self._keys)[len(self._keys) - self._certain :], key)
        self._certain = min(self._certain + 1, ADJACENT)
        self._keys.append(key)
        self._grid = wall_map((near.walls, near.pose) for near in self._local())


def refined(
    surfaces: Iterable[Records],
    poses: Float,
    keys: list[Key],
    key_poses: Float,
    anchored: Int,
) -> Float:
    """Poses (n, 3) of all scans, matched again with the key scans (k,) around them.

    While the robot drove, a scan was matched with the key scans before it; now all drives past a
    place show its surroundings. The key scans are those around the last of the anchored scans (m,).
    """
    refined_poses, grid, anchors = poses.copy(), None, set(anchored.tolist())
    for scan, (surface, pose) in enumerate(zip(surfaces, poses, strict=True)):
        if scan in anchors:
            apart = np.hypot(*(key_poses[:, :2] - pose[:2]).T)
            nearest = np.argsort(apart, kind="stable")[:REFINED_WITH]
            grid = wall_map((keys[k].walls, key_poses[k]) for k in nearest.tolist())
        if grid is None:
            continue
        *_, heading = pose.tolist()
        match = match_scan(surface, grid, pose, turned(REFINED_PRIOR, heading), REFINED_ITERATIONS)
        if match.explained > LEAST_REFINED:
            refined_poses[scan] = match.pose
    return refined_poses
