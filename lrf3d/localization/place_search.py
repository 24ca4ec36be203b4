"""Place search: hypotheses of where a robot is on a known map, kept until one of them is left.

Scans and the steps between them enter. Each scan weighs every hypothesis by how well it fits there,
against none of them: a robot may be where the map does not reach, in a room like those on the map.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from lrf3d.geometry import Float
from lrf3d.localization.known_places import KnownPlaces
from lrf3d.pose import between, compose, turned
from lrf3d.slam.views import Key, same_place

JUDGED, JUDGED_TURN = 0.4, 0.5
"""Hypotheses are weighed after this distance [m] or turn [rad]: scans nearer agree in any case."""

EVEN = 3.8
"""Evidence that speaks as much for a place as for none. At right places it is 5.4 ± 1.0 in offices;
the best of all wrong places reaches 3.1 ± 1.0, and in the mean over ten scans 2.8."""

GAIN = 1.5
"""Log odds against no place that one scan adds or takes, at most: neighbouring scans show the same
walls, which may be those of a room like it."""

BEGIN, MOST, LEAST = -3.0, 7.0, -6.0
"""Log odds of a new hypothesis; the most, so that kidnapping is noticed; and those at which it is
given up."""

CERTAIN = 0.99
"""Probability from which on a place is known."""

AGAIN = 3
"""Scans that are weighed from one search of the whole map to the next, while no place is known."""

REMEMBERED, TRIED = 8, 12
"""Number of earlier scans that weigh new hypotheses, and of hypotheses that are weighed so."""

OFF = np.diag([0.1**2, 0.1**2, 0.05**2])
"""Covariance of a step of a hypothesis, before it is matched [m²], [rad²]."""


@dataclass(slots=True, eq=False)
class Hypothesis:
    """A pose (3,) where the robot may be, its log odds against no place, and poses by scans.

    The last scan that spoke for it is ``sure``, by its number.
    """

    pose: Float
    log_odds: float = BEGIN
    path: dict[int, Float] = field(default_factory=dict)
    sure: int = -1


@dataclass(slots=True, eq=False)
class _Weighed:
    """A scan that was weighed: its number, its pose (3,) by steps, and its best evidence."""

    number: int
    scan: Key
    pose: Float
    best: float


class PlaceSearch:
    """Weighs places on a known map."""

    def __init__(self, places: KnownPlaces) -> None:
        self._places = places
        self.hypotheses: list[Hypothesis] = []
        self._moved = np.array([np.inf, np.inf])
        self._pose = np.zeros(3)
        self._before: deque[_Weighed] = deque(maxlen=REMEMBERED)
        self._count = 0

    def see(self, number: int, scan: Key, step: Float) -> None:
        """Take in a scan, by its number, and the step (3,) since the one before."""
        self._pose = compose(self._pose, step)
        for each in self.hypotheses:
            each.pose = compose(each.pose, step)
        self._moved += [np.hypot(step[0], step[1]), abs(step[2])]
        if (self._moved < [JUDGED, JUDGED_TURN]).all() or not len(scan.hits):
            return
        self._moved[:] = 0.0
        now = _Weighed(number, scan, self._pose, -np.inf)
        self._weigh(self.hypotheses, now)
        if self.probability < CERTAIN and self._count % AGAIN == 0:
            found = self._places.search(scan)[:TRIED]
            now.best = max([now.best, *(each.evidence for each in found)])
            new = [Hypothesis(each.match.pose) for each in found]
            for each, weighed in zip(new, found, strict=True):
                self._add(each, now, weighed.evidence)
            self._remember(new)
            self.hypotheses += new
        self._count += 1
        self._before.append(now)
        self._choose()

    def _remember(self, new: list[Hypothesis]) -> None:
        """Weigh new hypotheses by the scans before, as far back as these speak for them.

        Where they do not, the robot may have been put there since.
        """
        earlier = [Hypothesis(each.pose, each.log_odds, dict(each.path)) for each in new]
        for before in reversed(self._before):
            back = between(self._pose, before.pose)
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
            prior = turned(np.linalg.inv(OFF), float(each.pose[2]))
            found = self._places.judged(now.scan, each.pose, prior)
            worth.append(-np.inf if found is None else found.evidence)
            each.pose = each.pose if found is None else found.match.pose
        now.best = max([now.best, *worth])
        for each, evidence in zip(hypotheses, worth, strict=True):
            self._add(each, now, evidence)

    def _add(self, place: Hypothesis, now: _Weighed, evidence: float) -> None:
        """Add a scan's evidence for a place: bounded against no place, in full against others."""
        gain = float(np.clip(now.best - EVEN, -GAIN, GAIN))
        gain -= min(now.best - evidence, 2.0 * GAIN)
        place.log_odds += gain
        place.path[now.number] = place.pose
        if gain > 0.0:
            place.sure = max(place.sure, now.number)

    def _choose(self) -> None:
        """Drop unlikely hypotheses, and of those that have met all but the best."""
        most = max((each.log_odds for each in self.hypotheses), default=0.0)
        kept: list[Hypothesis] = []
        for each in sorted(self.hypotheses, key=lambda one: -one.log_odds):
            each.log_odds -= max(most - MOST, 0.0)
            met = any(same_place(each.pose, other.pose, 2.0) for other in kept)
            if each.log_odds > LEAST and not met:
                kept.append(each)
        self.hypotheses = kept

    @property
    def probabilities(self) -> Float:
        """Probabilities (h,) of the hypotheses; what is missing to 1 is that of no place."""
        odds = np.exp([each.log_odds for each in self.hypotheses])
        return np.asarray(odds / (1.0 + odds.sum()))

    @property
    def probability(self) -> float:
        """The probability of the best hypothesis."""
        return float(self.probabilities.max(initial=0.0))

    @property
    def place(self) -> Hypothesis | None:
        """The one hypothesis that is left; None as long as it is not certain."""
        return self.hypotheses[0] if self.probability >= CERTAIN else None
