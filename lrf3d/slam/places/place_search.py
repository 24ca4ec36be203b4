"""Place search: global localisation on a known map, without an initial guess.

Key scans of a drive enter, with poses in the drive's own frame; the places of which the search is
certain leave. Every few key scans, their hits are combined by these poses and matched with the
whole map. Each of the best places is followed back through the last searches. The track that fits
best must stand out from all others, and from the mirror image of the drive, which has the same
walls, gaps and noise but is nowhere on the map. From then on it is tracked scan by scan.
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

# Number of places of a search that are followed back through earlier searches.
COMPARED = 11

# Number of searches through which places are followed: one corridor looks like the next, several in
# the order of the drive do not.
REMEMBERED = 5

# Number of independent hits in a search; the others lie on the same walls. With 8 to 10, and a
# clutter of 0.1 to 0.2, stated probabilities are met on maps of others: see the docs.
INDEPENDENT = 8.0

# Mean misfit of hits [log likelihood] that has nothing to do with the place: people, range noise.
CLUTTER = 0.1

# Largest log odds of a place that is tracked, so that a kidnapped robot is noticed soon.
MOST = 7.0

# Change of the log odds by a scan that fits or does not; small, as neighbouring scans see the same
# walls.
GAIN = 0.6

# Probability from which a place counts as certain, and its log odds.
CERTAIN = 0.99
ENOUGH = float(np.log(CERTAIN / (1.0 - CERTAIN)))

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
        # The hits of scans, by number.
        self.hits: dict[int, Records] = {}
        # The scans since the last place was lost.
        self._drive: list[_Seen] = []
        self._new = 0
        self._number = 0
        self._restart()

    def _restart(self) -> None:
        """Forget what was searched before a place was found or lost."""
        self._here = _Tracks(self._places)
        self._chance = _Tracks(self._places)

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
            self.hits[number] = _used(scan.hits)
            self._drive.append(_Seen(number, pose, self.hits[number]))
            self._new += 1
            if self._is_followed:
                self._follow()
            else:
                # Searches become rarer where nothing is found.
                searches = len(self._here.windows)
                often = (1 + searches // PATIENT) * WINDOW
                if self._new >= (often if searches else FIRST):
                    self.search()
        self._keep()

    def search(self) -> None:
        """Search the whole map for the last scans, unless the place is known."""
        scans = self._drive[-WINDOW:]
        if self._is_followed or not self._new or len(scans) < FIRST:
            return
        self._new = 0
        middle = scans[len(scans) // 2]
        window = _Seen(middle.number, middle.pose, _laid_out(scans, middle))
        here = self._here.search(window)
        chance = self._chance.search(_mirrored(window))
        if not here or not chance:
            return
        # The misfits of hits are taken to be distributed exponentially, with a mean that is not
        # known: so the likelihood of a track is a power of its own mean misfit.
        count = len(here[0].poses)
        misfits = CLUTTER - np.array([each.score for each in (*here, *chance)]) / count
        place, *others = -INDEPENDENT * count * np.log(misfits)
        # Each search is another chance of a wrong place.
        searches = len(self._here.windows)
        log_odds = float(place - np.logaddexp.reduce(others) - np.log(searches))
        pose, *_ = here[0].poses
        self._place = Hypothesis(pose, middle, min(log_odds, MOST), sure=scans[0].number)
        if self._place.log_odds >= ENOUGH:
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
        [place.pose], _ = self._places.climbed(guess[None], _laid_out(around, scan))
        place.at = scan
        place.path[scan.number] = place.pose
        fits = self._places.fits(place.pose, scan.hits)
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


def _mirrored(seen: _Seen) -> _Seen:
    """The mirror image of hits, and of their pose in the drive."""
    hits = seen.hits.copy()
    hits["y"] *= -1.0
    return _Seen(seen.number, seen.pose * [1.0, -1.0, -1.0], hits)


class _Track(NamedTuple):
    """Poses (w, 3) of the robot at the last windows, the newest first, and their total score."""

    poses: Float
    score: float


class _Tracks:
    """The tracks on a map that fit the last windows best, of a drive or of its mirror image."""

    def __init__(self, places: KnownPlaces) -> None:
        self._places = places
        self.windows: list[_Seen] = []
        self._best = np.empty((0, 3))

    def search(self, now: _Seen) -> list[_Track]:
        """Search for a new window, and follow each place back through the others; best first."""
        before = self.windows[-REMEMBERED + 1 :]
        self.windows.append(now)
        poses = self._places.search(now.hits)[:COMPARED]
        for last in before[-1:]:
            poses = np.vstack([poses, compose(self._best, between(last.pose, now.pose))])
        at = now
        paths = list[Float]()
        total = np.zeros(len(poses))
        for window in (now, *reversed(before)):
            guesses = compose(poses, between(at.pose, window.pose))
            poses, scores = self._places.climbed(guesses, window.hits)
            paths.append(poses)
            total += scores
            at = window
        tracks = np.stack(paths, axis=1)
        found = list[_Track]()
        for k in np.argsort(-total, kind="stable").tolist():
            # Tracks that meet in one of the windows are one place.
            pairs = (pair for other in found for pair in zip(tracks[k], other.poses, strict=True))
            if not any(is_same(*pair, APART, TURNED) for pair in pairs):
                found.append(_Track(tracks[k], float(total[k])))
        self._best = np.array([each.poses[0] for each in found[:COMPARED]]).reshape(-1, 3)
        return found
