"""Loop closures: relative poses between key scans that show the same place at different times.

Key scans and their estimated poses enter; accepted closures leave. Four checks precede acceptance:
the scans overlap, no beam of one passes through what the other saw, no other place within the
possible drift fits as well, and enough closures along the same stretch agree.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import Bool, Float, Records
from lrf3d.geometry.pose import between, compose, turned
from lrf3d.matching.key_scans import Key, MixedPixelModel
from lrf3d.matching.scan_matching import Match
from lrf3d.matching.search import Place, Submap, clearest
from lrf3d.matching.surface import DEVIATIONS
from lrf3d.slam.front_end import (
    CERTAIN_SHARE,
    FOUND_SHARE,
    KEY_DISTANCE,
    LEAST_POINTS,
    TRACKED_SHARE,
    WEAK,
    weakest_direction,
)
from lrf3d.slam.motion import size_of
from lrf3d.slam.pose_graph import GraphPaths, edges_of

# Least path length [m] of a loop, and between the old places that are tried for one key scan.
LEAST_DISTANCE = 6.0

# Largest distance between key scans that show the same walls [m].
NEAR = 4.0

# Drift of the front end in the position [m per metre], twice the usual one.
DRIFT = 0.01

# Drift of the front end in the heading [rad per metre], twice the usual one.
DRIFT_TURN = 0.0015

# Bounds on the standard deviation of the position in the search window [m].
LEAST_SPREAD = 0.1
MOST_SPREAD = 10.0

# Bounds on the standard deviation of the heading in the search window [rad].
LEAST_TURN_SPREAD = 0.02
MOST_TURN_SPREAD = 0.3

# Path length [m] whose drift one unmatched scan adds: a tenth of a metre, as the least window has.
LOST_LENGTH = LEAST_SPREAD / DRIFT

# Closures that must agree before any of them is accepted while the robot drives.
AGREEING = 3

# The same at the end of the drive, when they must also outnumber contradicting ones two to one.
AGREEING_AT_END = 2

# Path length [m] below which two closures are compared: that along the graph between their old key
# scans, and that along the drive between their new ones.
STRETCH = 2.0 * LEAST_DISTANCE

# Share of a match's information that its edge in the graph gets: scan and map come from the same
# drifting front end, so both are slightly bent.
MATCHING_SHARE = 0.3

# Information that each closure has at least: the standard deviations are that of the widest window
# and 1 rad.
FLOOR = np.diag([MOST_SPREAD**-2, MOST_SPREAD**-2, 1.0])


@dataclass(frozen=True, eq=False)
class Closure:
    """A loop closure: an old and a new key scan, by number, that show the same place.

    The pose (3,) of the new one, as seen from the old one, has an information matrix (3, 3). A
    certain closure was given by the user.
    """

    old: int
    new: int
    relative: Float
    information: Float
    certain: bool = False

    @cached_property
    def covariance(self) -> Float:
        """Covariance (3, 3) of the relative pose."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)


class Refusal(NamedTuple):
    """Two key scans, by number, that were compared and not joined, and the reason."""

    old: int
    new: int
    why: str


class LoopCloser:
    """Finds closures for new key scans, and accepts them once enough agree."""

    def __init__(self, mixed_pixels: MixedPixelModel) -> None:
        self.mixed_pixels = mixed_pixels
        self.keys: list[Key] = []
        self.accepted: list[Closure] = []
        # Closures that wait for others to agree with them.
        self.unconfirmed: list[Closure] = []
        # Candidates too weak to be accepted alone: another place fits nearly as well, or too few
        # points are inliers.
        self.doubtful: list[Closure] = []
        # Closures that a check rejected, and pairs of scans that the user ruled out.
        self.refused: list[Refusal] = []
        self.ruled_out: list[tuple[int, int]] = []
        self.paths = GraphPaths()
        # The next key scans are often matched with one of the last submaps.
        self._submaps = Latest(size=64)
        # Poses (k, 3) of the key scans by the graph.
        self._poses = np.empty((0, 3))
        # Distance travelled up to each key scan and up to now [m]. Turns and lost scans count as
        # the path lengths over which the robot drifts as much.
        self.driven = np.empty(0)
        self.distance = 0.0
        # The stretch that each key scan belongs to; a known place or a lost scan begins a new one.
        self._stretches = np.empty(0, np.int64)

    def drive(self, step: Float, lost: int) -> None:
        """Add a step, and the drift of a number of lost scans, to the distance travelled."""
        # A turn of one radian lets the robot drift like a path of one metre.
        self.distance += sum(size_of(step)) + LOST_LENGTH * lost

    def add_key(self, key: Key, *, new_stretch: bool = False) -> None:
        """Add the next key scan; it begins a new stretch if it is not adjacent to the last."""
        stretch = int(self._stretches[-1]) + new_stretch if self.keys else 0
        self.driven = np.append(self.driven, self.distance)
        self._stretches = np.append(self._stretches, stretch)
        self.keys.append(key)

    def search(self, poses: Float) -> list[Closure]:
        """Return the closures accepted now: that of the newest key scan, and those it confirms."""
        self._poses = poses
        closure = self._best_closure(len(self.keys) - 1)
        if closure is None:
            return []
        self.unconfirmed.append(closure)
        return self._accept(closure)

    def settle(self, poses: Float) -> None:
        """At the end of the drive, accept closures with less support, and drop outvoted ones.

        Of closures that contradict each other, those found first were accepted.
        """
        self._poses = poses
        for closure in list(self.unconfirmed):
            if closure in self.unconfirmed:
                self._accept(closure, at_end=True)
        votes = {closure: self._votes(closure, self.accepted) for closure in self.accepted}
        wrong = [
            closure
            for closure, agree in votes.items()
            if not closure.certain and 2 * sum(agree.values()) < len(agree)
        ]
        self.accepted = [closure for closure in self.accepted if closure not in wrong]
        self.unconfirmed += wrong

    def _votes(self, newest: Closure, closures: list[Closure]) -> dict[Closure, bool]:
        """Whether each closure between the same two places agrees with the newest one.

        The path between the old key scans is that along the graph: they may be from different
        visits to a place.
        """
        away = np.abs(self.driven - self.driven[newest.new])
        lengths = self.paths.lengths(newest.old, STRETCH)
        # Lists, as single numbers of arrays take ten times as long to read.
        near = (away < STRETCH).tolist()
        joined = (lengths < STRETCH).tolist()
        others = [each for each in closures if near[each.new] and joined[each.old]]
        if not others:
            return {}
        olds, news = np.array([(each.old, each.new) for each in others]).T
        agree = self._agree(others, newest, lengths[olds] + away[news])
        return dict(zip(others, agree.tolist(), strict=True))

    def _accept(self, newest: Closure, *, at_end: bool = False) -> list[Closure]:
        """Accept a closure and those that agree with it, if they outvote those that do not."""
        agrees = self._votes(newest, [*self.unconfirmed, *self.accepted])
        votes = list(agrees.values())
        support = float(votes.count(True))
        against = votes.count(False)
        if at_end:
            support += self._doubtful_support(newest)
            against *= 2
        if support < (AGREEING_AT_END if at_end else AGREEING) or support <= against:
            return []
        agreeing = [other for other in self.unconfirmed if agrees.get(other)]
        self.unconfirmed = [other for other in self.unconfirmed if other not in agreeing]
        self.accepted += agreeing
        for closure in agreeing:
            # From now on paths over the graph may take this closure. Its length is the distance
            # that leaves the robot as uncertain: a long one along a corridor.
            off = np.sqrt(np.linalg.norm(closure.covariance[:2, :2], 2)) / DRIFT
            length = max(KEY_DISTANCE, float(off))
            self.paths.link(closure.old, closure.new, length, closure.covariance)
        return agreeing

    def _doubtful_support(self, newest: Closure) -> float:
        """The support that candidates too weak to be accepted alone give a closure.

        Where scans show little, most right places are doubtful: two of these count as one closure.
        """
        agrees = self._votes(newest, self.doubtful)
        agreeing = {other.new for other, agree in agrees.items() if agree}
        others = {other.new for other in agrees} - agreeing
        return 0.5 * max(len(agreeing) - len(others), 0)

    def _best_closure(self, new: int) -> Closure | None:
        """The closure of a new key scan at the place that fits best, unless a check rejects it."""
        if not (places := self._all_places(new)):
            return None
        best = clearest(
            [(compose(self._poses[old], match.pose), worth) for old, (match, worth) in places]
        )
        old, (match, worth) = places[best or 0]
        why = "elsewhere fits as well" if best is None else ""
        if best is not None and (worth <= 0.0 or match.explained < FOUND_SHARE):
            why = "too little is explained"
        if why:
            self.doubtful += self._doubtful_places(new, places)
        else:
            why = self._contradiction(old, new, match.pose)
        if why:
            self.refused.append(Refusal(old, new, why))
            return None
        return _closure(old, new, match)

    def _contradiction(self, old: int, new: int, pose: Float) -> str:
        """What contradicts a new key scan at a pose (3,) seen from an old one; empty if nothing."""
        if any(self._near(old, one) and self._near(new, other) for one, other in self.ruled_out):
            return "ruled out"
        around = self._submap(old, new)
        if self.mixed_pixels.contradict(around.keys, self.keys[new], between(around.poses, pose)):
            return "beams pass through"
        return ""

    @staticmethod
    def _doubtful_places(new: int, places: list[tuple[int, Place]]) -> list[Closure]:
        """The places of a new key scan that may support other closures."""
        least = 0.3  # Least log odds of such a place.
        short = 1.0  # Log odds by which it may fall short of the best one.
        enough = max(least, max(place.evidence for _, place in places) - short)
        return [
            _closure(old, new, match)
            for old, (match, worth) in places
            if worth > enough and match.explained > TRACKED_SHARE
        ]

    def _all_places(self, new: int) -> list[tuple[int, Place]]:
        """The places where a new key scan fits, each with the old key scan in whose frame it is."""
        fits = self.driven < self.driven[new] - LEAST_DISTANCE
        if len(self.keys[new].surface) < LEAST_POINTS or not fits.any():
            return []
        places = list[tuple[int, Place]]()
        lengths, spreads = self.paths.spreads(new, self._poses)
        fits &= np.isfinite(lengths) & (lengths > LEAST_DISTANCE)
        away = (self._poses - self._poses[new])[:, :2]
        apart = np.hypot(*away.T)
        along = away / np.where(apart > 0.0, apart, 1.0)[:, None]
        deviation = np.sqrt(np.einsum("ki,kij,kj->k", along, spreads[:, :2, :2], along))
        fits &= apart < NEAR + DEVIATIONS * np.clip(deviation, LEAST_SPREAD, MOST_SPREAD)
        most_places = 20  # Old places that are tried for a key scan, the nearest first.
        for _ in range(most_places):
            if not fits.any():
                break
            old = int(np.where(fits, apart, np.inf).argmin())
            spread = _bounded(spreads[old])
            guess = between(self._poses[old], self._poses[new])
            places += [(old, place) for place in self._places(old, new, spread, guess)]
            # Next, an old key scan elsewhere is tried. In a small window one good match is enough;
            # in a wide one all are tried, so that a place that only looks right is not accepted.
            fits &= np.abs(self.driven - self.driven[old]) > LEAST_DISTANCE
            small = DEVIATIONS * np.sqrt(spread[:2, :2].trace()) < LEAST_DISTANCE
            if small and any(place.match.explained > CERTAIN_SHARE for _, place in places):
                break
        return places

    def _places(self, old: int, new: int, spread: Float, guess: Float) -> list[Place]:
        """The places of a new key scan in a window around a guess (3,), as seen from an old one."""
        *_, heading = self._poses[old].tolist()
        window = turned(spread, -heading)
        return self._submap(old, new).places(self.keys[new], guess, window, NEAR)

    def _submap(self, old: int, new: int) -> Submap:
        """The map of the key scans around an old one, in its frame, to match a new one with.

        The relative poses are the front end's: over a stretch this short they are better than those
        of the graph.
        """
        origin = self.keys[old].pose
        keys = tuple(self._around(old, new))
        return self._submaps.of(
            (old, keys),
            lambda: Submap(keys, between(origin, np.array([key.pose for key in keys]))),
        )

    def _around(self, old: int, new: int) -> list[Key]:
        """The key scans around an old one, from the same stretch and well before a new one."""
        submap = 5  # Key scans on each side of the old one.
        return [
            self.keys[k]
            for k in range(max(old - submap, 0), min(old + submap + 1, new))
            if self._stretches[k] == self._stretches[old]
            and self.driven[k] < self.driven[new] - LEAST_DISTANCE
        ]

    def _near(self, key: int, scan: int) -> bool:
        """Whether a key scan lies near a scan, by its number, along the path."""
        at = min(self.number_at(scan), len(self.keys) - 1)
        return bool(abs(self.driven[key] - self.driven[at]) < LEAST_DISTANCE)

    def number_at(self, scan: int) -> int:
        """The number of the first key scan at or after a scan."""
        return sum(key.scan < scan for key in self.keys)

    @property
    def refusals(self) -> list[Refusal]:
        """The pairs of key scans that were compared and not joined, with the reasons."""
        few = [Refusal(each.old, each.new, "few others agree") for each in self.unconfirmed]
        return [*self.refused, *few]

    def known(self, old: int, new: int, poses: Float) -> Closure | None:
        """The closure of two key scans that the user declares to show the same place."""
        self._poses = poses
        guess = between(poses[old], poses[new]) * [0.0, 0.0, 1.0]
        variance = 1.5**2  # Variance of the position in the window [m²]; the heading's is 1 rad².
        window = np.diag([variance, variance, 1.0])
        places = self._places(old, new, window, guess) if self._around(old, new) else ()
        if not places:
            return None
        best = max(places, key=lambda place: place.evidence)
        closure = replace(_closure(old, new, best.match), certain=True)
        self.accepted.append(closure)
        self.paths.link(old, new, KEY_DISTANCE, closure.covariance)
        return closure

    def _agree(self, others: list[Closure], newest: Closure, lengths: Float) -> Bool:
        """Whether each of the other closures (c,) agrees with the newest one.

        The two and the paths between their key scans form a loop: they agree if it closes up to
        noise. The lengths (c,) [m] are those of both paths together.
        """
        olds, news = np.array([(each.old, each.new) for each in others]).T
        fronts = np.array([self.keys[new].pose for new in news.tolist()])
        new = between(fronts, self.keys[newest.new].pose)
        old = between(self._poses[olds], self._poses[newest.old])
        relative = np.array([each.relative for each in others])
        error = between(compose(relative, new), compose(old, newest.relative))
        # Error of the position in a submap [m], to which the drift over the paths is added.
        bent_place = 0.05
        # The same of the heading [rad].
        bent_turn = 0.015
        place = bent_place + DRIFT * lengths
        turn = bent_turn + DRIFT_TURN * lengths
        lever = bent_turn * np.hypot(*old[:, :2].T)
        covariance = np.array([each.covariance for each in others]) + newest.covariance
        covariance = turned(covariance, -float(newest.relative[2]))
        place = place**2 + lever**2
        covariance[:, range(3), range(3)] += np.column_stack([place, place, turn**2])
        squares = (error * np.linalg.solve(covariance, error[:, :, None])[:, :, 0]).sum(axis=1)
        return np.asarray(squares < DEVIATIONS**2)


def _closure(old: int, new: int, match: Match) -> Closure:
    """The closure of an old and a new key scan by a match in the frame of the old one."""
    relative = between(np.zeros(3), match.pose)
    return Closure(old, new, relative, MATCHING_SHARE * fixed(match.information) + FLOOR)


def closure_edges(closures: list[Closure]) -> Records:
    """Convert closures to edges of the pose graph; those not given by the user may be wrong."""
    return edges_of(
        [closure.old for closure in closures],
        [closure.new for closure in closures],
        np.array([closure.relative for closure in closures]),
        np.array([closure.information for closure in closures]),
        FLOOR, may_be_wrong=[not closure.certain for closure in closures],
    )  # fmt: skip


def _bounded(spread: Float) -> Float:
    """A covariance (3, 3) of a search window within the bounds on its standard deviations."""
    bounded: Float = spread + np.diag(np.square([LEAST_SPREAD, LEAST_SPREAD, LEAST_TURN_SPREAD]))
    bounded[:2, :2] /= max(np.linalg.eigvalsh(bounded[:2, :2]).max() / MOST_SPREAD**2, 1.0)
    bounded[2, 2] = min(bounded[2, 2], MOST_TURN_SPREAD**2)
    return bounded


def fixed(information: Float) -> Float:
    """Remove the information (3, 3) of a match along a direction that its walls do not fix.

    Along a corridor that information comes only from the noise of the normals.
    """
    direction, weakest = weakest_direction(information)
    if weakest >= WEAK:
        return information
    across = np.eye(3)
    across[:2, :2] -= np.outer(direction, direction)
    return np.asarray(across @ information @ across)
