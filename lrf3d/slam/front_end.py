"""Front end: follows the robot from scan to scan, against the map of the last few key scans.

Key-scan candidates and odometry increments enter; poses in the drifting frame of the front end
leave. Every half metre a key scan is due: loops are closed with these, and the pose graph is made
of them.
"""

from collections import deque
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import Pose, between, compose, turned
from lrf3d.matching.key_scans import (
    BEHIND,
    FORGETTING,
    PASSED,
    Key,
    MixedPixels,
    all_fans,
    views_of,
)
from lrf3d.matching.scan_matching import PRIOR_SCALE, Match, match_scan
from lrf3d.matching.search import CLEARLY, Submap, clearest
from lrf3d.matching.surface import SURFACE, concatenated, moved, thinned
from lrf3d.slam.motion import DOUBTFUL, Coasting, Prediction, Wheels, size_of

# Distance [m] or turn [rad] to the next key scan. Errors hardly change from 0.4 to 0.6 m.
KEY_DISTANCE = 0.5
KEY_TURN = 0.5

# The last key scans, with which a scan is matched: more cost time, fewer let the robot drift.
LOCAL_KEYS = 8

# Minimum inlier ratios: of a match near the prediction, of one that a search for a known place
# found (in woods the right one has hardly half), and of one that is beyond doubt.
TRACKED_SHARE = 0.1
FOUND_SHARE = 0.3
CERTAIN_SHARE = 0.6

# Fewest points of a scan for which a window is searched: among trees and cars it has a dozen.
LEAST_POINTS = 8

# Points that show walls well; a key scan with fewer adds those of some of the last scans.
ENOUGH = 150
RECENT = 32

# A point belongs to a dynamic obstacle if beams of at least the second number of the last key
# scans, of which the first number is kept, passed it.
WATCHED = 12
THROUGH = 2

# Standard deviations of a match from the prediction beyond which the places around are searched: a
# slip turns the robot, which walls show, and moves it aside, which they may not.
SLIP_LIMIT = 3.0

# Information [1/m²] below which scans leave a direction to the odometry: 0.02 m.
WEAK = 2500.0


@dataclass(frozen=True, slots=True)
class Tracked:
    """One scan as the front end placed it, in its drifting frame.

    The information (3, 3) of matching is along the axes of the pose (3,); the covariance (3, 3) is
    that of the odometry since the scan before, which the scan may contradict: it jumped. The
    deviation is the RMS distance [m] of the points from the walls.
    """

    pose: Float
    information: Float
    matched: bool
    deviation: float
    covariance: Float
    jumped: bool

    @property
    def weak(self) -> bool:
        """Whether matching leaves a direction to the odometry, as along a corridor."""
        return weakest_direction(self.information)[1] < WEAK


def weakest_direction(information: Float) -> tuple[Float, float]:
    """The direction (2,) that information (3, 3) fixes worst, and how well [1/m²].

    The heading is marginalised.
    """
    coupling = information[:2, 2]
    turn = max(float(information[2, 2]), 1e-9)
    place = information[:2, :2] - np.outer(coupling, coupling) / turn
    (weakest, _), directions = np.linalg.eigh(place)
    return directions[:, 0], float(max(weakest, 0.0))


class Placed(NamedTuple):
    """A scan as placed by a prediction: its match, whether it is accepted, and what stands still.

    The prediction is contradicted if the scan fits clearly better elsewhere.
    """

    match: Match
    accepted: bool
    still: Key
    contradicted: bool


class FrontEnd:
    """Follows the robot by matching scans with a local map."""

    def __init__(
        self, start: Pose, key_distance: float = KEY_DISTANCE, wheels: Wheels | None = None
    ) -> None:
        self.key_distance = key_distance
        self.pose = np.array(start)
        self.wheels = Wheels() if wheels is None else deepcopy(wheels)
        self._coasting = Coasting()
        self.mixed_pixels = MixedPixels()
        adjacent = 4  # Key scans before a new one that show the rate of mixed pixels.
        # The last key scans since a scan that was lost: their relative poses are certain.
        self._certain: deque[Key] = deque(maxlen=adjacent)
        # Running mean of a scan's hits, and whether the last scan has far fewer.
        self._hits = 0.0
        self._broken = False
        # The surface of the last scan without dynamic obstacles, in the frame of the robot.
        self.surface = np.empty(0, SURFACE)
        # And the last few scans since the key scan, with their poses.
        self._recent: deque[tuple[Float, Records]] = deque(maxlen=RECENT)
        self._keys: deque[Key] = deque(maxlen=WATCHED)
        self._map = Submap([], np.empty((0, 3)))
        self._lost = False
        # Largest speeds [m/s], [rad/s] lately, at first those of a fast robot.
        self._speeds = np.array([3.0, 3.0])
        # Whether the last scan contradicted the wheels.
        self._contradicted = False
        # The motion since the last key scan, a sum of increments by the wheels and by matching, and
        # whether the walls in view fixed its turn and its distance ahead.
        self._raw = np.zeros(3)
        self._found = np.zeros(3)
        self._turn_known = self._ahead_known = True

    def track(self, scan: Key, increment: Float | None, since: float = 1.0) -> Tracked:
        """Place the next scan, by the odometry's increment (3,) since some time [s], if any."""
        # Share of the usual number of hits below which a scan is broken: it fits in many places, so
        # it is not searched, and is no key scan.
        broken = 0.25
        self._broken = len(scan.hits) < broken * self._hits
        kept = FORGETTING if self._hits else 0.0
        self._hits = kept * self._hits + (1.0 - kept) * len(scan.hits)
        expected = coasting = self._coasting.predict()
        if increment is not None:
            expected = self.wheels.predict(increment)
            if self._contradicted:
                # Wheels that slip go on, and few beams show it by several scans alone.
                expected = expected._replace(doubtful=np.inf, other=coasting)
        placed = self._placed(scan, expected)
        far = self._is_far(expected.step, since)
        jumped = False
        unsure = not placed.accepted or self._half_seen(placed, expected)
        if increment is not None and (far or unsure):
            # A jump of the odometry is no motion: scans show which of the two it is. Along a bare
            # wall the robot goes on as before.
            coasting = coasting._replace(doubtful=DOUBTFUL, trusted=True)
            other = self._placed(scan, coasting)
            better = self._worth(other, coasting) + CLEARLY >= self._worth(placed, expected)
            jumped = better and (far or other.match.explained > CERTAIN_SHARE)
            if jumped:
                expected = coasting
                placed = other
                increment = None
        match, accepted, still, self._contradicted = placed
        guess = compose(self.pose, expected.step)
        self.surface = still.surface
        if self._lost or not accepted:
            # Around a lost scan, points of different scans do not fit together.
            self._recent.clear()
        self._lost = not accepted
        x, y, heading = match.pose if accepted else guess
        pose = np.array([x, y, wrap_angle(heading)])
        found = between(self.pose, pose)
        information = np.zeros((3, 3))
        covariance = expected.covariance
        if accepted:
            information = turned(match.information, -float(wrap_angle(heading)))
            self._coasting.found(coasting, found)
            if increment is not None:
                self.wheels.excess.update(expected, found)
            # Where wheels have slipped, the directions that scans do not fix are uncertain, too.
            slip = self._slip(match, expected)
            covariance = covariance * (1.0 + slip / PRIOR_SCALE**2)
            self._speeds = np.maximum(FORGETTING * self._speeds, np.array(size_of(found)) / since)
        else:
            self._coasting.lost()
            self._certain.clear()
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
        return Tracked(pose, information, accepted, match.deviation, covariance, jumped)

    def _is_far(self, step: Float, since: float) -> bool:
        """Whether a step (3,) of the wheels is far larger than those of the robot in a time [s]."""
        # Factor on the largest speed so far, and step [m], [rad] beyond it, that are no jump.
        faster = 2.0
        beyond = 0.25
        return bool((np.array(size_of(step)) > faster * self._speeds * since + beyond).any())

    def _half_seen(self, placed: Placed, expected: Prediction) -> bool:
        """Whether a scan contradicts the wheels, and leaves a direction to them all the same."""
        slipped = self._slip(placed.match, expected) > SLIP_LIMIT**2
        return slipped and weakest_direction(placed.match.information)[1] < WEAK

    def _worth(self, placed: Placed, expected: Prediction) -> float:
        """The evidence for a scan where it was placed by a prediction."""
        if not placed.accepted:
            return -np.inf
        return self._map.place(self._judged(placed.still, expected), placed.match).evidence

    def _judged(self, scan: Key, expected: Prediction) -> Key:
        """A scan as places of it are judged: only by hits that stand still."""
        return replace(scan, hits=self._standing(scan.hits, expected))

    def _placed(self, scan: Key, expected: Prediction) -> Placed:
        """A scan placed around a prediction."""
        still = replace(scan, surface=self._standing(scan.surface, expected))
        placed = self._match(still, expected)
        if not placed.accepted and (relocated := self._at_any_heading(scan, expected)):
            placed = Placed(relocated, True, scan, placed.contradicted)
        return placed

    def _passed(self, scan: Key, pose: Float) -> bool:
        """Whether beams of the local map pass through what a scan saw from a pose (3,)."""
        return bool(self._map.keys) and self.mixed_pixels.contradict(
            self._map.keys, scan, self._map.seen_from(pose)
        )

    def _match(self, scan: Key, expected: Prediction) -> Placed:
        """A scan as matched with the local map, and searched where the match is doubtful."""
        guess = compose(self.pose, expected.step)
        *_, heading = self.pose.tolist()
        prior = turned(np.asarray(np.linalg.inv(expected.uncertain)), heading)
        match = self._map.match(scan, guess, prior)
        if match is None:
            return Placed(Match(guess, np.zeros((3, 3)), 0.0, np.inf), False, scan, False)
        slipped = self._slip(match, expected) > SLIP_LIMIT**2
        searched = len(scan.surface) >= LEAST_POINTS and not self._broken
        if searched and (slipped or match.explained < expected.doubtful):
            return self._searched(scan, match, expected)
        return Placed(match, match.explained > TRACKED_SHARE, scan, False)

    def _slip(self, match: Match, expected: Prediction) -> float:
        """Squared distance of a match from the prediction in units of the variance."""
        error = between(expected.step, between(self.pose, match.pose))
        return float(error @ np.linalg.solve(expected.uncertain, error))

    def _searched(self, scan: Key, match: Match, expected: Prediction) -> Placed:
        """A scan at the likeliest place around the prediction.

        Wheels slip and spin, and robots are pushed, but seldom, and the farther the less: by
        Cauchy's distribution. Where a robot enters a new room, the right place explains little, and
        that of the last scan more; but only at a wrong one do beams pass through what was hit.
        """
        guess = compose(self.pose, expected.step)
        judged = self._judged(scan, expected)
        places = self._map.places(judged, guess, np.diag(expected.window**2))
        places.append(self._map.place(judged, match))
        worth = np.array([place.evidence for place in places])
        odds = worth.copy()
        if expected.trusted:
            # Log odds against a slip: one step in twenty is off by more than the wheels' noise.
            rare = 3.0
            likely = [expected]
            if expected.other is not None:
                rare = 0.0
                likely = [expected, expected.other]
            slips = between(guess, np.array([place.match.pose for place in places]))
            noise = [[self._slip(place.match, step) for place in places] for step in likely]
            far = np.log1p(np.square(slips / expected.window).sum(axis=1))
            odds -= np.minimum(np.log1p(np.min(noise, axis=0)), rare + far)
        best = places[int(odds.argmax())]
        fits = places[int(worth.argmax())]
        clearly = 1.0  # A difference of log odds.
        # In a corridor of glass little is explained, and most where the robot has been.
        slipped = self._slip(fits.match, expected) > SLIP_LIMIT**2
        better = fits is best or fits.evidence > best.evidence + clearly
        contradicted = slipped and better and fits.match.explained > CERTAIN_SHARE
        return Placed(best.match, best.evidence > 0.0, scan, contradicted)

    def _at_any_heading(self, scan: Key, expected: Prediction) -> Match | None:
        """The place where a lost scan clearly fits best, whatever its heading."""
        if not self._map.keys or self._broken or len(scan.surface) < LEAST_POINTS:
            return None
        turn = np.pi / 3.0  # Standard deviation of a window of all headings [rad].
        guess = compose(self.pose, expected.step)
        window = np.array([*expected.window[:2], turn])
        places = self._map.places(scan, guess, np.diag(window**2))
        best = clearest([place.match.pose for place in places], [each.evidence for each in places])
        if best is None:
            return None
        match, worth = places[best]
        if worth <= 0.0 or match.explained <= CERTAIN_SHARE or self._passed(scan, match.pose):
            return None
        return match

    def _standing(self, points: Records, expected: Prediction) -> Records:
        """The points of a scan without dynamic obstacles, which beams of key scans passed."""
        if len(self._keys) < THROUGH:
            return points
        # Where a guess may be off by more than `BEHIND`, nothing is known.
        x, y, turn = np.sqrt(expected.uncertain.diagonal())
        far = np.hypot(points["x"], points["y"])
        known = 3.0 * (max(x, y) + turn * far) < BEHIND
        guess = compose(self.pose, expected.step)
        poses = between(np.array([key.pose for key in self._keys]), guess)
        gone = known & ((views_of(points, poses, self._fans) == PASSED).sum(axis=0) >= THROUGH)
        # If beams passed most of the points, the guess is wrong.
        return points if 2 * gone.sum() >= len(gone) else points[~gone]

    def key_due(self) -> bool:
        """Whether the robot has moved far enough since the last key scan."""
        if self._broken or not self._keys:
            return not self._keys
        length, turn = size_of(between(self._keys[-1].pose, self.pose))
        return length >= self.key_distance or turn >= KEY_TURN

    def _walls(self) -> Records:
        """The walls that the last scan and some scans before saw, in the frame of the last one.

        A scan of few beams alone would show single points of a wall.
        """
        count = min(ENOUGH // max(len(self.surface), 1) + 1, len(self._recent))
        chosen = np.linspace(0, len(self._recent) - 1, count + 1).astype(np.int64)[1:]
        parts = [self._recent[k] for k in chosen.tolist()]
        return concatenated(moved(thinned(part), between(self.pose, pose)) for pose, part in parts)

    def add_key(self, scan: Key) -> Key:
        """Add the scan that was just placed to the local map, as a key scan."""
        key = replace(scan, pose=self.pose, surface=self.surface, walls=self._walls())
        if self._turn_known:
            self.wheels.learn(self._raw, self._found, self._ahead_known)
        self._raw = np.zeros(3)
        self._found = np.zeros(3)
        self._turn_known = self._ahead_known = True
        self._recent.clear()
        self.mixed_pixels.learn(self._certain, key)
        self._certain.append(key)
        self._keys.append(key)
        self._fans = all_fans(near.fans for near in self._keys)
        local = list(self._keys)[-LOCAL_KEYS:]
        self._map = Submap(local, np.array([near.pose for near in local]))
        return key


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
    surrounding = 12  # Key scans with which a scan is matched, the nearest.
    prior = np.diag([2500.0, 2500.0, 10000.0])  # Information of its pose: 0.02 m and 0.01 rad.
    refined_poses = poses.copy()
    grid = None
    anchors = set(anchored.tolist())
    for scan, (surface, pose) in enumerate(zip(surfaces, poses, strict=True)):
        if scan in anchors:
            apart = np.hypot(*(key_poses[:, :2] - pose[:2]).T)
            nearest = np.argsort(apart, kind="stable")[:surrounding]
            grid = Submap([keys[k] for k in nearest.tolist()], key_poses[nearest]).grid
        if grid is None:
            continue
        *_, heading = pose.tolist()
        match = match_scan(surface, grid, pose, turned(prior, heading))
        if match.explained > FOUND_SHARE:
            refined_poses[scan] = match.pose
    return refined_poses
