"""The ground: a grid over a world with distances to walls, and which of it is inside, or outside.

Doors, windows and gaps connect both, so connectivity alone does not decide it. Outside is what a
disc as wide as a wide door sweeps from the border; in a town it is all that is connected with that.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.world import World
from lrf3d.world.model import DEFAULT_HEIGHT

Side = Literal["inside", "outside"]
"""Side of the walls: inside, among them, or outside of them."""

SURROUNDINGS = 6.0
"""Width [m] of the land around the walls where a robot may drive."""

WIDEST_WINDOW = 500.0
"""Largest side [m] of the part of a world that is planned in, as much as a drive can show."""

CELLS, SMALLEST_CELL = 250_000, 0.08
"""Approximate number of cells, and their least side [m]: a doorway is some cells wide."""

PIECE = 0.1
"""Longest piece of wall [m] to which distances are measured: they are off by 3 mm at most."""

WIDEST_DOOR = 2.5
"""Width [m] of an opening above which what lies behind it is outside, like the land around."""

SUBSTANTIAL = 0.7
"""Least length of the walls along rooms, as a share of those along the outside, for the robot to
drive inside."""


@dataclass(frozen=True)
class Ground:
    """Square cells (columns, rows) of a size [m] over a world, in its local frame.

    Gaps are the distances of their middles to the nearest of the pieces of the walls (k, 2) [m], 0
    where a map does not know them to be free; nearest is its number, and walls (k,) has the wall of
    each piece. Some of the cells are outside.
    """

    world: World
    low: Float
    size: float
    gaps: Float
    outside: Bool
    nearest: Int
    pieces: Float
    walls: Int

    @classmethod
    def around(cls, world: World, start: Float | None = None) -> "Ground":
        """The land of a world, or its densest part or that around a start if it is very large.

        Raises:
            InputError: There are no walls.
        """
        import shapely
        from scipy.spatial import cKDTree

        segments = world.segments - np.tile(world.origin, 2)
        low, high = _window(segments, None if start is None else start - world.origin)
        lines = shapely.clip_by_rect(shapely.linestrings(segments.reshape(-1, 2, 2)), *low, *high)
        pieces, walls = shapely.get_coordinates(shapely.segmentize(lines, PIECE), return_index=True)
        if not len(pieces):
            near = " near the start" if len(segments) else ""
            raise InputError(f"{world.name or 'world'}: no walls{near}, so no route can be found")
        size = max(float(np.sqrt(np.prod(high - low) / CELLS)), SMALLEST_CELL)
        shape = tuple(np.ceil((high - low) / size).astype(int).tolist())
        middles = low + size * (np.moveaxis(np.indices(shape), 0, -1) + 0.5)
        gaps, nearest = (np.asarray(each) for each in cKDTree(pieces).query(middles))
        outside = _outside(gaps, size)
        if world.free is not None:
            known = world.free.contain(middles.reshape(-1, 2) + world.origin)
            gaps = np.where(known.reshape(shape), gaps, 0.0)
        return cls(world, low, size, gaps, outside, nearest, pieces, walls)

    def points(self, cells: Bool) -> Float:
        """The middles (k, 2) [m] of the cells in a mask."""
        return np.asarray(self.low + self.size * (np.argwhere(cells) + 0.5))

    def cells(self, points: Float) -> tuple[Int, Int]:
        """Columns and rows of the cells of points (..., 2) [m], of the nearest ones from beyond."""
        columns, rows = np.moveaxis((points - self.low) / self.size, -1, 0).astype(np.int64)
        width, height = self.gaps.shape
        return np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)

    def permitted(self, free: Bool, where: Side | None, start: tuple[int, int] | None) -> Bool:
        """Which of the free cells may be driven in: those on one side, or all of a map's."""
        if where is None and self.world.free is not None:
            return free
        parts, count = connected(free)
        is_open = np.bincount(parts[self.outside], minlength=count + 1) > 0
        indoors = free & ~self.outside & ~self._in_buildings(parts, is_open)
        rooms, outdoors = (
            len(np.unique(self.nearest[cells])) for cells in (indoors, free & self.outside)
        )
        # Otherwise it is a town, or a few walls in the open, which enclose hardly anything.
        substantial = rooms >= SUBSTANTIAL * outdoors
        outside = self.outside if substantial else is_open[parts]
        if where is not None:
            open_air = where == "outside"
        else:
            open_air = not substantial if start is None else bool(outside[start])
        return np.asarray(free & (outside == open_air))

    def _in_buildings(self, parts: Int, is_open: Bool) -> Bool:
        """Which cells are the inside of a building: a closed part with one object around it.

        It is a high one, or one that encloses nothing else and is seen from outside next to others;
        the rest are rooms, also in a plan whose outer wall has a line on each side.
        """
        from scipy.ndimage import maximum, minimum

        number, world = np.arange(len(is_open)), self.world
        wall = self.walls[self.nearest]
        owner = minimum(world.objects[wall], parts, number).astype(int)
        closed = (owner == maximum(world.objects[wall], parts, number)) & ~is_open
        alone = np.bincount(owner[closed], minlength=world.object_count)[owner] == 1
        several = len(np.unique(world.objects[wall[self.outside]])) > 1
        high = maximum(world.heights[wall], parts, number) > DEFAULT_HEIGHT
        return np.asarray((closed & (high | alone & several))[parts])


def _outside(gaps: Float, size: float) -> Bool:
    """Which cells of a size [m] and with distances to walls [m] lie outside."""
    from scipy.ndimage import distance_transform_edt

    parts, _ = connected(gaps >= 0.5 * WIDEST_DOOR)
    border = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    swept = np.isin(parts, border[border > 0])
    return (
        np.asarray(distance_transform_edt(~swept, sampling=size) <= 0.5 * WIDEST_DOOR) & swept.any()
    )


def _window(segments: Float, around: Float | None) -> tuple[Float, Float]:
    """Corners (2,) of the box around all walls, or where most walls end if that is too wide."""
    ends = (
        segments.reshape(-1, 2) if around is None else np.vstack([segments.reshape(-1, 2), around])
    )
    if not len(ends):
        return np.zeros(2), np.ones(2)
    low, high = ends.min(axis=0) - SURROUNDINGS, ends.max(axis=0) + SURROUNDINGS
    if (high - low).max() <= WIDEST_WINDOW:
        return low, high
    if around is None:
        tiles = np.floor(ends / (0.5 * WIDEST_WINDOW))
        _, tile, counts = np.unique(tiles, axis=0, return_inverse=True, return_counts=True)
        around = ends[tile.reshape(-1) == np.argmax(counts)].mean(axis=0)
    return np.maximum(low, around - WIDEST_WINDOW / 2), np.minimum(high, around + WIDEST_WINDOW / 2)


def connected(cells: Bool) -> tuple[Int, int]:
    """The connected part (columns, rows) of each of some cells, from 1, and the number of parts.

    Cells that touch at a corner are connected; 0 stands for the other cells.
    """
    from scipy.ndimage import label

    parts, count = label(cells, np.ones((3, 3)))
    return np.asarray(parts, dtype=np.int64), int(count)
