"""Front end: tracks the robot from scan to scan against the map of the last few key scans.

Key-scan candidates and odometry increments enter; poses in the front end's drifting frame leave.
Every half metre a key scan is due: these are the vertices of the pose graph, and close its loops.
"""

from collections import deque
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import ROUNDING, Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import Pose, between, compose, turned
from lrf3d.matching.key_scans import (
    BEHIND,
    FORGETTING,
    PASSED,
    Key,
    MixedPixelModel,
    all_fans,
    views_of,
)
from lrf3d.matching.scan_matching import PRIOR_SCALE, Match, match_scan
from lrf3d.matching.search import CLEARLY, Submap, clearest
from lrf3d.matching.surface import DEVIATIONS, SURFACE, concatenated, grid_of, moved, thinned
from lrf3d.slam.motion import DOUBTFUL, Coasting, Prediction, Wheels, size_of

# Distance to the next key scan [m]. Errors hardly change from 0.4 to 0.6 m.
KEY_DISTANCE = 0.5

# Turn to the next key scan [rad].
KEY_TURN = 0.5

# Number of the last key scans that a scan is matched with: more cost time, fewer let it drift.
LOCAL_KEYS = 8

# Minimum inlier ratio to accept a match near the prediction.
TRACKED_SHARE = 0.1

# Minimum inlier ratio at a place found by searching: in woods the right one has hardly half.
FOUND_SHARE = 0.3

# Inlier ratio from which a match is beyond doubt.
CERTAIN_SHARE = 0.6

# Fewest points of a scan for which a window is searched: a scan among trees and cars has a dozen.
LEAST_POINTS = 8

# Number of points that show walls well. A key scan with fewer adds points of some scans before it.
ENOUGH = 150

# Number of the last scans whose points a key scan may add.
RECENT = 32

# Number of the last key scans whose beams reveal dynamic obstacles.
WATCHED = 12

# Number of these whose beams must pass a point for it to count as a dynamic obstacle.
THROUGH = 2

# Squared Mahalanobis distance of a match from a prediction beyond which noise does not explain it.
SLIPPED = DEVIATIONS**2

# Information [1/m²] below which scans do not fix a direction, and leave it to the odometry: that of
# a standard deviation of 0.02 m.
WEAK = 2500.0


@dataclass(frozen=True, slots=True)
class Tracked:
    """One scan as the front end placed it, in its drifting frame.

    The information (3, 3) of matching is along the axes of the pose (3,); the covariance (3, 3) is
    that of the odometry since the scan before. If the odometry ``jumped``, the scan contradicts it.
    The deviation is the RMS distance [m] of the points from the walls; ``explained`` is the share
    of the points that lie at walls of the local map.
    """

    pose: Float
    information: Float
    matched: bool
    deviation: float
    covariance: Float
    jumped: bool
    explained: float

    @property
    def weak(self) -> bool:
        """Whether matching leaves a direction to the odometry, as along a corridor."""
        return weakest_direction(self.information)[1] < WEAK


def weakest_direction(information: Float) -> tuple[Float, float]:
    """The direction (2,) that information (3, 3) fixes worst, and its information [1/m²].

    The heading is marginalised out.
    """
    coupling = information[:2, 2]
    turn = max(float(information[2, 2]), ROUNDING)
    place = information[:2, :2] - np.outer(coupling, coupling) / turn
    (weakest, _), directions = np.linalg.eigh(place)
    return directions[:, 0], float(max(weakest, 0.0))


class Placed(NamedTuple):
    """A scan as placed around an ``expected`` step: its match, and whether it is accepted.

    ``still`` is the scan without its dynamic obstacles; ``slip`` is the squared Mahalanobis
    distance of the match from the expected step. The prediction is ``contradicted`` if the scan
    fits clearly better elsewhere.
    """

    match: Match
    accepted: bool
    still: Key
    expected: Prediction
    slip: float
    contradicted: bool = False


class FrontEnd:
    """Tracks the robot by matching scans with a local map."""

    def __init__(
        self, start: Pose, key_distance: float = KEY_DISTANCE, wheels: Wheels | None = None
    ) -> None:
        self.key_distance = key_distance
        self.pose = np.array(start)
        self.wheels = Wheels() if wheels is None else deepcopy(wheels)
        self._coasting = Coasting()
        self.mixed_pixels = MixedPixelModel()
        adjacent = 4  # Key scans before a new one that show the rate of mixed pixels.
        # The last key scans, none from before a lost scan: their relative poses are certain.
        self._certain: deque[Key] = deque(maxlen=adjacent)
        # Running mean of the number of hits in a scan, and whether the last one has far fewer.
        self._hits = 0.0
        self._broken = False
        # The surface of the last scan without dynamic obstacles, in the frame of the robot.
        self.surface = np.empty(0, SURFACE)
        # The poses and surfaces of the last scans since the last key scan.
        self._recent: deque[tuple[Float, Records]] = deque(maxlen=RECENT)
        self._keys: deque[Key] = deque(maxlen=WATCHED)
        self._map = Submap([], np.empty((0, 3)))
        self._lost = False
        # Decaying maximum of the speeds [m/s], [rad/s], at first those of a fast robot.
        self._speeds = np.full(2, 3.0)
        # Whether the last scan contradicted the wheels.
        self._contradicted = False
        # Of each scan since the last key scan: the increment (3,) of the wheels, None if it is
        # invalid, the matched step (3,), and whether the walls in view fixed its distance ahead.
        self._since_key: list[tuple[Float | None, Float, bool]] = []

    def track(self, scan: Key, increment: Float | None, since: float = 1.0) -> Tracked:
        """Place the next scan, by the odometry increment (3,) over some time [s] if any."""
        self._count_hits(scan)
        coasting = self._coasting.predict()
        placed = self._placed(scan, self._predicted(increment, coasting))
        jump = None if increment is None else self._jump(scan, placed, coasting, since)
        if jump is not None:
            placed = jump
            increment = None
        match, accepted, still, expected, _, self._contradicted = placed
        covariance = self._covariance(placed)
        x, y, heading = match.pose if accepted else compose(self.pose, expected.step)
        pose = np.array([x, y, wrap_angle(heading)])
        step = between(self.pose, pose)
        information = np.zeros((3, 3))
        self.surface = still.surface
        if self._lost or not accepted:
            # Around a lost scan, points of different scans do not fit together.
            self._recent.clear()
        self._lost = not accepted
        if accepted:
            information = turned(match.information, -float(wrap_angle(heading)))
            self._coasting.found(coasting, step)
            self._speeds = np.maximum(FORGETTING * self._speeds, np.array(size_of(step)) / since)
            if increment is not None:
                self.wheels.excess.update(expected, step)
        else:
            self._coasting.lost()
            self._certain.clear()
        ahead_known = bool(information[0, 0] > WEAK)
        self._since_key.append((increment if accepted else None, step, ahead_known))
        self.pose = pose
        self._recent.append((pose, self.surface))
        jumped = jump is not None
        return Tracked(
            pose, information, accepted, match.deviation, covariance, jumped, match.explained
        )

    def _count_hits(self, scan: Key) -> None:
        """Compare the number of hits in a scan with the usual one.

        A broken scan has far fewer. It fits many places, so none is searched for it, and it does
        not become a key scan.
        """
        broken = 0.25  # Share of the usual number of hits below which a scan is broken.
        self._broken = len(scan.hits) < broken * self._hits
        kept = FORGETTING if self._hits else 0.0
        self._hits = kept * self._hits + (1.0 - kept) * len(scan.hits)

    def _predicted(self, increment: Float | None, coasting: Prediction) -> Prediction:
        """The step to the next scan by the wheels, or by the last step where there are none."""
        if increment is None:
            return coasting
        expected = self.wheels.predict(increment)
        if self._contradicted:
            # Wheels that slip go on slipping, and a laser of few beams shows it only over several
            # scans: the robot may as well have gone on as before.
            expected = expected._replace(doubtful=np.inf, other=coasting)
        return expected

    def _jump(self, scan: Key, placed: Placed, coasting: Prediction, since: float) -> Placed | None:
        """The scan as placed without the wheels, if these jumped; None if they did not.

        If only the odometry jumped, the scan fits at least as well where the robot goes on as
        before. Along a bare wall it fits equally well at both places.
        """
        far = self._is_far(placed.expected.step, since)
        # A scan may contradict the wheels, and yet leave one direction to them.
        half_seen = placed.slip > SLIPPED and weakest_direction(placed.match.information)[1] < WEAK
        if not far and placed.accepted and not half_seen:
            return None
        other = self._placed(scan, coasting._replace(doubtful=DOUBTFUL, trusted=True))
        better = self._evidence(other) + CLEARLY >= self._evidence(placed)
        return other if better and (far or other.match.explained > CERTAIN_SHARE) else None

    def _covariance(self, placed: Placed) -> Float:
        """Covariance (3, 3) of the predicted step, larger where the scan contradicts it."""
        expected = placed.expected
        covariance = expected.covariance
        if placed.accepted:
            # Where wheels have slipped, the directions that scans do not fix are uncertain, too.
            return covariance * (1.0 + placed.slip / PRIOR_SCALE**2)
        if not expected.trusted or self._passed(placed.still, compose(self.pose, expected.step)):
            # The wheels have slipped by an unknown step.
            covariance = covariance + np.diag(expected.window**2)
        return covariance

    def _is_far(self, step: Float, since: float) -> bool:
        """Whether a step (3,) of the wheels is far larger than those of the robot in a time [s]."""
        faster = 2.0  # Factor on the largest speed so far up to which a step is no jump.
        beyond = 0.25  # Allowance for small steps [m], [rad].
        return bool((np.array(size_of(step)) > faster * self._speeds * since + beyond).any())

    def _evidence(self, placed: Placed) -> float:
        """The evidence for a scan where it was placed; −inf if it was not."""
        if not placed.accepted:
            return -np.inf
        return self._map.place(self._judged(placed.still, placed.expected), placed.match).evidence

    def _judged(self, scan: Key, expected: Prediction) -> Key:
        """A scan without the hits on dynamic obstacles, by which its places are judged."""
        return replace(scan, hits=self._standing(scan.hits, expected))

    def _placed(self, scan: Key, expected: Prediction) -> Placed:
        """Place a scan around a prediction, or at any heading where it matches nothing."""
        still = replace(scan, surface=self._standing(scan.surface, expected))
        placed = self._match(still, expected)
        # Without odometry the robot may have turned out of the search window.
        poor = not expected.trusted and placed.match.explained < FOUND_SHARE
        lost = poor or not placed.accepted
        if lost and (relocated := self._at_any_heading(scan, expected)):
            placed = placed._replace(
                match=relocated, accepted=True, still=scan, slip=self._slip(relocated, expected)
            )
        return placed

    def _passed(self, scan: Key, pose: Float) -> bool:
        """Whether a scan at a pose (3,) and the local map contradict each other."""
        return bool(self._map.keys) and self.mixed_pixels.contradict(
            self._map.keys, scan, between(self._map.poses, pose)
        )

    def _match(self, scan: Key, expected: Prediction) -> Placed:
        """Match a scan with the local map, and search around where the match is doubtful.

        A match far from the prediction is doubtful, too. The wheels have slipped: walls show how
        the slip turned the robot, but may not show how far it moved the robot sideways.
        """
        guess = compose(self.pose, expected.step)
        *_, heading = self.pose.tolist()
        prior = turned(np.asarray(np.linalg.inv(expected.uncertain)), heading)
        match = self._map.match(scan, guess, prior)
        if match is None:
            return Placed(Match(guess, np.zeros((3, 3)), 0.0, np.inf), False, scan, expected, 0.0)
        slip = self._slip(match, expected)
        doubtful = match.explained < expected.doubtful or slip > SLIPPED
        if doubtful and len(scan.surface) >= LEAST_POINTS and not self._broken:
            return self._searched(scan, match, expected)
        return Placed(match, match.explained > TRACKED_SHARE, scan, expected, slip)

    def _slip(self, match: Match, expected: Prediction) -> float:
        """Squared Mahalanobis distance of a match from a prediction."""
        error = between(expected.step, between(self.pose, match.pose))
        return float(error @ np.linalg.solve(expected.uncertain, error))

    def _searched(self, scan: Key, match: Match, expected: Prediction) -> Placed:
        """Place a scan where it is likeliest around the prediction.

        Wheels slip and robots are pushed, but seldom, and the farther the less often: the prior has
        the tails of a Cauchy distribution. Where a robot enters a new room, the right place
        explains little, and the place of the last scan more; but only at a wrong place do beams
        pass through what was hit.
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
        clearly = 1.0  # Margin of log odds.
        better = fits is best or fits.evidence > best.evidence + clearly
        # In a corridor of glass scans fit badly everywhere, and best where the robot was before:
        # that does not contradict the wheels.
        certain = fits.match.explained > CERTAIN_SHARE
        contradicted = better and certain and self._slip(fits.match, expected) > SLIPPED
        return Placed(
            best.match,
            best.evidence > 0.0,
            scan,
            expected,
            self._slip(best.match, expected),
            contradicted,
        )

    def _at_any_heading(self, scan: Key, expected: Prediction) -> Match | None:
        """The match where a lost scan clearly fits best, whatever its heading."""
        if not self._map.keys or self._broken or len(scan.surface) < LEAST_POINTS:
            return None
        guess = compose(self.pose, expected.step)
        # The window takes in all headings.
        window = np.array([*expected.window[:2], np.pi / DEVIATIONS])
        places = self._map.places(scan, guess, np.diag(window**2))
        best = clearest([(match.pose, worth) for match, worth in places])
        if best is None:
            return None
        match, worth = places[best]
        if worth <= 0.0 or match.explained <= CERTAIN_SHARE or self._passed(scan, match.pose):
            return None
        return match

    def _standing(self, points: Records, expected: Prediction) -> Records:
        """The points of a scan except dynamic obstacles: those where beams of key scans passed."""
        if len(self._keys) < THROUGH:
            return points
        # Where a guess may be off by more than `BEHIND`, obstacles cannot be recognised.
        x, y, turn = np.sqrt(expected.uncertain.diagonal())
        far = np.hypot(points["x"], points["y"])
        known = DEVIATIONS * (max(x, y) + turn * far) < BEHIND
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
        """The walls that the last scan and some before it saw, in the frame of the last one.

        A scan of few beams alone would show single points of a wall.
        """
        count = min(ENOUGH // max(len(self.surface), 1) + 1, len(self._recent))
        chosen = np.linspace(0, len(self._recent) - 1, count + 1).astype(np.int64)[1:]
        parts = [self._recent[k] for k in chosen.tolist()]
        return concatenated(
            [moved(thinned(part), between(self.pose, pose)) for pose, part in parts]
        )

    def add_key(self, scan: Key) -> Key:
        """Add the scan that was just placed to the local map as a key scan."""
        key = replace(scan, pose=self.pose, surface=self.surface, walls=self._walls())
        measured, matched, ahead_known = zip(*self._since_key, strict=True)
        if not any(increment is None for increment in measured):
            self.wheels.learn(sum(measured), sum(matched), all(ahead_known))
        self._since_key = []
        self._recent.clear()
        self.mixed_pixels.learn(self._certain, key)
        self._certain.append(key)
        self._keys.append(key)
        self._fans = all_fans([near.fans for near in self._keys])
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
    """Match all scans again with the key scans (k,) around them; returns their poses (n, 3).

    While the robot drove, a scan was matched only with the key scans before it; now it is matched
    with those of all drives past its place. Each anchored scan (m,) selects these, for itself and
    for the scans up to the next one.
    """
    surrounding = 12  # Number of nearest key scans with which a scan is matched.
    prior = np.diag([WEAK, WEAK, 100**2])  # Information of a pose: 0.02 m and 0.01 rad.
    refined_poses = poses.copy()
    grid = None
    anchors = set(anchored.tolist())
    walls = [moved(key.walls, pose) for key, pose in zip(keys, key_poses, strict=True)]
    for scan, (surface, pose) in enumerate(zip(surfaces, poses, strict=True)):
        if scan in anchors:
            apart = np.hypot(*(key_poses[:, :2] - pose[:2]).T)
            nearest = np.argsort(apart, kind="stable")[:surrounding]
            grid = grid_of(concatenated([walls[k] for k in nearest.tolist()]))
        if grid is None:
            continue
        *_, heading = pose.tolist()
        match = match_scan(surface, grid, pose, turned(prior, heading))
        if match.explained > FOUND_SHARE:
            refined_poses[scan] = match.pose
    return refined_poses
