"""Place search: hypotheses of where a robot is on a known map, kept until one of them is left.

Key scans and their poses in a frame of the drive enter. Each scan weighs every hypothesis by how
well it fits there, against none of them: a robot may be where the map does not reach, in a room
like those on the map. The places that were certain leave.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from lrf3d.geometry import Float
from lrf3d.localization.known_places import KnownPlaces
from lrf3d.pose import between, compose, turned
from lrf3d.slam.key_scans import Key, same_place
from lrf3d.slam.motion import size_of

JUDGED, JUDGED_TURN = 0.4, 0.5
"""Hypotheses are weighed after this distance [m] or turn [rad]: scans nearer agree in any case."""

EVEN = 3.8
"""Evidence at which a place and no place are equally likely. At right places it is 5.4 ± 1.0 in
offices; the best of all wrong places reaches 3.1 ± 1.0, and in the mean over ten scans 2.8."""

GAIN = 1.5
"""Most log odds against no place that one scan adds or takes: neighbouring scans show the same
walls, which may be those of a room like it."""

BEGIN, MOST, LEAST = -3.0, 7.0, -6.0
"""Log odds of a new hypothesis; the most, so that kidnapping is noticed; and those at which it is
given up."""

CERTAIN = 0.99
"""Probability from which a place is known."""

AGAIN = 3
"""Scans that are weighed between searches of the whole map, while no place is known."""

REMEMBERED, TRIED = 8, 12
"""Number of earlier scans that weigh new hypotheses, and of hypotheses that are weighed so."""

OFF = np.diag([0.1**2, 0.1**2, 0.05**2])
"""Covariance of a step of a hypothesis, before it is matched [m²], [rad²]."""


@dataclass(slots=True, eq=False)
class Hypothesis:
    """A pose (3,) where the robot may be, its log odds against no place, and poses by scans.

    The last scan that supported it is ``sure``, by its number.
    """

    pose: Float
    log_odds: float = BEGIN
    path: dict[int, Float] = field(default_factory=dict)
    sure: int = -1


@dataclass(slots=True, eq=False)
class Found:
    """A place that was certain: poses (3,) by numbers of scans, up to the last certain one."""

    place: Hypothesis
    probability: float = 0.0
    path: dict[int, Float] = field(default_factory=dict)
    last: int = 0


@dataclass(slots=True, eq=False)
class _Weighed:
    """A scan that was weighed: its number, its pose (3,) in the drive, and its best evidence."""

    number: int
    scan: Key
    pose: Float
    best: float = -np.inf


class PlaceSearch:
    """Weighs places on a known map."""

    def __init__(self, places: KnownPlaces) -> None:
        self._places = places
        self.hypotheses: list[Hypothesis] = []
        self.found: list[Found] = []
        self._moved = np.array([np.inf, np.inf])
        self._pose: Float | None = None
        self._before: deque[_Weighed] = deque(maxlen=REMEMBERED)
        self._count = 0

    def see(self, number: int, scan: Key, pose: Float) -> None:
        """Take in a scan, by its number, at a pose (3,) in a frame of the drive."""
        step = np.zeros(3) if self._pose is None else between(self._pose, pose)
        self._pose = pose
        for each in self.hypotheses:
            each.pose = compose(each.pose, step)
        self._moved += size_of(step)
        if (self._moved >= [JUDGED, JUDGED_TURN]).any() and len(scan.hits):
            self._moved[:] = 0.0
            self._weigh_all(number, scan, pose)
        if place := self.place:
            if not self.found or self.found[-1].place is not place:
                self.found.append(Found(place))
            found = self.found[-1]
            found.probability = max(self.probability, found.probability)
            found.path = {k: there for k, there in place.path.items() if k <= place.sure}
            found.last = number if place.sure == max(place.path) else place.sure

    def _weigh_all(self, number: int, scan: Key, pose: Float) -> None:
        """Weigh all hypotheses by a scan, and search for new ones while no place is known."""
        now = _Weighed(number, scan, pose)
        self._weigh(self.hypotheses, now)
        if self.probability < CERTAIN and self._count % AGAIN == 0:
            found = self._places.search(scan)[:TRIED]
            now.best = max([now.best, *(each.evidence for each in found)])
            new = [Hypothesis(each.match.pose) for each in found]
            for each, weighed in zip(new, found, strict=True):
                _add(each, now, weighed.evidence)
            self._remember(new, pose)
            self.hypotheses += new
        self._count += 1
        self._before.append(now)
        # Unlikely hypotheses are dropped, and of those that have met all but the best.
        most = max((each.log_odds for each in self.hypotheses), default=0.0)
        ranked = sorted(self.hypotheses, key=lambda one: -one.log_odds)
        self.hypotheses = []
        for each in ranked:
            each.log_odds -= max(most - MOST, 0.0)
            met = any(same_place(each.pose, other.pose, 2.0) for other in self.hypotheses)
            if each.log_odds > LEAST and not met:
                self.hypotheses.append(each)

    def _remember(self, new: list[Hypothesis], pose: Float) -> None:
        """Weigh new hypotheses by the scans before, as far back as these support them.

        Where they do not, the robot may have been put there since.
        """
        earlier = [Hypothesis(each.pose, each.log_odds, dict(each.path)) for each in new]
        for before in reversed(self._before):
            back = between(pose, before.pose)
            for each, now in zip(earlier, new, strict=True):
                each.pose = compose(now.pose, back)
            self._weigh(earlier, before)
            for each, now in zip(earlier, new, strict=True):
                if each.log_odds > now.log_odds:
                    now.log_odds, now.path = each.log_odds, dict(each.path)
                    now.sure = max(now.sure, each.sure)

    def _weigh(self, hypotheses: list[Hypothesis], now: _Weighed) -> None:
        """Weigh hypotheses by a scan."""
        worth = []
        for each in hypotheses:
            *_, heading = each.pose.tolist()
            found = self._places.judged(now.scan, each.pose, turned(np.linalg.inv(OFF), heading))
            worth.append(-np.inf if found is None else found.evidence)
            each.pose = each.pose if found is None else found.match.pose
        now.best = max([now.best, *worth])
        for each, evidence in zip(hypotheses, worth, strict=True):
            _add(each, now, evidence)

    @property
    def probability(self) -> float:
        """The probability of the best hypothesis, against all others and no place."""
        odds = np.exp([each.log_odds for each in self.hypotheses])
        return float(odds.max(initial=0.0) / (1.0 + odds.sum()))

    @property
    def place(self) -> Hypothesis | None:
        """The one hypothesis that is left; None as long as it is not certain."""
        return self.hypotheses[0] if self.probability >= CERTAIN else None


def _add(place: Hypothesis, now: _Weighed, evidence: float) -> None:
    """Add a scan's evidence for a place: bounded against no place, in full against others."""
    gain = float(np.clip(now.best - EVEN, -GAIN, GAIN))
    gain -= min(now.best - evidence, 2.0 * GAIN)
    place.log_odds += gain
    place.path[now.number] = place.pose
    if gain > 0.0:
        place.sure = max(place.sure, now.number)
