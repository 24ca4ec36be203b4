"""Known places: a map as cells, and the places on it where the hits of a drive fit.

A world, a ROS map or a run enters. Its occupied cells give the likelihood field of Thrun et al.
(2005, section 6.4): the likelihood of a hit depends on its distance to the nearest occupied cell; a
hit in an unknown cell counts little. A map of cells is used as it is; walls are drawn into cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Bool, Float, Int, Records, wrap_angle
from lrf3d.geometry.pose import between, compose
from lrf3d.laser.free_space import distinct_poses
from lrf3d.matching.likelihood import (
    Lattice,
    Likelihood,
    climbed,
    lattice_scores,
    mean_score,
    some,
)
from lrf3d.matching.search import CELL
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

# Least distance from walls [m] of positions that are searched.
ROOM = 0.2

# Step of the headings that are searched [rad].
STEP = 0.05

# Largest number of positions that are searched; on larger maps they are farther apart.
MOST_POSITIONS = 40_000

# Number of hits that the coarse search uses.
SEARCHED_HITS = 100

# Largest number of places that are scored with all hits.
MOST_PLACES = 30

# Distance [m] and turn [rad] up to which two poses are the same place.
APART = 1.0
TURNED = 0.3

# Scales at which scans are compared with a map.
SCALES = np.linspace(0.9, 1.1, 21)

# Largest deviation from 1 of a correct scale: maps and lasers of others differ by up to 2 %.
AGREED_SCALE = 0.025


@compiled
def is_same(first: Float, second: Float, apart: float, turned: float) -> bool:
    """Whether two poses (3,) are within a distance [m] and a turn [rad] of each other."""
    turn = abs(first[2] - second[2])
    near = np.hypot(first[0] - second[0], first[1] - second[1]) < apart
    return bool(near and min(turn, 2.0 * np.pi - turn) < turned)


@compiled
def distinct(poses: Float, apart: float, turned: float, most: int) -> Int:
    """The indices of at most some poses (k, 3), the best first, that repeat no better one."""
    found = np.empty(most, np.int64)
    count = 0
    for k in range(len(poses)):
        repeats = False
        for n in found[:count]:
            repeats = repeats or is_same(poses[k], poses[n], apart, turned)
        if not repeats and count < most:
            found[count] = k
            count += 1
    return found[:count]


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
        side = max(cell_size(world), widest)
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
    def _lattice(self) -> Lattice:
        """The coarse map that is searched: high in walls and next to them, low in free cells."""
        distance = self._coarse(self._distance)
        # A wall may touch just the corner of a coarse cell.
        steps = [distance <= 0.7 * CELL, distance <= BLUR, self._coarse(self.free)]
        scores = np.select(steps, [3, 2, -1]).astype(np.int16)
        free = self._coarse(self.free & (self._distance >= ROOM))
        stride = int(np.ceil(max(2.0, np.sqrt(free.sum() / MOST_POSITIONS))))
        high, wide = (size + -size % stride for size in scores.shape)
        scores = np.pad(scores, [(0, high - len(scores)), (0, wide - len(scores.T))])
        blocks = scores.reshape(high // stride, stride, wide // stride, stride)
        return np.ascontiguousarray(blocks.transpose(1, 3, 0, 2))

    @cached_property
    def _positions(self) -> Int:
        """Rows and columns (s, 2) of the lattice at which the robot may be."""
        stride = len(self._lattice)
        free = self._coarse(self.free & (self._distance >= ROOM))
        return np.argwhere(free[::stride, ::stride])

    def _poses(self, positions: Int, headings: Float) -> Float:
        """Poses (k, 3) at positions (k, 2) of the lattice, with headings (k,)."""
        places = CELL * (len(self._lattice) * positions[:, ::-1] + 0.5)
        return compose(self.origin, np.column_stack([places, headings]))

    def search(self, hits: Records) -> Float:
        """The poses (k, 3) on the whole map where hits fit best, the best first.

        The robot is where the map is free, and the hits are in its frame.
        """
        few = some(hits, SEARCHED_HITS)
        return self._reached(self._reached(self._peaks(few), few), hits)

    def _reached(self, guesses: Float, hits: Records) -> Float:
        """The poses to which the score of hits leads from guesses (k, 3), the best first."""
        poses, scores = self.climbed(guesses, hits)
        ranked = poses[np.argsort(-scores, kind="stable")]
        return ranked[distinct(ranked, APART, TURNED, MOST_PLACES)]

    def climbed(self, guesses: Float, hits: Records) -> tuple[Float, Float]:
        """The poses to which the score of hits leads from guesses (k, 3), and the scores (k,).

        A score is the mean log likelihood of the hits.
        """
        local = between(self.origin, guesses)
        poses, scores = climbed(local, hits, self._scores, self.side)
        return compose(self.origin, poses), scores

    def scale(self, poses: Float, scans: Sequence[Records]) -> float:
        """How many times larger this map is than what scans (k,) show at poses (k, 3) on it.

        It is 1 unless most of them fit better at another scale.
        """
        scores = np.array(
            [
                [self.climbed(pose[None], _scaled(hits, scale))[1][0] for scale in SCALES]
                for pose, hits in zip(poses, scans, strict=True)
            ]
        )
        best = int(scores.mean(axis=0).argmax())
        unscaled = scores[:, np.abs(SCALES - 1.0).argmin()]
        is_better = np.median(scores[:, best] - unscaled) > 0.0
        is_other = abs(SCALES[best] - 1.0) > AGREED_SCALE
        return round(float(SCALES[best]), 2) if is_other and is_better else 1.0

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
        golden = np.pi * (3 - np.sqrt(5))  # Multiples of this angle are spread evenly.
        headings = wrap_angle(golden * np.arange(len(chosen)))
        return self._poses(self._positions[chosen.astype(np.int64)], headings)

    def _peaks(self, hits: Records) -> Float:
        """The poses (k, 3) of the coarse search at which most hits lie in walls, the best first."""
        poses = []
        scored = []
        heading_parts = 16  # Number of parts in which the headings are searched.
        most_peaks = 200  # Number of the best positions of each part that are kept.
        for headings in np.array_split(np.arange(-np.pi, np.pi, STEP), heading_parts):
            scores = lattice_scores(hits, self._lattice, CELL, headings)
            highest = scores.max(axis=0)[*self._positions.T]
            most = max(len(highest) - most_peaks, 0)
            best = np.argpartition(highest, most)[most:]
            scored.append(highest[best])
            turned = scores[:, *self._positions[best].T].argmax(axis=0)
            poses.append(self._poses(self._positions[best], headings[turned]))
        ranked = np.concatenate(poses)[np.argsort(-np.concatenate(scored), kind="stable")]
        most_climbed = 120  # Largest number of poses from which the score is climbed.
        # Peaks are half as far apart as places.
        return ranked[distinct(ranked, 0.5 * APART, 0.5 * TURNED, most_climbed)]


def _scaled(hits: Records, scale: float) -> Records:
    """Hits of a scan whose ranges are multiplied by a scale."""
    hits = hits.copy()
    hits["x"] *= scale
    hits["y"] *= scale
    return hits
