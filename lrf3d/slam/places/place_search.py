"""Place search: global localisation on a known map, without an initial guess.

Key scans of a drive enter, with poses in the drive's own frame; the places of which the search is
certain leave. Every few key scans, their hits are combined by these poses and matched with the
whole map. The best place must stand out from what matches by chance: the mirror image of the hits,
which has the same walls, gaps and noise but is nowhere on the map. A place that stands out is
tracked along the drive.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Records
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.key_scans import Key
from lrf3d.matching.likelihood import some
from lrf3d.matching.surface import concatenated, moved
from lrf3d.slam.motion import size_of
from lrf3d.slam.places.known_places import APART, TURNED, KnownPlaces, is_same

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

# Number of places of a search that are followed back through earlier ones.
COMPARED = 11

# Number of searches through which places are followed.
REMEMBERED = 5

# Number of independent hits in a search: hits on one wall, from scans next to each other, are not.
INDEPENDENT = 6.0

# Mean misfit [log likelihood] of hits at right places that is not the map's: people, noise.
CLUTTER = 0.2

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
        # The scans since the last place was lost.
        self._drive: list[_Seen] = []
        self._new = 0
        self._number = 0
        self._restart()

    def _restart(self) -> None:
        """Forget what was searched before a place was found or lost."""
        self._windows: list[_Window] = []
        self._here = _Tracks(np.array([1.0, 1.0, 1.0]))
        self._mirrored = _Tracks(np.array([1.0, -1.0, -1.0]))

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
                often = 1 + len(self._windows) // PATIENT
                if self._new >= (often * WINDOW if self._windows else FIRST):
                    self.search()
        self._keep()

    def search(self) -> None:
        """Search the whole map for the last scans, unless the place is known."""
        scans = self._drive[-WINDOW:]
        if self._is_followed or not self._new or len(scans) < FIRST:
            return
        self._new = 0
        middle = scans[len(scans) // 2]
        self._windows.append(_Window(middle, _laid_out(scans, middle)))
        here = self._here.search(self._places, self._windows)
        chance = self._mirrored.search(self._places, self._windows)
        if not here or not chance:
            return
        first, *others = here
        second = max((*others, *chance), key=lambda each: each.score)
        # Each search is another chance of a wrong place.
        log_odds = _log_odds(first, second) - float(np.log(len(self._windows)))
        # If the map lacks most of what the laser saw, the lead of a place means little.
        if self._places.explained(first.poses[-1], self._windows[-1].hits) < LEAST_EXPLAINED:
            log_odds = min(log_odds, 0.0)
        self._place = Hypothesis(first.poses[-1], middle, log_odds, sure=scans[0].number)
        if log_odds >= ENOUGH:
            self._begin(self._place)

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
            self._restart()

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


class _Window(NamedTuple):
    """Scans that are searched together: their hits, in the robot's frame at one of them."""

    at: _Seen
    hits: Records


class _Track(NamedTuple):
    """Poses (w, 3) of the robot at the last windows, and the sum of their scores."""

    poses: Float
    score: float


class _Tracks:
    """The tracks on the map that fit the last windows best, of a drive or of its mirror image."""

    def __init__(self, sense: Float) -> None:
        self._sense = sense
        self._best = np.empty((0, 3))

    def search(self, places: KnownPlaces, windows: list[_Window]) -> list[_Track]:
        """Search the newest window on the map, and follow each place back through the others."""
        *before, now = windows[-REMEMBERED:]
        hits = self._seen(now)
        fits = places.search(hits)[:COMPARED]
        if before:
            step = self._sense * between(before[-1].at.pose, now.at.pose)
            fits += places.climbed(compose(self._best, step), hits)
        poses = [np.array([each.pose for each in fits]).reshape(-1, 3)]
        scores = np.array([each.score for each in fits])
        later = now
        for each in reversed(before):
            step = self._sense * between(later.at.pose, each.at.pose)
            fits = places.climbed(compose(poses[-1], step), self._seen(each))
            poses.append(np.array([fit.pose for fit in fits]).reshape(-1, 3))
            scores += [fit.score for fit in fits]
            later = each
        paths = np.stack(poses[::-1], axis=1)
        found = list[_Track]()
        for k in np.argsort(-scores, kind="stable").tolist():
            if not any(_meet(paths[k], other.poses) for other in found):
                found.append(_Track(paths[k], float(scores[k])))
        self._best = np.array([each.poses[-1] for each in found[:COMPARED]]).reshape(-1, 3)
        return found

    def _seen(self, window: _Window) -> Records:
        """The hits of a window, or their mirror image."""
        hits = window.hits.copy()
        hits["y"] *= self._sense[1]
        return hits


def _meet(one: Float, other: Float) -> bool:
    """Whether two tracks (w, 3) are at the same place in one of the windows."""
    return any(is_same(a, b, APART, TURNED) for a, b in zip(one, other, strict=True))


def _log_odds(first: _Track, second: _Track) -> float:
    """The log odds of the best track against the next one.

    The misfits of hits are distributed exponentially, by a mean that differs between maps: with it
    unknown, the likelihood of a track is a power of its own mean misfit.
    """
    count = len(first.poses)
    misfit, other = (CLUTTER - each.score / count for each in (first, second))
    return float(INDEPENDENT * count * np.log(other / misfit))
