"""Front end: follows the robot from scan to scan, against the map of the last few key scans.

Surfaces and odometry increments enter; poses in the drifting frame of the front end leave, and
every half metre a key scan: loops are closed with these, and the pose graph is made of them.
"""

from copy import deepcopy
from dataclasses import dataclass
from itertools import chain

import numpy as np

from lrf3d.geometry import Float, wrap_angle
from lrf3d.slam.correlation import AMBIGUOUS, correlate
from lrf3d.slam.frames import between, compose, turned
from lrf3d.slam.resolution import DENSE, Resolution
from lrf3d.slam.scan_matching import Match, match_scan
from lrf3d.slam.surface import SurfaceGrid, evenly_spaced, is_unknown, moved, wall_map
from lrf3d.slam.wheels import Wheels

KEY_DISTANCE, KEY_TURN = 0.5, 0.5
"""A key scan is taken after this way [m] or turn [rad]. Errors hardly change from 0.4 to 0.6 m."""

MOST_POINTS = 200
"""Points of the local map that a sparse laser recognises a place by, at most."""

PART_DISTANCE, PART_TURN = 0.12, 0.12
"""A scan of a sparse laser becomes part of the local map after this way [m] or turn [rad]."""

LOCAL_KEYS = 8
"""Key scans that a scan is matched with: more cost time, fewer let the robot drift."""

ITERATIONS = 12
"""Most Gauss-Newton steps of a match; six are usual."""

REACH = 0.3
"""How far off walls are looked for [m]."""

LEAST_EXPLAINED = 0.15
"""A match that explains a smaller share of the points than this is rejected."""

DOUBTFUL, BETTER = 0.65, 0.15
"""Where a match explains a smaller share than the first, others are tried that odometry does not
lead to, and accepted if they explain more by the second."""

LOST = 0.4
"""Where not even these explain such a share, all places around are searched."""

LEAST_FOUND = 0.5
"""Share that a place has to explain if nothing but the search led to it."""

SEARCHED, MOST_SEARCHED, SEARCHED_TURN = 0.6, 2.0, 0.5
"""How far around [m], [rad], beside the way that the robot may have driven, and at most how far."""

LEAST_POINTS = 20
"""With fewer points than this no others are tried: a few points fit in many places."""

UNGUIDED = np.diag([100.0, 100.0, 400.0])
"""Information of the guess in these: 0.1 m and 0.05 rad."""

UNGUIDED_COVARIANCE = np.diag(1.0 / UNGUIDED.diagonal())
"""And their covariance."""

BACKWARDS = np.array([-1.0, -1.0, 1.0])
"""What turns an increment into that of a robot that drives backwards."""

REVERSED = 0.03
"""A scan that lies farther behind the last one than this [m], where odometry has it farther ahead
than this, was reached backwards, with encoders that know no sign."""

WEAK = 2500.0
"""A direction is left to the odometry where scans fix it with less information than this [1/m²]: no
better than 0.02 m."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """One scan as the front end placed it.

    Args:
        pose: (3,) pose in the frame of the front end.
        information: (3, 3) inverse covariance that matching gives it, along its own axes.
        explained: Share of its surface that lies on the local map.
        matched: Whether it was matched; if not, it stands where odometry has it.
        deviation: RMS distance [m] of its points to the walls they were matched with.
        motion: (3,) how the robot moved since the scan before by its wheels, without the errors
            that are known of these.
        covariance: (3, 3) that of the motion's random errors.
        unlearned: Variance [rad²] of its turn by systematic errors that were not known yet.
    """

    pose: Float
    information: Float
    explained: float
    matched: bool
    deviation: float
    motion: Float
    covariance: Float
    unlearned: float = 0.0

    @property
    def weakest(self) -> tuple[Float, float]:
        """The direction (2,) that matching fixes worst, in the robot's axes, and its information.

        The information [1/m²] is that of the place, whatever the heading is.
        """
        return weakest_direction(self.information)

    @property
    def weak(self) -> bool:
        """Whether matching leaves a direction to the odometry, as along a corridor."""
        return self.weakest[1] < WEAK


def weakest_direction(information: Float) -> tuple[Float, float]:
    """The direction (2,) that information (3, 3) fixes worst, and how well [1/m²]."""
    turn = max(float(information[2, 2]), 1e-9)
    coupling = information[:2, 2]
    place = information[:2, :2] - np.outer(coupling, coupling) / turn
    values, directions = np.linalg.eigh(place)
    return directions[:, 0], float(max(values[0], 0.0))


class FrontEnd:
    """Follows the robot by matching scans with a local map.

    Args:
        key_distance: Way between key scans [m].
        key_turn: Turn between key scans [rad].
        resolution: That of the laser.
        wheels: What is known of the wheels' errors; nothing if not given. A copy of it is kept.
    """

    def __init__(
        self,
        *,
        key_distance: float = KEY_DISTANCE,
        key_turn: float = KEY_TURN,
        resolution: Resolution = DENSE,
        wheels: Wheels | None = None,
    ) -> None:
        self.key_distance, self.key_turn = key_distance, key_turn
        self.resolution = resolution
        self.pose = np.zeros(3)
        self.wheels = Wheels() if wheels is None else deepcopy(wheels)
        # The surfaces that make the local map, with their poses, for each of the last key scans.
        self._local: list[list[tuple[Float, Float]]] = []
        # Those of a sparse laser's scans since the last key scan.
        self._stretch: list[tuple[Float, Float]] = []
        self._key_pose: Float | None = None
        self._grid: SurfaceGrid | None = None
        self._raw = np.zeros(3)
        self._found = np.zeros(3)
        self._turn_known = self._ahead_known = True
        self._last = np.zeros(3)
        self._signs = np.ones(3)
        self._dead = False

    def track(self, surface: Float, increment: Float) -> Tracked:
        """Place the next scan.

        Args:
            surface: (m, 4) what it saw, in the frame of the robot's base.
            increment: (3,) how the robot moved since the last scan by its wheels.
        """
        increment = self._signs * increment
        # Encoders that have stood still while scans showed motion are dead until they count again.
        self._dead &= not increment.any()
        expected = self._last if self._dead else self.wheels.corrected(increment)
        covariance = UNGUIDED_COVARIANCE if self._dead else self.wheels.covariance(increment)
        unlearned = 0.0 if self._dead else self.wheels.unlearned(increment)
        guess = compose(self.pose, expected)
        variances = covariance.diagonal() + np.array([0.0, 0.0, unlearned])
        prior = turned(np.diag(1.0 / variances), float(self.pose[2]))
        match, backwards = Match(guess, np.zeros((3, 3)), 0.0, np.inf), False
        if self._grid is not None and len(surface):
            match = match_scan(
                surface, self._grid, guess, prior, ITERATIONS, REACH, self.resolution.sigma
            )
            if match.explained < DOUBTFUL and len(surface) >= LEAST_POINTS:
                match, backwards = self._better(surface, self._grid, match, expected)
            if backwards:
                # From here on the encoders are taken to count the other way.
                self._signs, increment = self._signs * BACKWARDS, increment * BACKWARDS
        accepted = match.explained >= LEAST_EXPLAINED and bool(np.isfinite(match.pose).all())
        pose = match.pose if accepted else guess
        pose[2] = wrap_angle(pose[2])
        information = turned(match.information, -float(pose[2])) if accepted else np.zeros((3, 3))
        found = between(self.pose, pose)
        self._last = found
        if accepted and not (backwards or self._dead):
            self.wheels.compare(expected, found, covariance)
        self._turn_known &= accepted and not self._dead
        self._ahead_known &= accepted and information[0, 0] > WEAK
        self._dead |= bool(accepted and not increment.any() and np.abs(found).max() > REVERSED)
        self._raw += increment
        self._found += found
        self.pose = pose
        if self.resolution.sparse and self._apart():
            self._stretch.append((surface, pose.copy()))
            self._grid = wall_map(
                [*chain.from_iterable(self._local), *self._stretch], self.resolution.along
            )
        return Tracked(
            pose,
            information,
            match.explained,
            accepted,
            match.deviation,
            expected,
            covariance,
            unlearned,
        )

    def _better(
        self, surface: Float, grid: SurfaceGrid, match: Match, expected: Float
    ) -> tuple[Match, bool]:
        """A match that explains much more than the one that odometry led to, if there is one.

        Wheels that spin, or a robot that is pushed, move otherwise than odometry says: the robot
        stands still, goes on as it did, or drives backwards with encoders that know no sign. Where
        none of that fits, all places around are searched: encoders may fail, or be missing.

        Returns:
            The best match, and whether it was reached backwards.
        """
        sigma, best = self.resolution.sigma, match
        for motion in (self._last, np.zeros(3), expected * BACKWARDS):
            guess = compose(self.pose, motion)
            other = match_scan(surface, grid, guess, UNGUIDED, ITERATIONS, REACH, sigma)
            best = max(best, other, key=_explained)
        if best.explained < (DOUBTFUL if self._dead else LOST):
            steps = np.abs([expected, self._last]).max(axis=0)
            places = correlate(
                surface,
                grid,
                compose(self.pose, expected),
                window=min(SEARCHED + float(np.hypot(*steps[:2])), MOST_SEARCHED),
                turn=SEARCHED_TURN + float(steps[2]),
                reach=REACH,
                sigma=sigma,
            )
            # Of two places that fit alike the search knows neither.
            least = max([LEAST_FOUND, *(place.explained / AMBIGUOUS for place in places[1:])])
            if places and places[0].explained > least:
                best = max(best, places[0], key=_explained)
        apart = best.pose - match.pose
        apart[2] = wrap_angle(apart[2])
        known = float(apart @ best.information @ apart) > WEAK * float(apart @ apart)
        if not (known and best.explained > match.explained + BETTER):
            return match, False
        ahead = between(self.pose, best.pose)[0]
        return best, bool(min(-ahead * np.sign(expected[0]), abs(expected[0])) > REVERSED)

    def _apart(self) -> bool:
        """Whether the robot has moved far enough for a scan to show other points of the walls."""
        if not self._stretch:
            return True
        x, y, turn = between(self._stretch[-1][1], self.pose)
        return bool(np.hypot(x, y) >= PART_DISTANCE or abs(turn) >= PART_TURN)

    def key_due(self) -> bool:
        """Whether the robot has moved far enough since the last key scan."""
        if self._key_pose is None:
            return True
        x, y, turn = between(self._key_pose, self.pose)
        return bool(np.hypot(x, y) >= self.key_distance or abs(turn) >= self.key_turn)

    def add_key(self, surface: Float) -> tuple[Float, Float]:
        """Take the scan that was just placed into the local map.

        Returns:
            What a key scan there can be recognised by (m, 4), and the walls (w, 4) that it adds to
            a map, both in the frame of the robot: of a sparse laser what the scans around it saw.
        """
        if self._turn_known:
            self.wheels.learn(self._raw, self._found, self._ahead_known)
        self._raw, self._found = np.zeros(3), np.zeros(3)
        self._turn_known = self._ahead_known = True
        back = between(self.pose, np.zeros(3))
        if self.resolution.sparse:
            if not self._stretch or self._stretch[-1][0] is not surface:
                self._stretch.append((surface, self.pose.copy()))
            walls = moved(np.concatenate([moved(*part) for part in self._stretch]), back)
        else:
            walls = evenly_spaced(surface)
        self._local = [*self._local[1 - LOCAL_KEYS :], self._stretch or [(walls, self.pose.copy())]]
        self._stretch = []
        self._key_pose = self.pose.copy()
        self._grid = wall_map(chain.from_iterable(self._local), self.resolution.along)
        if self.resolution.sparse and self._grid is not None:
            cloud = self._grid.surface
            cloud = cloud[~is_unknown(cloud)]
            surface = moved(cloud[:: 1 + len(cloud) // MOST_POINTS], back)
        return surface, walls


def _explained(match: Match) -> float:
    """By what matches of one scan are compared."""
    return match.explained
