"""Place search: global localisation on a known map, without an initial guess.

The map enters as key scans, of a run or cast in a world; then key scans of a drive enter with their
poses in a frame of its own. All free cells and headings are searched for places where a scan fits.
These are hypotheses. Each scan weighs them against each other, and against no place: that the robot
is beyond the map, in a room like those on it. The places that were certain leave.
"""

from collections import deque
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import between, compose, turned
from lrf3d.laser import LaserRangeFinder
from lrf3d.matching.key_scans import Key, ScanConverter, same_place
from lrf3d.matching.search import (
    CELL,
    FREE,
    LOOSE,
    Field,
    Place,
    Submap,
    thin,
    window_scores,
)
from lrf3d.planning.free_space import free_places
from lrf3d.simulation.run import Run
from lrf3d.slam.front_end import KEY_DISTANCE, KEY_TURN
from lrf3d.slam.motion import size_of
from lrf3d.world import World

# Largest number of scans that are cast in a world: in a town they lie farther apart.
MOST_SCANS = 3000

# Largest number of cells that are searched: in a town they lie farther apart.
MOST_CELLS = 80_000

# Step of the headings that are searched [rad].
STEP = 0.04

# Evidence at which a place and no place are equally likely. At right places it is 5.4 ± 1.0 in
# offices; the best of all wrong places reaches 3.1 ± 1.0, and in the mean over ten scans 2.8.
EVEN = 3.8

# Log odds of a new hypothesis.
BEGIN = -3.0

# Upper bound on the log odds, so that a kidnapped robot is noticed.
MOST = 7.0

# Log odds below which a hypothesis is dropped.
LEAST = -6.0

# Probability of the best hypothesis from which its place is certain.
CERTAIN = 0.99

# Number of earlier scans by which new hypotheses are weighed as well.
REMEMBERED = 8

# Largest number of new hypotheses from one scan.
TRIED = 12

# Information of the step of a hypothesis, before it is matched: 0.1 m and 0.05 rad.
STEP_INFORMATION = np.linalg.inv(np.diag(np.square([0.1, 0.1, 0.05])))


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """A known map: key scans (k,) at poses (k, 3), with their numbers (k,) in a run."""

    name: str
    keys: list[Key]
    poses: Float = field(repr=False)
    numbers: Int = field(default_factory=lambda: np.empty(0, np.int64))

    @classmethod
    def from_run(cls, run: Run) -> "KnownPlaces":
        """The map of a run, at its poses, true or estimated."""
        poses = run.trajectory.poses
        chosen = [0]
        for number in range(1, len(run)):
            length, turn = size_of(between(poses[chosen[-1]], poses[number]))
            if length >= KEY_DISTANCE or turn >= KEY_TURN:
                chosen.append(number)
        converter = ScanConverter()
        keys = [converter.candidate(run.scans_at(number), number) for number in chosen]
        return cls(run.world.name, keys, poses[chosen], np.array(chosen))

    @classmethod
    def from_world(cls, world: World) -> "KnownPlaces":
        """The map of a world: full-circle scans that are cast in it, a metre apart."""
        room = 0.25  # Distance from walls at which a robot may be [m].
        places = free_places(world, room)
        area = len(np.unique(np.floor(places), axis=0))
        spacing = max(1.0, np.sqrt(area / MOST_SCANS))
        _, first = np.unique(np.floor(places / spacing), axis=0, return_index=True)
        poses = np.column_stack([places[first], np.zeros(len(first))])
        beams = 720  # Beams of a scan that is cast.
        reach = 30.0  # Their largest range [m].
        lrf = LaserRangeFinder(-np.pi, np.pi - 2.0 * np.pi / beams, beams, range_max=reach)
        caster = PlanarCaster(world)
        converter = ScanConverter()
        keys = [converter.candidate(caster.cast(lrf, pose)) for pose in poses]
        return cls(world.name, keys, poses)

    @cached_property
    def _field(self) -> Field:
        return Submap(self.keys, self.poses).field

    @cached_property
    def _free(self) -> Int:
        """Columns and rows (s, 2) of the free cells that are searched."""
        cells = self._field.cells == FREE
        stride = int(np.ceil(max(2, np.sqrt(cells.sum() / MOST_CELLS))))
        rows, columns = np.nonzero(cells[::stride, ::stride])
        return np.ascontiguousarray(stride * np.column_stack([columns, rows]))

    def search(self, scan: Key) -> list[Place]:
        """The places on the whole map where a scan fits, the best first."""
        found: list[Place] = []
        for peak in self._peaks(scan) if len(self._free) else []:
            place = self.judged(scan, peak, LOOSE)
            if place and not any(same_place(place.match.pose, each.match.pose) for each in found):
                found.append(place)
        return sorted(found, key=lambda each: -each.evidence)

    def _peaks(self, scan: Key) -> list[Float]:
        """The poses (3,) at which most hits of a scan lie in walls, the best first."""
        field = self._field
        cells = self._free
        centre = np.array([field.left + 0.5 * CELL, field.low + 0.5 * CELL, 0.0])
        parts = []
        scored = []
        heading_parts = 16  # Parts of the headings that are searched one after another.
        most_peaks = 600  # Number of the best poses of each part that are kept.
        for headings in np.array_split(np.arange(-np.pi, np.pi, STEP), heading_parts):
            scores = window_scores(thin(scan.hits), field, centre, cells, headings)
            most = min(most_peaks, scores.size)
            best = np.argpartition(scores, scores.size - most, axis=None)[-most:]
            a, s = np.unravel_index(best, scores.shape)
            scored.append(scores[a, s])
            parts.append(np.column_stack([centre[:2] + CELL * cells[s], headings[a]]))
        ranked = np.concatenate(parts)[np.argsort(-np.concatenate(scored), kind="stable")]
        peaks: list[Float] = []
        most_matched = 80  # Largest number of poses that are matched.
        next_peak = 0.7  # Least distance between them [m],
        next_turn = 0.25  # or turn [rad].
        while len(ranked) and len(peaks) < most_matched:
            peak, *_ = ranked
            peaks.append(peak)
            x, y, turn = np.abs(between(peak, ranked)).T
            ranked = ranked[(np.hypot(x, y) > next_peak) | (turn > next_turn)]
        return peaks

    @cached_property
    def _seen(self) -> Float:
        """The positions of the key scans, and the middles of their hits (k, 4) [m]."""
        middles = [_middle(key, pose) for key, pose in zip(self.keys, self.poses, strict=True)]
        return np.column_stack([self.poses[:, :2], np.array(middles)])

    def around(self, scan: Key, pose: Float) -> Int:
        """The indices of the key scans that see most of what a scan from a pose (3,) sees."""
        apart = np.abs(self._seen - [*pose[:2], *_middle(scan, pose)]).sum(axis=1)
        nearest_keys = 6  # Number of nearest key scans by which a place is judged.
        return np.argsort(apart, kind="stable")[:nearest_keys]

    def judged(self, scan: Key, guess: Float, prior: Float) -> Place | None:
        """Match a scan near a guess (3,) and weigh the place; None if there is no match."""
        near = self.around(scan, guess)
        around = Submap([self.keys[k] for k in near.tolist()], self.poses[near])
        match = around.match(scan, guess, prior)
        return None if match is None else around.place(scan, match)


def _middle(scan: Key, pose: Float) -> Float:
    """The middle (2,) of the hits of a scan from a pose (3,)."""
    x, y = (scan.hits[name].mean() if len(scan.hits) else 0.0 for name in "xy")
    return compose(pose, np.array([x, y, 0.0]))[:2]


@dataclass(slots=True, eq=False)
class Hypothesis:
    """A pose (3,) where the robot may be, its log odds against no place, and its poses by scan.

    ``sure`` is the number of the last scan that supported it.
    """

    pose: Float
    log_odds: float = BEGIN
    path: dict[int, Float] = field(default_factory=dict)
    sure: int = -1


@dataclass(slots=True, eq=False)
class Found:
    """A place that was certain: poses (3,) by number of the scan, up to the last certain one."""

    place: Hypothesis
    probability: float = 0.0
    path: dict[int, Float] = field(default_factory=dict)
    last: int = 0


@dataclass(slots=True, eq=False)
class _Weighed:
    """A scan with its number, its pose (3,) in the drive, and the best evidence at any place."""

    number: int
    scan: Key
    pose: Float
    best: float = -np.inf


class PlaceSearch:
    """Searches and weighs places on a known map, scan by scan."""

    def __init__(self, places: KnownPlaces) -> None:
        self._places = places
        self.hypotheses: list[Hypothesis] = []
        self.found: list[Found] = []
        self._moved = np.array([np.inf, np.inf])
        self._pose: Float | None = None
        self._before: deque[_Weighed] = deque(maxlen=REMEMBERED)
        self._count = 0

    def see(self, number: int, scan: Key, pose: Float) -> None:
        """Take in a scan, by number, at a pose (3,) in a frame of the drive."""
        step = np.zeros(3) if self._pose is None else between(self._pose, pose)
        self._pose = pose
        for each in self.hypotheses:
            each.pose = compose(each.pose, step)
        self._moved += size_of(step)
        # Distance [m] or turn [rad] after which hypotheses are weighed: nearer scans agree anyway.
        judged = [0.4, 0.5]
        if (self._moved >= judged).any() and len(scan.hits):
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
        every = 3  # Interval between searches of the whole map, in scans that are weighed.
        if self.probability < CERTAIN and self._count % every == 0:
            found = self._places.search(scan)[:TRIED]
            now.best = max([now.best, *(each.evidence for each in found)])
            new = [Hypothesis(each.match.pose) for each in found]
            for each, weighed in zip(new, found, strict=True):
                _add(each, now, weighed.evidence)
            self._remember(new, pose)
            self.hypotheses += new
        self._count += 1
        self._before.append(now)
        self._prune()

    def _prune(self) -> None:
        """Drop unlikely hypotheses, and of those that have converged all but the best."""
        most = max((each.log_odds for each in self.hypotheses), default=0.0)
        ranked = sorted(self.hypotheses, key=lambda one: -one.log_odds)
        self.hypotheses = []
        for each in ranked:
            each.log_odds -= max(most - MOST, 0.0)
            met = any(same_place(each.pose, other.pose, 2.0) for other in self.hypotheses)
            if each.log_odds > LEAST and not met:
                self.hypotheses.append(each)

    def _remember(self, new: list[Hypothesis], pose: Float) -> None:
        """Weigh new hypotheses by earlier scans, as far back as these support them.

        Scans before those do not count against them: the robot may have been carried there since.
        """
        earlier = [Hypothesis(each.pose, each.log_odds, dict(each.path)) for each in new]
        for before in reversed(self._before):
            back = between(pose, before.pose)
            for each, now in zip(earlier, new, strict=True):
                each.pose = compose(now.pose, back)
            self._weigh(earlier, before)
            for each, now in zip(earlier, new, strict=True):
                if each.log_odds > now.log_odds:
                    now.log_odds = each.log_odds
                    now.path = dict(each.path)
                    now.sure = max(now.sure, each.sure)

    def _weigh(self, hypotheses: list[Hypothesis], now: _Weighed) -> None:
        """Weigh hypotheses by a scan."""
        worth = []
        for each in hypotheses:
            *_, heading = each.pose.tolist()
            found = self._places.judged(now.scan, each.pose, turned(STEP_INFORMATION, heading))
            worth.append(-np.inf if found is None else found.evidence)
            each.pose = each.pose if found is None else found.match.pose
        now.best = max([now.best, *worth])
        for each, evidence in zip(hypotheses, worth, strict=True):
            _add(each, now, evidence)

    @property
    def probability(self) -> float:
        """The probability of the best hypothesis, against all others and against no place."""
        odds = np.exp([each.log_odds for each in self.hypotheses])
        return float(odds.max(initial=0.0) / (1.0 + odds.sum()))

    @property
    def place(self) -> Hypothesis | None:
        """The best hypothesis; None while it is not certain."""
        return self.hypotheses[0] if self.probability >= CERTAIN else None


def _add(place: Hypothesis, now: _Weighed, evidence: float) -> None:
    """Add a scan's evidence for the best place, less what this place falls short of it."""
    # Largest change of the log odds against no place by one scan: neighbouring scans show the same
    # walls, which may be those of a similar room. A place may fall short of the best by twice that.
    most_gain = 1.5
    gain = float(np.clip(now.best - EVEN, -most_gain, most_gain))
    gain -= min(now.best - evidence, 2.0 * most_gain)
    place.log_odds += gain
    place.path[now.number] = place.pose
    if gain > 0.0:
        place.sure = max(place.sure, now.number)
