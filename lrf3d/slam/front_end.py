"""Front end: follows the robot from scan to scan, against the map of the last few key scans.

Surfaces and odometry increments enter; poses in the drifting frame of the front end leave, and
every half metre a key scan is due: loops are closed with these, and the pose graph is made of them.
"""

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.pose import between, compose, turned
from lrf3d.slam.prediction import Coasting, Prediction
from lrf3d.slam.scan_matching import PRIOR_SCALE, Match, match_scan
from lrf3d.slam.search import field_of, search
from lrf3d.slam.surface import SurfaceGrid, moved, thinned, wall_map
from lrf3d.slam.views import BEHIND, Key, clearest, evidence, views_of
from lrf3d.slam.violation import MixedPixels
from lrf3d.slam.wheels import Wheels

KEY_DISTANCE, KEY_TURN = 0.5, 0.5
"""A key scan is taken after this distance [m] or turn [rad]. Errors hardly change from 0.4 to
0.6 m."""

LOCAL_KEYS = 8
"""Key scans that a scan is matched with: more cost time, fewer let the robot drift."""

SLIPPED = 3.0
"""Where a match is as many deviations off from the prediction, the places around are searched: a
slip turns the robot, which walls show, and moves it aside, which they may not."""

RARE = 3.0
"""Log odds against a slip: one step in twenty is off by more than the wheels' noise."""

BROKEN, USUAL_HITS = 0.25, 0.98
"""A scan with less than this share of the hits that are usual is broken: it fits in many places, so
that none is searched, and is no key scan. The second is the weight of the scans before in the mean
of the hits, at each scan."""

TURN, ENOUGH_TURNED = np.pi / 3.0, 40
"""Deviation of a window of all turns [rad], in which a lost scan of so many points is searched."""

SURE, LEAST_TURNED = 2.0, 0.6
"""Least evidence for a place that is found in any turn, and share of the scan that it explains."""

ADJACENT = 4
"""Key scans before a new one that show how often beams pass through points at a right place."""

LEAST_EXPLAINED = 0.1
"""A match that explains a smaller share is not believed."""

LEAST_POINTS = 8
"""With fewer points than this nothing is searched: a few points fit in many places. Between trees
and cars a scan has a dozen."""

ENOUGH, RECENT = 150, 32
"""Points of a surface that show walls as they are; where a scan has fewer, a key scan takes in
those before it, out of the last few."""

WATCHED, THROUGH = 12, 2
"""A point is of a dynamic obstacle, and left out, if beams of so many of the last key scans passed
through it: the first is how many of these are compared, the second how many are enough."""

WEAK = 2500.0
"""A direction is left to the odometry where scans fix it with less information than this [1/m²]: no
better than 0.02 m."""

REFINED_PRIOR = np.diag([2500.0, 2500.0, 10000.0])
"""Information of where a scan stood before: 0.02 m and 0.01 rad."""

REFINED_ITERATIONS = 8
"""Most Gauss-Newton steps."""

REFINED_WITH = 12
"""Key scans that a scan is matched with. More take longer, and move the mean error by some
thousandths."""

LEAST_REFINED = 0.3
"""A scan that explains less than this share of its points stays where it is."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """One scan as the front end placed it, in its drifting frame.

    The information (3, 3) is that of matching, along the axes of the pose (3,); a scan that was not
    matched stands where odometry has it, whose errors have the covariance (3, 3). The deviation is
    the RMS distance [m] of its points to the walls.
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

    That is how well the place is fixed, whatever the heading is.
    """
    turn = max(float(information[2, 2]), 1e-9)
    coupling = information[:2, 2]
    place = information[:2, :2] - np.outer(coupling, coupling) / turn
    values, directions = np.linalg.eigh(place)
    return directions[:, 0], float(max(values[0], 0.0))


class FrontEnd:
    """Follows the robot by matching scans with a local map."""

    def __init__(self, *, key_distance: float = KEY_DISTANCE, wheels: Wheels | None = None) -> None:
        self.key_distance = key_distance
        self.pose = np.zeros(3)
        self.wheels = Wheels() if wheels is None else deepcopy(wheels)
        self._coasting = Coasting()
        self.mixed_pixels = MixedPixels()
        # Key scans that follow each other since a scan that was lost: their poses are certain.
        self._certain = 0
        # Running mean of a scan's hits, and whether the last scan has far fewer.
        self._hits, self._broken = 0.0, False
        # What the last scan saw that stands still, in the frame of the robot.
        self.surface = np.empty((0, 4))
        # And the last few scans since the key scan, with their poses.
        self._recent: deque[tuple[Float, Float]] = deque(maxlen=RECENT)
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
        deviations = np.sqrt(expected.uncertain.diagonal())
        surface, hits = (
            self._standing(points, guess, deviations) for points in (scan.surface, scan.hits)
        )
        self._broken = len(scan.hits) < BROKEN * self._hits
        kept = USUAL_HITS if self._hits else 0.0
        self._hits = kept * self._hits + (1.0 - kept) * len(scan.hits)
        match, accepted = self._match(replace(scan, surface=surface, hits=hits), expected)
        if not accepted and (turned_to := self._in_any_turn(scan, expected)):
            match, accepted, surface = turned_to, True, scan.surface
        if self._lost or not accepted:
            # Where one of them is lost, what scans saw does not lie together.
            self._recent.clear()
        self._lost = not accepted
        pose = match.pose if accepted else guess
        pose[2] = wrap_angle(pose[2])
        information = turned(match.information, -float(pose[2])) if accepted else np.zeros((3, 3))
        found = between(self.pose, pose)
        if accepted:
            self._coasting.found(coasting, found)
            if increment is not None:
                self.wheels.excess.update(expected, found)
            # Where wheels have slipped, the directions that scans do not fix are uncertain, too.
            slip = self._slip(match, expected)
            covariance = covariance * (1.0 + slip / PRIOR_SCALE**2)
        else:
            self._coasting.lost()
            self._certain = 0
            if not expected.trusted or self._passed(replace(scan, surface=surface), guess):
                # The wheels have slipped, and where to is not known.
                covariance = covariance + np.diag(expected.window**2)
        known = accepted and increment is not None
        self._turn_known &= known
        self._ahead_known &= known and information[0, 0] > WEAK
        self._raw += 0.0 if increment is None else increment
        self._found += found
        self.pose, self.surface = pose, surface
        self._recent.append((pose, surface))
        return Tracked(pose, information, accepted, match.deviation, covariance)

    def _passed(self, scan: Key, guess: Float) -> bool:
        """Whether beams of the local map pass through what a scan saw from a pose (3,)."""
        keys = list(self._keys)[-LOCAL_KEYS:]
        seen_from = between(np.array([key.pose for key in keys]).reshape(-1, 3), guess)
        return bool(keys) and self.mixed_pixels.contradict(keys, scan, seen_from)

    def _match(self, scan: Key, expected: Prediction) -> tuple[Match, bool]:
        """A match with the local map, and whether it is believed."""
        guess, surface = compose(self.pose, expected.step), scan.surface
        if self._grid is None or not len(surface):
            return Match(guess, np.zeros((3, 3)), 0.0, np.inf), False
        own: Float = np.asarray(np.linalg.inv(expected.uncertain), dtype=np.float64)
        match = match_scan(surface, self._grid, guess, turned(own, float(self.pose[2])))
        if not np.isfinite(match.pose).all():
            return match, False
        slipped = self._slip(match, expected) > SLIPPED**2
        searched = len(surface) >= LEAST_POINTS and not self._broken
        if searched and (slipped or match.explained < expected.doubtful):
            return self._searched(scan, self._grid, match, expected)
        return match, match.explained > LEAST_EXPLAINED

    def _slip(self, match: Match, expected: Prediction) -> float:
        """How far a match is off the odometry: its square in units of the variance."""
        error = between(expected.step, between(self.pose, match.pose))
        return float(error @ np.linalg.solve(expected.uncertain, error))

    def _searched(
        self, scan: Key, grid: SurfaceGrid, match: Match, expected: Prediction
    ) -> tuple[Match, bool]:
        """The likeliest place around where odometry leads, and whether it is believed.

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
        keys = list(self._keys)[-LOCAL_KEYS:]
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

    def _standing(self, points: Float, guess: Float, deviations: Float) -> Float:
        """Those of a scan's points (m, …) that were not passed by beams when the robot came by."""
        if len(self._keys) < THROUGH:
            return points
        # Where a guess may be off by more than beams pass behind a point, nothing is known.
        far = np.hypot(points[:, 0], points[:, 1])
        known = 3.0 * (max(deviations[0], deviations[1]) + deviations[2] * far) < BEHIND
        poses = between(np.array([key.pose for key in self._keys]), guess)
        gone = known & ((views_of(points, poses, self._keys) == 2).sum(axis=0) >= THROUGH)
        # Where most is new the robot is elsewhere than it thinks.
        return points if 2 * gone.sum() >= len(gone) else points[~gone]

    def key_due(self) -> bool:
        """Whether the robot has moved far enough since the last key scan."""
        if self._broken or not self._keys:
            return not self._keys
        x, y, turn = between(self._keys[-1].pose, self.pose)
        return bool(np.hypot(x, y) >= self.key_distance or abs(turn) >= KEY_TURN)

    def key(self, scan: Key) -> Key:
        """The scan that was just placed, as a key scan."""
        return replace(scan, pose=self.pose, surface=self.surface, walls=self._walls())

    def _walls(self) -> Float:
        """Points (w, 4) of the walls that the last scan saw, in its frame, and some scans before.

        Alone a scan of few beams would show of a wall a point here and there.
        """
        count = min(ENOUGH // max(len(self.surface), 1) + 1, len(self._recent))
        chosen = np.linspace(0, len(self._recent) - 1, count + 1).astype(np.int64)[1:]
        parts = [self._recent[k] for k in chosen.tolist()]
        seen = [moved(thinned(part), between(self.pose, pose)) for pose, part in parts]
        return np.concatenate(seen)

    def add_key(self, key: Key) -> None:
        """Take the scan that was just placed into the local map, as a key scan."""
        if self._turn_known:
            self.wheels.learn(self._raw, self._found, self._ahead_known)
        self._raw, self._found = np.zeros(3), np.zeros(3)
        self._turn_known = self._ahead_known = True
        self._recent.clear()
        self.mixed_pixels.learn(list(self._keys)[len(self._keys) - self._certain :], key)
        self._certain = min(self._certain + 1, ADJACENT)
        self._keys.append(key)
        self._grid = wall_map((near.walls, near.pose) for near in list(self._keys)[-LOCAL_KEYS:])


def refined(
    surfaces: Sequence[Float],
    poses: Float,
    keys: Sequence[Key],
    key_poses: Float,
    anchored: Int,
) -> Float:
    """Poses (n, 3) of all scans, matched again with all key scans (k,) around them.

    While the robot drove, a scan was matched with what lay just behind it; now its surroundings are
    known from all drives past it. Each is matched with what lies around the last of those anchored
    (m,): key scans, and scans in known places.
    """
    refined_poses = poses.copy()
    if not len(surfaces):
        return refined_poses
    ends = np.append(anchored[1:], len(surfaces))
    for first, end in zip(anchored.tolist(), ends.tolist(), strict=True):
        apart = np.hypot(*(key_poses[:, :2] - poses[first, :2]).T)
        nearest = np.argsort(apart, kind="stable")[:REFINED_WITH]
        grid = wall_map((keys[k].walls, key_poses[k]) for k in nearest.tolist())
        if grid is None:
            continue
        for scan in range(first, end):
            prior = turned(REFINED_PRIOR, float(poses[scan, 2]))
            match = match_scan(surfaces[scan], grid, poses[scan], prior, REFINED_ITERATIONS)
            if match.explained > LEAST_REFINED:
                refined_poses[scan] = match.pose
    return refined_poses
