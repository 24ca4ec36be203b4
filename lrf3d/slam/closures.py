"""Loop closures: key scans that show the same place as much older ones.

Key scans and their estimated poses enter; relative poses between key scans leave. Each was checked:
the scans overlap, no beam of the one passes through what the other saw, no other place fits as well
within all that the drive may have drifted, and enough closures of the same stretch agree.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Float, wrap_angle
from lrf3d.pose import between, compose, turned
from lrf3d.slam.front_end import WEAK, weakest_direction
from lrf3d.slam.pose_graph import Edges, GraphPaths
from lrf3d.slam.scan_matching import Match
from lrf3d.slam.search import DEVIATIONS as WINDOW_DEVIATIONS
from lrf3d.slam.search import field_of, search
from lrf3d.slam.surface import wall_map
from lrf3d.slam.views import Key, clearest, evidence
from lrf3d.slam.violation import MixedPixels

LEAST_DISTANCE = 6.0
"""Two key scans are worth closing a loop if the path between them along the graph is longer [m]."""

LEAST_SHARE = 0.6
"""A place that explains this share of a scan is beyond doubt: no other is tried."""

LEAST_FOUND = 0.3
"""A closure explains at least this share: in woods it is hardly half at the right place."""

NEAR = 4.0
"""Key scans up to this far apart [m] may show the same walls."""

DRIFT, DRIFT_TURN = 0.01, 0.0015
"""How much farther [m], [rad] a robot may be off after each metre: twice what is usual."""

LEAST_SPREAD, MOST_SPREAD = np.array([0.1, 0.1, 0.02]), np.array([10.0, 10.0, 0.3])
"""Bounds of the standard deviations [m], [rad] of the window that is searched."""

LOST = 10.0
"""Distance [m] over which a robot drifts as far as in one scan that matches nothing: 0.1 m."""

MOST_TRIES, MOST_PLACES = 6, 20
"""Old places that are tried for each new key scan: in a small window, where they show the same, and
in a wide one, the nearest first. If it holds more, those that were found are judged."""

OTHER_PLACE = 6.0
"""The next one that is tried lies farther from the last than this along the path [m]."""

SUBMAP = 5
"""Key scans before and after an old one that make the map a loop is closed with."""

LEAST_POINTS = 10
"""Points that a surface must have."""

CLOSURE_LENGTH = 0.5
"""What a closure counts as in path lengths along the graph [m]: the drift that it leaves."""

AGREEING, AGREEING_IN_THE_END = 3, 2
"""Closures that have to agree with each other before any of them is accepted: while the robot
drives, and when the drive is over, if no other contradicts them."""

STRETCH = 12.0
"""Closures are compared if the old key scans of both are this near along the graph [m], and the new
ones along the drive."""

DEVIATIONS = 3.5
"""Two closures agree if the loop that they form closes within this many deviations."""

CLOSURE_SHARE = 0.3
"""Share of the matching's information that a closure's edge counts with: old and new map were drawn
by the same drifting front end, and both are bent a little."""

KNOWN = np.diag([1.5**2, 1.5**2, 1.0])
"""Covariance of the window in which a closure is searched that somebody knows [m²], [rad²]."""

FLOOR = np.diag([0.01, 0.01, 1.0])
"""Information that a closure has in any direction: 10 m and 1 rad, as it lay in the window."""


@dataclass(frozen=True, eq=False)
class Closure:
    """An old key scan and a new one, by their numbers, that show the same place.

    The pose (3,) and its information (3, 3) are those of the new one, as seen from the old one.
    """

    old: int
    new: int
    relative: Float
    information: Float

    @cached_property
    def covariance(self) -> Float:
        """Covariance (3, 3) of the pose, which each later closure around is compared with."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)


class Refusal(NamedTuple):
    """Two key scans, by their numbers, that were not taken for the same place, and why."""

    old: int
    new: int
    why: str


class Place(NamedTuple):
    """Where a key scan may have been taken, as seen from an old one, and what speaks for it."""

    old: int
    match: Match
    evidence: float


class LoopCloser:
    """Finds closures for new key scans, and keeps them until enough agree."""

    def __init__(self, mixed_pixels: MixedPixels) -> None:
        self.mixed_pixels = mixed_pixels
        self.keys: list[Key] = []
        self.accepted: list[Closure] = []
        # Those that were found, but too few others agree with them.
        self.unconfirmed: list[Closure] = []
        # Those that were found, but something speaks against them; and what somebody ruled out.
        self.refused: list[Refusal] = []
        self.ruled_out: list[tuple[int, int]] = []
        self.paths = GraphPaths()
        # Poses (k, 3) of the key scans by the graph.
        self._poses = np.empty((0, 3))
        # How far the robot had driven at each key scan [m], and by now.
        self.driven = np.empty(0)
        self.distance = 0.0
        # Key scans that follow each other without a known place or a lost scan between them.
        self._stretches = np.empty(0, np.int64)

    def drive(self, step: Float, lost: int) -> None:
        """Add to the distance that the robot has driven, by how far it drifts."""
        # A turn in place lets the robot drift like a path of the length of its lever.
        self.distance += float(np.hypot(step[0], step[1]) + abs(step[2])) + LOST * lost

    def add_key(self, key: Key, *, apart: bool = False) -> None:
        """Take in the next key scan, which a known place may part from the one before."""
        stretch = int(self._stretches[-1]) + apart if self.keys else 0
        self.driven = np.append(self.driven, self.distance)
        self._stretches = np.append(self._stretches, stretch)
        self.keys.append(key)

    def link(self, edge: Edges, length: float) -> None:
        """Note the path to the next key scan."""
        ends = int(edge.first[0]), int(edge.second[0])
        self.paths.link(*ends, length, np.linalg.inv(edge.information[0]))

    def search(self, poses: Float) -> list[Closure]:
        """Closures that are accepted now: of the newest key scan, and older ones it confirms."""
        self._poses = poses
        closure = self._found(len(self.keys) - 1)
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
        votes = [self._votes(closure, self.accepted) for closure in self.accepted]
        wrong = [
            closure
            for closure, agree in zip(self.accepted, votes, strict=True)
            if 2 * sum(agree.values()) < len(agree)
        ]
        self.accepted = [closure for closure in self.accepted if closure not in wrong]
        self.unconfirmed += wrong

    def _votes(self, newest: Closure, closures: list[Closure]) -> dict[Closure, bool]:
        """Which closures agree with another, of those that join the same two places.

        Old key scans of several drives past a place are near each other along the graph.
        """
        lengths = self.paths.lengths(newest.old, STRETCH)
        away = np.abs(self.driven - self.driven[newest.new])
        return {
            other: self._agree(other, newest, float(lengths[other.old] + away[other.new]))
            for other in closures
            if lengths[other.old] < STRETCH and away[other.new] < STRETCH
        }

    def _accept(self, newest: Closure, enough: int, *, strict: bool = False) -> list[Closure]:
        """Accept a closure and those that agree with it, if these are enough."""
        waiting = self._votes(newest, self.unconfirmed)
        votes = [*waiting.values(), *self._votes(newest, self.accepted).values()]
        # Of sets that contradict each other the larger one is accepted.
        together, against = votes.count(True), votes.count(False)
        if together < enough or together <= against or (strict and against):
            return []
        agreeing = [other for other, agrees in waiting.items() if agrees]
        self.unconfirmed = [other for other in self.unconfirmed if other not in agreeing]
        self.accepted += agreeing
        for closure in agreeing:
            # A path over the graph from now on. Along a corridor it leaves the robot as uncertain
            # as a long drive does.
            off = np.sqrt(np.linalg.eigvalsh(closure.covariance[:2, :2])[1]) / DRIFT
            length = max(CLOSURE_LENGTH, float(off))
            self.paths.link(closure.old, closure.new, length, closure.covariance)
        return agreeing

    def _found(self, new: int) -> Closure | None:
        """The closure of a key scan with an old one, at the place that fits best of all."""
        poses = self._poses
        if len(self.keys[new].surface) < LEAST_POINTS:
            return None
        fits = self.driven < self.driven[new] - LEAST_DISTANCE
        if not fits.any():
            return None
        lengths, spreads = self.paths.spreads(new, poses)
        fits &= np.isfinite(lengths) & (lengths > LEAST_DISTANCE)
        away = poses[:, :2] - poses[new, :2]
        apart = np.hypot(away[:, 0], away[:, 1])
        along = away / np.maximum(apart, 1e-9)[:, None]
        sideways = np.sqrt(np.einsum("ki,kij,kj->k", along, spreads[:, :2, :2], along))
        deviation = np.clip(sideways, LEAST_SPREAD[0], MOST_SPREAD[0])
        fits &= apart < NEAR + WINDOW_DEVIATIONS * deviation
        places: list[Place] = []
        tries = 0
        while fits.any():
            old = int(np.where(fits, apart, np.inf).argmin())
            spread = _bounded(spreads[old])
            places += self._places(old, new, spread)
            # The next try is at another place than this one; where the window is small, one that
            # shows the place is enough. In a wide one all are tried, or else a place that looks
            # like the right one would be believed.
            fits &= np.abs(self.driven - self.driven[old]) > OTHER_PLACE
            small = WINDOW_DEVIATIONS * np.sqrt(spread[:2, :2].trace()) < OTHER_PLACE
            tries += 1
            seen = any(place.match.explained > LEAST_SHARE for place in places)
            if small and (seen or tries == MOST_TRIES):
                break
            if tries == MOST_PLACES:
                break
        there = [compose(poses[place.old], place.match.pose) for place in places]
        best = clearest(there, [place.evidence for place in places])
        if best is None:
            if places:
                self.refused.append(Refusal(places[0].old, new, "elsewhere fits as well"))
            return None
        old, match, worth = places[best]
        around, seen_from = self._submap(old, new)
        back = between(seen_from, match.pose)
        why = ""
        if worth <= 0.0 or match.explained < LEAST_FOUND:
            why = "too little is explained"
        elif any(self._near(old, one) and self._near(new, other) for one, other in self.ruled_out):
            why = "ruled out"
        elif self.mixed_pixels.contradict(around, self.keys[new], back):
            why = "beams pass through"
        if why:
            self.refused.append(Refusal(old, new, why))
            return None
        return self._closure(old, new, match)

    def _closure(self, old: int, new: int, match: Match) -> Closure:
        """The closure of a match of a new key scan around an old one."""
        relative = np.array([*match.pose[:2], wrap_angle(match.pose[2])])
        return Closure(old, new, relative, CLOSURE_SHARE * fixed(match.information) + FLOOR)

    def _submap(self, old: int, new: int) -> tuple[list[Key], Float]:
        """The key scans of the map that a new one is matched with where it meets an old one.

        Their poses (k, 3) are as seen from the old one, and by the front end: over a stretch so
        short these are better than those of the graph.
        """
        around = [
            self.keys[k]
            for k in range(max(old - SUBMAP, 0), min(old + SUBMAP + 1, new))
            if self._stretches[k] == self._stretches[old]
            and self.driven[k] < self.driven[new] - LEAST_DISTANCE
        ]
        return around, between(self.keys[old].pose, np.array([key.pose for key in around]))

    def _near(self, key: int, scan: int) -> bool:
        """Whether a key scan lies near a scan, by its number, along the path."""
        at = min(self.number_at(scan), len(self.keys) - 1)
        return bool(abs(self.driven[key] - self.driven[at]) < OTHER_PLACE)

    def number_at(self, scan: int) -> int:
        """The number of the first key scan from a scan on."""
        return sum(key.scan < scan for key in self.keys)

    @property
    def refusals(self) -> list[Refusal]:
        """The pairs of key scans that were not taken for one place, and why."""
        few = [Refusal(each.old, each.new, "few others agree") for each in self.unconfirmed]
        return [*self.refused, *few]

    def known(self, old: int, new: int, poses: Float) -> Closure | None:
        """The closure of two key scans of which somebody knows that they show the same place."""
        self._poses = poses
        guess = np.array([0.0, 0.0, between(poses[old], poses[new])[2]])
        places = self._places(old, new, KNOWN, guess)
        if not places:
            return None
        best = max(places, key=lambda place: place.evidence)
        closure = self._closure(old, new, best.match)
        self.accepted.append(closure)
        self.paths.link(old, new, CLOSURE_LENGTH, closure.covariance)
        return closure

    def _places(self, old: int, new: int, spread: Float, guess: Float | None = None) -> list[Place]:
        """The places of a new key scan in a window around an old one, or around a guess there."""
        around, seen_from = self._submap(old, new)
        grid = wall_map((key.walls, pose) for key, pose in zip(around, seen_from, strict=True))
        if grid is None or len(grid.surface) < LEAST_POINTS:
            return []
        scan, field = self.keys[new], field_of(around, seen_from)
        if guess is None:
            guess = between(self._poses[old], self._poses[new])
        window = turned(spread, -float(self._poses[old, 2]))
        found = search(scan, grid, field, guess, window, NEAR)
        return [
            Place(
                old,
                match,
                evidence(scan.hits, match.explained, between(seen_from, match.pose), around),
            )
            for match in found
        ]

    def _agree(self, first: Closure, second: Closure, length: float) -> bool:
        """Whether the loop over two closures closes, whose paths between have a length [m]."""
        if first is second:
            return True
        old = between(self._poses[first.old], self._poses[second.old])
        new = between(self.keys[first.new].pose, self.keys[second.new].pose)
        error = between(compose(first.relative, new), compose(old, second.relative))
        place, turn = 0.05 + DRIFT * length, 0.015 + DRIFT_TURN * length
        spread = np.array([place, place, turn])
        lever = np.hypot(old[0], old[1]) * 0.015
        covariance = np.diag(spread**2 + np.array([lever, lever, 0.0]) ** 2)
        for closure in (first, second):
            covariance = covariance + turned(closure.covariance, -float(second.relative[2]))
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


def _bounded(spread: Float) -> Float:
    """A covariance (3, 3) of a window, neither so small nor so large as to be of no use."""
    bounded = spread + np.diag(LEAST_SPREAD**2)
    most = np.linalg.norm(bounded[:2, :2], 2) / MOST_SPREAD[0] ** 2
    bounded[:2, :2] /= max(most, 1.0)
    bounded[2, 2] = min(bounded[2, 2], MOST_SPREAD[2] ** 2)
    return bounded


def fixed(information: Float) -> Float:
    """Information (3, 3) of a match without that on a direction which its walls do not fix.

    What it says of the distance along a corridor comes from the noise of normals.
    """
    direction, weakest = weakest_direction(information)
    if weakest >= WEAK:
        return information
    across = np.eye(3)
    across[:2, :2] -= np.outer(direction, direction)
    return np.asarray(across @ information @ across)
