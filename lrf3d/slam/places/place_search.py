"""Place search: global localisation on a known map, without an initial guess.

Key scans of a drive enter, with poses in the drive's own frame; the places of which the search is
certain leave. Every few key scans, their hits are combined by these poses and matched with the
whole map. The best place must stand out from what matches by chance: the mirror image of the hits,
which has the same walls, gaps and noise but is nowhere on the map. A place that stands out is
tracked along the drive.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from lrf3d.geometry.lines import Float, Records
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.key_scans import Key
from lrf3d.matching.likelihood import some
from lrf3d.matching.surface import concatenated, moved
from lrf3d.slam.motion import size_of
from lrf3d.slam.places.known_places import APART, LEAST, TURNED, KnownPlaces, is_same

# Distance [m] or turn [rad] after which the next scan is used; nearer ones see the same.
SPACING = np.array([0.4, 0.5])

# Number of scans of the first search.
FIRST = 6

# Number of scans that are searched together, and between two searches: so few that the front end's
# drift among them is negligible.
WINDOW = 12

# Number of searches without a certain place after which searches become rarer: a drive that is not
# on the map would cost a search of the whole map every few metres.
PATIENT = 6

# Number of scans before and after a scan that are matched with it while a place is tracked.
FOLLOWED = 6

# Number of the best wrong places whose scores give the unit of a lead.
COMPARED = 11

# Log odds that a place gains if a search with other scans finds it, too: among about ten wrong
# places that fit equally well, this happens by chance once in ten times.
AGREED = 2.3

# Number of earlier searches with which a search is compared; over more, odometry drifts.
REMEMBERED = 5

# Largest log odds of a place that is tracked, so that a kidnapped robot is noticed soon.
MOST = 7.0

# Change of the log odds by a scan that fits or does not; small, as neighbouring scans see the same
# walls.
GAIN = 0.6

# Probability from which a place counts as certain, and its log odds.
CERTAIN = 0.99
ENOUGH = float(np.log(CERTAIN / (1.0 - CERTAIN)))

# Least share of the hits that lie at walls of the map at a right place. It is 0.73 to 1 on maps of
# others; it was 0.61 at a wrong place that stood out, as hardly any hits fit anywhere.
LEAST_EXPLAINED = 0.65

# Largest number of hits of a scan, so that all scans have about the same weight.
SCAN_HITS = 60

# Largest number of hits of a search.
WINDOW_HITS = 400

# Side [m] of cells that keep one hit of a scan each, so that near walls, which many beams hit, do
# not outweigh far ones.
HIT_CELL = 0.1

# Range [m] up to which hits are used.
REACH = 25.0


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A scan: its number, the pose (3,) of the robot in the frame of the drive, and its hits."""

    number: int
    pose: Float
    hits: Records


@dataclass(slots=True, eq=False)
class Hypothesis:
    """A pose (3,) where the robot may be, its log odds, and its poses by number of the scan.

    ``at`` is the scan that the pose is of, ``sure`` the number of the last one that fits there.
    """

    pose: Float
    at: _Seen
    log_odds: float
    path: dict[int, Float] = field(default_factory=dict)
    sure: int = -1

    @property
    def probability(self) -> float:
        """The probability of the place, against all others and against no place."""
        return float(1.0 / (1.0 + np.exp(-self.log_odds)))


@dataclass(slots=True, eq=False)
class Found:
    """A place that was certain: poses (3,) by number of the scan, up to the last certain one."""

    place: Hypothesis
    probability: float = 0.0
    path: dict[int, Float] = field(default_factory=dict)
    last: int = 0


class PlaceSearch:
    """Searches and follows places on a known map, scan by scan."""

    def __init__(self, places: KnownPlaces) -> None:
        self._places = places
        self.found: list[Found] = []
        self._place: Hypothesis | None = None
        self._is_followed = False
        self._moved = np.array([np.inf, np.inf])
        self._pose: Float | None = None
        # The scans since the last place was lost, and the best place of each search since then.
        self._drive: list[_Seen] = []
        self._searched: list[Hypothesis] = []
        self._new = 0
        self._number = 0

    @property
    def probability(self) -> float:
        """The probability of the best place, against all others and against no place."""
        return 0.0 if self._place is None else self._place.probability

    def see(self, number: int, scan: Key, pose: Float) -> None:
        """Take in a scan, by number, at a pose (3,) in a frame of the drive."""
        step = np.zeros(3) if self._pose is None else between(self._pose, pose)
        self._pose = pose
        self._number = number
        self._moved += size_of(step)
        if (self._moved >= SPACING).any() and len(scan.hits):
            self._moved[:] = 0.0
            self._drive.append(_Seen(number, pose, _used(scan.hits)))
            self._new += 1
            if self._is_followed:
                self._follow()
            else:
                # Searches become rarer where nothing is found.
                often = 1 + len(self._searched) // PATIENT
                if self._new >= (often * WINDOW if self._searched else FIRST):
                    self.search()
        self._keep()

    def search(self) -> None:
        """Search the whole map for the last scans, unless the place is known."""
        window = self._drive[-WINDOW:]
        if self._is_followed or not self._new or len(window) < FIRST:
            return
        self._new = 0
        middle = window[len(window) // 2]
        now = self._judged(_laid_out(window, middle), middle)
        if now is None:
            return
        now.sure = window[0].number
        agreeing = sum(_agree(now, each) for each in self._searched[-REMEMBERED:])
        self._searched.append(now)
        # Each search with other scans is another chance of a wrong place.
        chances = max(len(self._drive) / WINDOW, 1.0)
        log_odds = now.log_odds + AGREED * agreeing - float(np.log(chances))
        # Halves of fewer scans see the same walls, and may agree on a wrong place.
        if len(window) == WINDOW and ENOUGH - AGREED <= log_odds < ENOUGH:
            log_odds += AGREED * self._halves_agree(window, now)
        self._place = replace(now, log_odds=log_odds)
        if log_odds >= ENOUGH:
            self._begin(self._place)

    def _judged(self, hits: Records, at: _Seen) -> Hypothesis | None:
        """The best place of hits; its log odds are its lead over all other and mirrored places."""
        mirrored = hits.copy()
        mirrored["y"] *= -1.0
        here = self._places.search(hits)
        chance = self._places.search(mirrored)
        if not here or not chance:
            return None
        first, *others = here
        wrong = sorted((each.score for each in (*others, *chance)), reverse=True)
        # The scores of the best wrong places fall off exponentially, so that a lead of n units
        # occurs by chance once in e^n cases.
        *best, last = wrong[:COMPARED]
        spread = float(np.mean(best)) - last if best else np.inf
        # Scores differ by no less than one hit does, also where wrong places fit equally well.
        unit = max(spread, -float(np.log(LEAST)) / len(hits))
        lead = (first.score - wrong[0]) / unit
        # If the map lacks most of what the laser saw, the lead of a place means little.
        doubtful = self._places.explained(first.pose, hits) < LEAST_EXPLAINED
        return Hypothesis(first.pose, at, min(lead, 0.0) if doubtful else lead)

    def _halves_agree(self, window: list[_Seen], place: Hypothesis) -> bool:
        """Whether each half of some scans, searched on its own, finds the same place."""
        middle = len(window) // 2
        for half in (window[:middle], window[middle:]):
            first, *_ = self._places.search(_laid_out(half, place.at))
            if not is_same(first.pose, place.pose, APART, TURNED):
                return False
        return True

    def _begin(self, place: Hypothesis) -> None:
        """Track a new place to both ends of the drive; backward as long as scans fit."""
        self._is_followed = True
        begin = place.pose, place.at
        middle = first = self._drive.index(place.at)
        for k in reversed(range(middle)):
            if self._step(place, k):
                first = k
            elif first - k > FOLLOWED:
                break
        place.path = {k: pose for k, pose in place.path.items() if k >= self._drive[first].number}
        place.pose, place.at = begin
        for k in range(middle, len(self._drive)):
            self._step(place, k)
        self._keep()

    def _follow(self) -> None:
        """Track the place to a new scan; it is lost when too few scans fit."""
        place = self._place
        assert place is not None
        gain = GAIN if self._step(place, len(self._drive) - 1) else -GAIN
        place.log_odds = min(place.log_odds + gain, MOST)
        if place.log_odds < 0.0:
            self._is_followed = False
            self._drive = [each for each in self._drive if each.number > place.sure]
            self._new = len(self._drive)
            self._searched = []

    def _step(self, place: Hypothesis, k: int) -> bool:
        """Move a place to another scan of the drive; returns whether the scan fits there."""
        scan = self._drive[k]
        guess = compose(place.pose, between(place.at.pose, scan.pose))
        around = self._drive[max(k - FOLLOWED, 0) : k + FOLLOWED]
        [found] = self._places.climbed(guess[None], _laid_out(around, scan))
        place.pose = found.pose
        place.at = scan
        place.path[scan.number] = found.pose
        fits = self._places.fits(found.pose, scan.hits)
        if fits:
            place.sure = max(place.sure, scan.number)
        return fits

    def _keep(self) -> None:
        """Keep the poses of a certain place up to the current scan."""
        place = self._place
        if place is None or not self._is_followed or place.log_odds < ENOUGH:
            return
        if not self.found or self.found[-1].place is not place:
            self.found.append(Found(place))
        found = self.found[-1]
        found.probability = max(place.probability, found.probability)
        found.path = {k: pose for k, pose in place.path.items() if k <= place.sure}
        found.last = self._number if place.sure == place.at.number else place.sure


def _used(hits: Records) -> Records:
    """The hits of a scan that are used: within reach, one a cell."""
    hits = hits[np.hypot(hits["x"], hits["y"]) < REACH]
    cells = np.floor(np.column_stack([hits["x"], hits["y"]]) / HIT_CELL)
    _, first = np.unique(cells, axis=0, return_index=True)
    return some(hits[np.sort(first)], SCAN_HITS)


def _laid_out(scans: list[_Seen], middle: _Seen) -> Records:
    """The hits of several scans, combined by their poses in the robot's frame at one of them."""
    parts = (moved(each.hits, between(middle.pose, each.pose)) for each in scans)
    return some(concatenated(parts), WINDOW_HITS)


def _agree(now: Hypothesis, before: Hypothesis) -> bool:
    """Whether two searches by different scans found the same place, and it stood out in both."""
    there = compose(now.pose, between(now.at.pose, before.at.pose))
    apart = before.at.number < now.sure
    return (
        min(now.log_odds, before.log_odds) > 0.0
        and apart
        and is_same(there, before.pose, APART, TURNED)
    )
