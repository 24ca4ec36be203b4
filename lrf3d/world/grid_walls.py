"""Walls of an occupancy grid: the fewest straight segments within half a cell of its outlines.

The input is cells, the output segments in units of cells. Pieces on one line are joined across gaps
of a few cells, because measured maps have holes; walls whose outlines join are sealed at corners.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Float, Int
from lrf3d.world.outlines import chains_of
from lrf3d.world.sealing import STRIP_WIDTH, FittedWall, seal
from lrf3d.world.straight_runs import cut_into_runs, hull_of, is_straight

LARGEST_GAP = 8.5
"""Widest gap [half cells] between pieces of one wall: three empty cells."""


def walls_of_grid(occupied: Bool) -> Float:
    """Segments (n, 4) [cells], relative to the outer corner of the first cell of the first row.

    Args:
        occupied: (rows, columns) whether each cell is occupied; the first row is at the bottom.
    """
    runs = _Runs.of(occupied)
    if not len(runs.points):
        return np.empty((0, 4))
    runs.merge()
    walls = runs.walls()
    return walls[np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]) > 1e-9] / 2.0


@dataclass
class _Runs:
    """Straight runs of points.

    Args:
        points: (n, 2) points [half cells].
        owner: (n,) the run that each belongs to.
        links: (k, 2) pairs of joined points of different runs.
    """

    points: Int
    owner: Int
    links: Int

    @classmethod
    def of(cls, occupied: Bool) -> "_Runs":
        """The fewest runs of each outline; a single cell is a run of its own."""
        chains, lone = chains_of(occupied)
        points, owners, links = [np.empty((0, 2), dtype=np.int64)], [np.empty(0, np.int64)], []
        count = runs = 0
        for chain in chains:
            start = _first_corner(chain.points) if chain.closed else 0
            row = np.roll(chain.points, -start, axis=0)
            cuts = cut_into_runs(row, STRIP_WIDTH)
            owner = np.zeros(len(row), dtype=np.int64)
            owner[cuts[1:]] = 1
            points.append(row)
            owners.append(runs + np.cumsum(owner))
            links += [(count + cut - 1, count + cut) for cut in cuts[1:].tolist()]
            if chain.closed and len(cuts) > 1:
                links.append((count + len(row) - 1, count))
            count, runs = count + len(row), runs + len(cuts)
        points.append(lone)
        owners.append(runs + np.arange(len(lone)))
        joined = np.concatenate(points)
        shared = _equal_points(joined, count)
        every = np.concatenate([np.array(links, dtype=np.int64).reshape(-1, 2), shared])
        return cls(joined, np.concatenate(owners), every)

    def merge(self) -> None:
        """Merge nearby runs into the longest ones where they lie in the same strip."""
        from scipy.spatial import cKDTree

        count = int(self.owner.max()) + 1
        order = np.argsort(self.owner, kind="stable")
        members = np.split(order, np.cumsum(np.bincount(self.owner, minlength=count))[:-1])
        hulls = [hull_of(self.points[member]) for member in members]
        sizes = [float(np.ptp(hull, axis=0).max()) for hull in hulls]
        pairs = cKDTree(self.points).query_pairs(LARGEST_GAP, output_type="ndarray")
        pairs = np.unique(np.sort(self.owner[pairs], axis=1), axis=0)
        near: list[set[int]] = [set() for _ in range(count)]
        for one, other in pairs[pairs[:, 0] != pairs[:, 1]].tolist():
            near[one].add(other)
            near[other].add(one)
        merged_into = np.arange(count)
        for seed in sorted(range(count), key=lambda run: -sizes[run]):
            if merged_into[seed] != seed or sizes[seed] == 0.0:
                continue
            waiting, refused = set(near[seed]), {seed}
            while waiting:
                run = max(waiting, key=lambda other: (sizes[other], -other))
                waiting.discard(run)
                refused.add(run)
                if merged_into[run] != run:
                    continue
                both = np.concatenate([hulls[seed], hulls[run]])
                if is_straight(both, STRIP_WIDTH):
                    hulls[seed] = hull_of(both)
                    merged_into[run] = seed
                    waiting |= near[run] - refused
        # Longer runs come first, so no run that has grown is merged into another one later.
        self.owner = merged_into[self.owner]
        self.hulls = hulls

    def walls(self) -> Float:
        """Segments (n, 4) [half cells], sealed where outlines join."""
        _, owner = np.unique(self.owner, return_inverse=True)
        order = np.argsort(owner, kind="stable")
        members = np.split(order, np.cumsum(np.bincount(owner))[:-1])
        walls = [FittedWall.through(self.points[member]) for member in members]
        bridges = []
        for one, other in self.links.tolist():
            wall, next_wall = walls[owner[one]], walls[owner[other]]
            if wall is not next_wall:
                bridges += seal(wall, next_wall, self.points[one], self.points[other])
        joined = set(owner[self.links].reshape(-1).tolist())
        pieces = [np.array(bridges, dtype=np.float64).reshape(-1, 4)]
        for number, wall in enumerate(walls):
            if not wall.is_point:
                pieces.append(wall.ends.reshape(1, 4))
            elif number not in joined:
                pieces.append((wall.ends + LONE).reshape(1, 4))
        return np.concatenate(pieces)


LONE = np.array([[-1.0, -1.0], [1.0, 1.0]])
"""A single cell becomes its diagonal [half cells], which is visible from most sides."""


def _first_corner(points: Int) -> int:
    """The point at which a ring is opened: the one farthest from its middle, which is a corner."""
    away = points - points.mean(axis=0)
    return int(np.argmax((away**2).sum(axis=1)))


def _equal_points(points: Int, count: int) -> Int:
    """Pairs (k, 2) of equal points among the first ones, as outlines share at forks."""
    order = np.lexsort(points[:count].T)
    same = (points[order][1:] == points[order][:-1]).all(axis=1)
    return np.column_stack([order[:-1][same], order[1:][same]])
