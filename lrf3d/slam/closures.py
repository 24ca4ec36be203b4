"""Loop closures: key scans that show the same place as much older ones.

Key scans and their estimated poses enter; relative poses between key scans leave. Each was checked:
the scans overlap, no beam of the one passes through what the other saw, no other place fits as well
within all that the drive may have drifted, and enough closures of the same stretch agree.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Bool, Float, Records
from lrf3d.geometry.pose import between, compose, turned
from lrf3d.matching.key_scans import Key, MixedPixels
from lrf3d.matching.scan_matching import Match
from lrf3d.matching.search import DEVIATIONS, Place, Submap, clearest
from lrf3d.slam.front_end import (
    CERTAIN_SHARE,
    FOUND_SHARE,
    KEY_DISTANCE,
    LEAST_POINTS,
    WEAK,
    weakest_direction,
)
from lrf3d.slam.motion import size_of
from lrf3d.slam.pose_graph import GraphPaths, edges_of

# Least path length [m] over which a loop is closed, and between the old places that are tried.
LEAST_DISTANCE = 6.0

# Largest distance between key scans that show the same walls [m].
NEAR = 4.0

# Drift of the front end [m], [rad] per metre: twice the usual drift.
DRIFT = 0.01
DRIFT_TURN = 0.0015

# Bounds of the standard deviations [m], [rad] of the window that is searched.
LEAST_SPREAD = np.array([0.1, 0.1, 0.02])
MOST_SPREAD = np.array([10.0, 10.0, 0.3])

# Closures that must agree before any of them is accepted: while the robot drives, and when the
# drive is over, if they are more than twice as many as contradict them.
AGREEING = 3
AGREEING_IN_THE_END = 2

# Closures are compared if the old key scans of both are this near along the graph [m], and the new
# ones along the drive.
STRETCH = 2.0 * LEAST_DISTANCE

# Factor on the information that matching gives an edge: the scan and the map come from the same
# drifting front end, and are slightly bent.
MATCHING_SHARE = 0.3

# Least information of a closure in any direction: 10 m and 1 rad, the size of the window.
FLOOR = np.diag([0.01, 0.01, 1.0])


@dataclass(frozen=True, eq=False)
class Closure:
    """An old key scan and a new one, by their numbers, that show the same place.

    The pose (3,) and its information (3, 3) are those of the new one, as seen from the old one. A
    certain closure is one that the user gave.
    """

    old: int
    new: int
    relative: Float
    information: Float
    certain: bool = False

    @cached_property
    def covariance(self) -> Float:
        """Covariance (3, 3) of the pose, which each later closure around is compared with."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)


class Refusal(NamedTuple):
    """Two key scans, by their numbers, that were not taken for the same place, and why."""

    old: int
    new: int
    why: str


class LoopCloser:
    """Finds closures for new key scans, and keeps them until enough agree."""

    def __init__(self, mixed_pixels: MixedPixels) -> None:
        self.mixed_pixels = mixed_pixels
        self.keys: list[Key] = []
        self.accepted: list[Closure] = []
        # Closures that too few others agree with.
        self.unconfirmed: list[Closure] = []
        # Places that alone are none: others fit nearly as well, or too little is explained.
        self.doubtful: list[Closure] = []
        # Closures that are contradicted, and pairs of scans that the user ruled out.
        self.refused: list[Refusal] = []
        self.ruled_out: list[tuple[int, int]] = []
        self.paths = GraphPaths()
        self._submaps: dict[tuple[int, tuple[Key, ...]], Submap] = {}
        # Poses (k, 3) of the key scans by the graph.
        self._poses = np.empty((0, 3))
        # The distance at each key scan [m], and now.
        self.driven = np.empty(0)
        self.distance = 0.0
        # The number of the stretch of each key scan, without a known place or a lost scan in it.
        self._stretches = np.empty(0, np.int64)

    def drive(self, step: Float, lost: int) -> None:
        """Add a step and a number of lost scans to the distance, by the drift that they cause."""
        lost_length = 10.0  # Path length [m] with the same drift, 0.1 m, as one unmatched scan.
        # A turn of one radian lets the robot drift like a path of one metre.
        self.distance += sum(size_of(step)) + lost_length * lost

    def add_key(self, key: Key, *, apart: bool = False) -> None:
        """Add the next key scan, which begins another stretch if it stands apart from the last."""
        stretch = int(self._stretches[-1]) + apart if self.keys else 0
        self.driven = np.append(self.driven, self.distance)
        self._stretches = np.append(self._stretches, stretch)
        self.keys.append(key)

    def search(self, poses: Float) -> list[Closure]:
        """Closures that are accepted now: of the newest key scan, and older ones it confirms."""
        self._poses = poses
        closure = self._best_closure(len(self.keys) - 1)
        if closure is None:
            return []
        self.unconfirmed.append(closure)
        return self._accept(closure, AGREEING)

    def settle(self, poses: Float) -> None:
        """Accept closures that fewer confirm, now that the drive is over, and take wrong ones back.

        Of closures that contradict each other those that came first were accepted.
        """
        self._poses = poses
        for closure in list(self.unconfirmed):
            if closure in self.unconfirmed:
                self._accept(closure, AGREEING_IN_THE_END, strict=True)
        votes = {closure: self._votes(closure, self.accepted) for closure in self.accepted}
        wrong = [
            closure
            for closure, agree in votes.items()
            if not closure.certain and 2 * sum(agree.values()) < len(agree)
        ]
        self.accepted = [closure for closure in self.accepted if closure not in wrong]
        self.unconfirmed += wrong

    def _votes(self, newest: Closure, closures: list[Closure]) -> dict[Closure, bool]:
        """Whether each of the closures that join the same two places agrees with the newest one.

        Old key scans of several drives past a place are near each other along the graph.
        """
        pairs = np.array([(each.old, each.new) for each in closures], np.int64)
        olds, news = pairs.reshape(-1, 2).T
        lengths = self.paths.lengths(newest.old, STRETCH)[olds]
        away = np.abs(self.driven[news] - self.driven[newest.new])
        near = np.flatnonzero((lengths < STRETCH) & (away < STRETCH))
        others = [closures[k] for k in near.tolist()]
        agree = self._agree(others, newest, (lengths + away)[near]) if others else near
        return dict(zip(others, agree.tolist(), strict=True))

    def _accept(self, newest: Closure, enough: int, *, strict: bool = False) -> list[Closure]:
        """Accept a closure and those that agree with it, if these are enough."""
        agrees = self._votes(newest, [*self.unconfirmed, *self.accepted])
        votes = list(agrees.values())
        # Of sets that contradict each other the larger one is accepted.
        together = float(votes.count(True))
        against = votes.count(False)
        if strict:
            doubtful = self._votes(newest, self.doubtful)
            agreeing_scans = {other.new for other, agree in doubtful.items() if agree}
            others = {other.new for other in doubtful} - agreeing_scans
            # Where scans show little, most of the right places are doubtful: two count as one.
            together += 0.5 * max(len(agreeing_scans) - len(others), 0)
        if together < enough or together <= against or (strict and together <= 2.0 * against):
            return []
        agreeing = [other for other in self.unconfirmed if agrees.get(other)]
        self.unconfirmed = [other for other in self.unconfirmed if other not in agreeing]
        self.accepted += agreeing
        for closure in agreeing:
            # From now on paths over the graph may take it. Along a corridor it leaves the robot as
            # uncertain as a long drive does.
            off = np.sqrt(np.linalg.norm(closure.covariance[:2, :2], 2)) / DRIFT
            length = max(KEY_DISTANCE, float(off))
            self.paths.link(closure.old, closure.new, length, closure.covariance)
        return agreeing

    def _best_closure(self, new: int) -> Closure | None:
        """The closure of a key scan with an old one, at the place that fits best of all."""
        if not (places := self._all_places(new)):
            return None
        there = [compose(self._poses[old], place.match.pose) for old, place in places]
        best = clearest(there, [place.evidence for _, place in places])
        old, (match, worth) = places[best or 0]
        around = self._submap(old, new)
        why = ""
        if best is None or worth <= 0.0 or match.explained < FOUND_SHARE:
            why = "elsewhere fits as well" if best is None else "too little is explained"
            self.doubtful += self._doubtful_places(new, places)
        elif any(self._near(old, one) and self._near(new, other) for one, other in self.ruled_out):
            why = "ruled out"
        elif self.mixed_pixels.contradict(
            around.keys, self.keys[new], around.seen_from(match.pose)
        ):
            why = "beams pass through"
        if why:
            self.refused.append(Refusal(old, new, why))
            return None
        return _closure(old, new, match)

    @staticmethod
    def _doubtful_places(new: int, places: list[tuple[int, Place]]) -> list[Closure]:
        """The places of a new key scan that may be right."""
        # Log odds that a place must have, log odds by which it may fall short of the best one, and
        # share of the scan that it must explain: a third of what a closure must.
        least = 0.3
        short = 1.0
        share = 0.1
        enough = max(least, max(place.evidence for _, place in places) - short)
        return [
            _closure(old, new, place.match)
            for old, place in places
            if place.evidence > enough and place.match.explained > share
        ]

    def _all_places(self, new: int) -> list[tuple[int, Place]]:
        """Pairs of an old key scan near a new one, and a place of the new one in its frame."""
        fits = self.driven < self.driven[new] - LEAST_DISTANCE
        if len(self.keys[new].surface) < LEAST_POINTS or not fits.any():
            return []
        poses = self._poses
        places = list[tuple[int, Place]]()
        lengths, spreads = self.paths.spreads(new, poses)
        fits &= np.isfinite(lengths) & (lengths > LEAST_DISTANCE)
        away = (poses - poses[new])[:, :2]
        apart = np.hypot(*away.T)
        along = away / np.maximum(apart, 1e-9)[:, None]
        deviation = np.sqrt(np.einsum("ki,kij,kj->k", along, spreads[:, :2, :2], along))
        least, *_ = LEAST_SPREAD
        most, *_ = MOST_SPREAD
        fits &= apart < NEAR + DEVIATIONS * np.clip(deviation, least, most)
        most_places = 20  # Most old places that are tried for a key scan, the nearest first.
        for _ in range(most_places):
            if not fits.any():
                break
            old = int(np.where(fits, apart, np.inf).argmin())
            spread = _bounded(spreads[old])
            guess = between(poses[old], poses[new])
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
        """The map that a new key scan is matched with where it meets an old one.

        The poses are as seen from the old one, and by the front end: over a stretch so short these
        are better than those of the graph.
        """
        around = tuple(self._around(old, new))
        if (known := self._submaps.pop((old, around), None)) is None:
            poses = np.array([key.pose for key in around])
            known = Submap(around, between(self.keys[old].pose, poses))
        # The last ones are kept, as the next key scan often meets the same.
        self._submaps[old, around] = known
        most_submaps = 16
        for oldest in list(self._submaps)[:-most_submaps]:
            del self._submaps[oldest]
        return known

    def _around(self, old: int, new: int) -> list[Key]:
        """The key scans around an old one, some way before a new one."""
        submap = 5  # Key scans before and after an old one in the map that a loop is closed with.
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
        """The number of the first key scan from a scan on."""
        return sum(key.scan < scan for key in self.keys)

    @property
    def refusals(self) -> list[Refusal]:
        """The pairs of key scans that were not taken for one place, and why."""
        few = [Refusal(each.old, each.new, "few others agree") for each in self.unconfirmed]
        return [*self.refused, *few]

    def known(self, old: int, new: int, poses: Float) -> Closure | None:
        """The closure of two key scans that the user knows to show the same place."""
        self._poses = poses
        guess = between(poses[old], poses[new]) * [0.0, 0.0, 1.0]
        window = np.diag([1.5**2, 1.5**2, 1.0])  # Its covariance [m²], [rad²].
        places = self._places(old, new, window, guess) if self._around(old, new) else ()
        if not places:
            return None
        best = max(places, key=lambda place: place.evidence)
        closure = replace(_closure(old, new, best.match), certain=True)
        self.accepted.append(closure)
        self.paths.link(old, new, KEY_DISTANCE, closure.covariance)
        return closure

    def _agree(self, others: list[Closure], newest: Closure, lengths: Float) -> Bool:
        """Whether loops over others (c,) and the newest one close: paths between of lengths [m]."""
        olds, news = np.array([(each.old, each.new) for each in others]).T
        fronts = np.array([self.keys[new].pose for new in news.tolist()])
        new = between(fronts, self.keys[newest.new].pose)
        old = between(self._poses[olds], self._poses[newest.old])
        relative = np.array([each.relative for each in others])
        error = between(compose(relative, new), compose(old, newest.relative))
        # Errors of a submap [m], [rad], to which the drift over the length is added.
        bent_place = 0.05
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
    """The closure of a match of a new key scan around an old one."""
    relative = between(np.zeros(3), match.pose)
    return Closure(old, new, relative, MATCHING_SHARE * fixed(match.information) + FLOOR)


def closure_edges(closures: list[Closure]) -> Records:
    """Closures as edges of the pose graph, which are robust unless they are certain."""
    return edges_of(
        [closure.old for closure in closures],
        [closure.new for closure in closures],
        np.array([closure.relative for closure in closures]),
        np.array([closure.information for closure in closures]),
        FLOOR, robust=[not closure.certain for closure in closures],
    )  # fmt: skip


def _bounded(spread: Float) -> Float:
    """A covariance (3, 3) of a window within `LEAST_SPREAD` and `MOST_SPREAD`."""
    bounded = spread + np.diag(LEAST_SPREAD**2)
    place, _, turn = MOST_SPREAD**2
    bounded[:2, :2] /= max(np.linalg.norm(bounded[:2, :2], 2) / place, 1.0)
    bounded[2, 2] = min(bounded[2, 2], turn)
    return bounded


def fixed(information: Float) -> Float:
    """Information (3, 3) of a match without that on a direction which its walls do not fix.

    Along a corridor it comes from the noise of normals.
    """
    direction, weakest = weakest_direction(information)
    if weakest >= WEAK:
        return information
    across = np.eye(3)
    across[:2, :2] -= np.outer(direction, direction)
    return np.asarray(across @ information @ across)
