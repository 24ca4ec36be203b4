"""Known places: a map as cells, and the places on it where the hits of a drive fit.

A world, a ROS map or a run enters. Its occupied cells give the likelihood field of Thrun et al.
(2005, section 6.4): the likelihood of a hit depends on its distance to the nearest occupied cell; a
hit in an unknown cell counts little. A map of cells is used as it is; walls are drawn into cells.
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from lrf3d.geometry.lines import Bool, Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import between, compose
from lrf3d.laser.free_space import distinct_poses
from lrf3d.matching.likelihood import Likelihood, climbed, mean_score, some
from lrf3d.matching.search import CELL, Field, window_scores
from lrf3d.simulation.run import Run
from lrf3d.world import World
from lrf3d.world.ros_map import FREE, OCCUPIED, cell_size, map_cells

# Largest number of cells into which walls are drawn; larger worlds get larger cells.
MOST_CELLS = 8_000_000

# Standard deviation of the distance [m] from a hit to the walls of the map.
SIGMA = 0.1

# Least likelihood of a hit, relative to one in a wall: the map lacks moved furniture and people.
LEAST = 0.05

# Distance [m] from walls up to which a hit counts in the coarse search, so that a place between two
# tried positions is found.
BLUR = 0.25

# Largest share of hits in unknown cells of a map that shows where its robot is. Drives in other
# buildings have 0.6 at the places that fit best by chance, drives on their map hardly any.
MOST_UNKNOWN = 0.25

# Least distance from walls [m] of positions that are searched.
ROOM = 0.2

# Step of the headings that are searched [rad].
STEP = 0.05

# Largest number of positions that are searched; on larger maps they are farther apart.
MOST_POSITIONS = 40_000

# Number of hits that the coarse search uses.
SEARCHED_HITS = 100

# Number of these by which positions are ranked first, and the share of the positions, one in so
# many, that are then searched.
ROUGH_HITS = 25
ROUGH_SHARE = 6

# Largest number of places that are scored with all hits.
MOST_PLACES = 30

# Distance [m] and turn [rad] up to which two poses are the same place.
APART = 1.0
TURNED = 0.3


class Fit(NamedTuple):
    """A pose (3,) on a map, and its score: the mean log likelihood of the hits there."""

    pose: Float
    score: float


def is_same(first: Float, second: Float) -> bool:
    """Whether two poses (3,) are the same place."""
    x, y, turn = first - second
    return bool(np.hypot(x, y) < APART and abs(wrap_angle(turn)) < TURNED)


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """A known map: cells (rows, columns) with a side [m], the first row at the bottom.

    They may be occupied, free, or neither; the corner of the first cell is at the origin, a pose
    (3,).
    """

    name: str
    occupied: Bool = field(repr=False)
    free: Bool = field(repr=False)
    side: float
    origin: Float

    @classmethod
    def from_run(cls, run: Run) -> "KnownPlaces":
        """The map of a run, at its poses, true or estimated."""
        seen = run.free_cells()
        side = 0.5 * seen.resolution
        border = int(np.ceil(2.0 / side))
        free = np.pad(seen.cells.repeat(2, axis=0).repeat(2, axis=1), border)
        corner = np.array(seen.origin) - [border * side, border * side, 0.0]
        chosen = distinct_poses(run.trajectory.poses).tolist()
        hits = np.concatenate([scan.points() for n in chosen for scan in run.scans_at(n)])
        cells = np.floor((hits - corner[:2]) / side).astype(np.int64)[:, ::-1]
        cells = cells[((cells >= 0) & (cells < free.shape)).all(axis=1)]
        counts = np.zeros(free.shape, np.int64)
        np.add.at(counts, tuple(cells.T), 1)
        # A cell with a single hit may be a mixed pixel's.
        occupied = counts > 1
        return cls(run.world.name, occupied, free & ~occupied, side, corner)

    @classmethod
    def from_world(cls, world: World) -> "KnownPlaces":
        """The map of a world: its own cells, or those along its walls."""
        known = world.free
        if known is not None and known.occupied is not None:
            origin = np.array(known.origin)
            return cls(world.name, known.occupied, known.cells, known.resolution, origin)
        widest = float(np.sqrt(np.prod(np.ptp(world.bounds, axis=0)) / MOST_CELLS))
        side = cell_size(world, max(0.05, widest))
        cells, corner = map_cells(world, side, Path(world.name))
        return cls(world.name, cells == OCCUPIED, cells == FREE, side, np.array([*corner, 0.0]))

    @cached_property
    def _distance(self) -> Float:
        """Distances of the cells to walls [m]."""
        if not self.occupied.any():
            return np.full(self.occupied.shape, np.inf)
        return np.asarray(scipy.ndimage.distance_transform_edt(~self.occupied) * self.side)

    @cached_property
    def _scores(self) -> Likelihood:
        """Log likelihoods of a hit in each cell, with a border that stands for all beyond."""
        near = np.exp(-0.5 * np.square(self._distance / SIGMA))
        scores = np.log((1.0 - LEAST) * near + LEAST)
        # In unknown cells a hit counts half as much as a wrong one.
        beyond = 0.5 * np.log(LEAST)
        unknown = ~(self.free | self.occupied)
        scores[unknown] = np.maximum(scores[unknown], beyond)
        return np.pad(scores, 1, constant_values=beyond).astype(np.float32)

    def _coarse(self, cells: Any) -> Any:
        """The values of cells at the middles of the coarse cells that are searched."""
        rows, columns = (
            (np.arange(0.5 * CELL, count * self.side, CELL) / self.side).astype(np.int64)
            for count in cells.shape
        )
        return cells[np.ix_(rows, columns)]

    @cached_property
    def _field(self) -> Field:
        """The coarse map that is searched: high in walls and next to them, low in free cells."""
        distance = self._coarse(self._distance)
        # A wall may touch just the corner of a coarse cell.
        steps = [distance <= 0.7 * CELL, distance <= BLUR, self._coarse(self.free)]
        return Field(np.select(steps, [3, 2, -1]).astype(np.int8), 0.0, 0.0)

    @cached_property
    def _positions(self) -> Int:
        """Columns and rows (s, 2) of the coarse cells in which the robot may be."""
        free = self._coarse(self.free & (self._distance >= ROOM))
        stride = int(np.ceil(max(2.0, np.sqrt(free.sum() / MOST_POSITIONS))))
        rows, columns = np.nonzero(free[::stride, ::stride])
        return np.ascontiguousarray(stride * np.column_stack([columns, rows]))

    def search(self, hits: Records) -> list[Fit]:
        """The places on the whole map where hits fit best, the best first.

        The robot is where the map is free, and the hits are in its frame.
        """
        few = some(hits, SEARCHED_HITS)
        near = distinct(self.climbed(self._peaks(few), few))[:MOST_PLACES]
        return distinct(self.climbed(np.array([each.pose for each in near]), hits)) if near else []

    def climbed(self, guesses: Float, hits: Records) -> list[Fit]:
        """The places (k,) to which the score of hits leads from guesses (k, 3)."""
        local = between(self.origin, guesses)
        poses, scores = climbed(local, hits, self._scores, self.side)
        return [*map(Fit, compose(self.origin, poses), scores.tolist())]

    def explained(self, pose: Float, hits: Records) -> float:
        """Share of the hits at a pose (3,) that lie at walls, among those in known cells.

        Where more hits than `MOST_UNKNOWN` are in unknown cells, the others count as not at walls:
        few hits fit somewhere on any map.
        """
        at = between(self.origin, pose)
        walls, known = (mean_score(at, hits, cells, self.side) for cells in self._shares)
        return walls / max(known, 1.0 - MOST_UNKNOWN)

    @cached_property
    def _shares(self) -> tuple[Likelihood, Likelihood]:
        """Masks of the cells at walls and of the known cells, as 0 and 1."""
        near = 0.2  # Distance [m] up to which a hit is at a wall.
        known = self.free | self.occupied
        walls = known & (self._distance < near)
        return np.pad(walls, 1).astype(np.float32), np.pad(known, 1).astype(np.float32)

    def fits(self, pose: Float, hits: Records) -> bool:
        """Whether hits fit better at a pose (3,) than at any of several poses all over the map."""
        poses = between(self.origin, np.vstack([pose, self._anywhere]))
        first, *others = [mean_score(each, hits, self._scores, self.side) for each in poses]
        return first > max(others, default=-np.inf)

    @cached_property
    def _anywhere(self) -> Float:
        """Poses (k, 3) spread evenly over the map."""
        count = 100
        chosen = np.linspace(0, len(self._positions) - 1, min(count, len(self._positions)))
        cells = self._positions[chosen.astype(np.int64)]
        golden = np.pi * (3.0 - np.sqrt(5.0))  # Multiples of this angle are spread evenly.
        headings = wrap_angle(golden * np.arange(len(cells)))
        return compose(self.origin, np.column_stack([CELL * (cells + 0.5), headings]))

    def _peaks(self, hits: Records) -> Float:
        """The poses (k, 3) of the coarse search at which most hits lie in walls, the best first."""
        cells = self._positions
        centre = np.array([0.5 * CELL, 0.5 * CELL, 0.0])
        parts = []
        scored = []
        heading_parts = 16  # Number of parts in which the headings are searched.
        most_peaks = 200  # Number of the best poses of each part that are kept.
        for headings in np.array_split(np.arange(-np.pi, np.pi, STEP), heading_parts):
            # Positions that are poor by a part of the hits are not scored by all of them.
            rough = window_scores(some(hits, ROUGH_HITS), self._field, centre, cells, headings).max(
                axis=0
            )
            least = min(len(cells), max(most_peaks, len(cells) // ROUGH_SHARE))
            kept = cells[np.argpartition(rough, len(cells) - least)[len(cells) - least :]]
            scores = window_scores(hits, self._field, centre, kept, headings)
            most = min(most_peaks, scores.size)
            best = np.argpartition(scores, scores.size - most, axis=None)[scores.size - most :]
            a, s = np.unravel_index(best, scores.shape)
            scored.append(scores[a, s])
            parts.append(np.column_stack([centre[:2] + CELL * kept[s], headings[a]]))
        ranked = np.concatenate(parts)[np.argsort(-np.concatenate(scored), kind="stable")]
        peaks: list[Float] = []
        most_climbed = 120  # Largest number of poses from which the score is climbed.
        next_peak = 0.5  # Least distance between them [m],
        next_turn = 0.15  # or turn [rad].
        while len(ranked) and len(peaks) < most_climbed:
            peak, *_ = ranked
            peaks.append(peak)
            x, y, turn = np.abs(ranked - peak).T
            far = x * x + y * y > next_peak * next_peak
            ranked = ranked[far | (np.minimum(turn, 2.0 * np.pi - turn) > next_turn)]
        return compose(self.origin, np.array(peaks).reshape(-1, 3))


def distinct(places: list[Fit]) -> list[Fit]:
    """The places, the best first, without those that repeat a better one."""
    found: list[Fit] = []
    for place in sorted(places, key=lambda each: -each.score):
        if not any(is_same(place.pose, each.pose) for each in found):
            found.append(place)
    return found
