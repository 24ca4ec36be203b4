"""Sides: the land around the walls, and which of it is inside, among them, and which outside.

Doors, windows and gaps connect both, so connectivity alone does not decide it. Outside is what a
disc as wide as a wide door sweeps from the border. In a town of closed outlines the streets are
outside, also those that are narrower.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.planning.distances import BLOCK, Distances, connected, distinct, measure_distances
from lrf3d.world import World
from lrf3d.world.model import DEFAULT_HEIGHT

Side = Literal["inside", "outside"]
"""Side of the walls: inside, among them, or outside of them."""

WIDEST_DOOR = 2.5
"""Width [m] of an opening above which what lies behind it is outside, like the land around."""

SUBSTANTIAL = 0.7
"""Least length of the walls along rooms, as a share of those along the outside, for the robot to
drive inside."""

BUILDING, OUTSIDE = 0.3, 0.95
"""Weights of walls along the inside of a building that holds nothing, and along the outside."""

PIECE = 0.25
"""Length [m] of the pieces in which the walls along a space are counted."""


@dataclass(frozen=True)
class Ground:
    """The land that a route may be planned on, whatever the robot.

    Args:
        world: The world.
        segments: (n, 4) its walls in its local frame [m].
        grid: The distances of cells to the walls.
        known: (columns, rows) which cells may be driven in as far as is known.
    """

    world: World
    segments: Float
    grid: Distances
    known: Bool

    @cached_property
    def outside(self) -> Bool:
        """Which cells lie outside."""
        from scipy.ndimage import distance_transform_edt

        parts, _ = connected(self.grid.gaps >= 0.5 * WIDEST_DOOR)
        border = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
        swept = np.isin(parts, border[border > 0])
        if not swept.any():
            return np.asarray(swept)
        away = distance_transform_edt(~swept, sampling=self.grid.size)
        return np.asarray(away <= 0.5 * WIDEST_DOOR)

    def permitted(self, free: Bool, where: Side | None, start: tuple[int, int] | None) -> Bool:
        """Which of the free cells may be driven in: those on one side, or all."""
        if where is None and self.world.free is not None:
            return free
        parts, count = connected(free)
        in_building, open_ = self._buildings(parts, count)
        groups = np.where(self.outside, 1, np.where(in_building[parts], 0, 2))
        _, outdoors, rooms = self.walls_along(np.where(free, groups, 0), count=2)
        if rooms < SUBSTANTIAL * outdoors:
            # A town, or a few walls in the open, which enclose hardly anything.
            outside = open_[parts]
            if where is None:
                return free
        else:
            outside = self.outside
            if where is None:
                where = "outside" if start is not None and outside[start] else "inside"
        return free & (outside if where == "outside" else ~outside)

    def weights(self, parts: Int, count: int) -> Float:
        """How much the walls along each part count: less in buildings and in the open."""
        in_building, open_ = self._buildings(parts, count)
        return np.where(in_building, BUILDING, np.where(open_, OUTSIDE, 1.0))

    def _buildings(self, parts: Int, count: int) -> tuple[Bool, Bool]:
        """Which of the parts 0 (none) to count are the inside of a building, and which are open.

        A building is one object around one part; a higher one may have courtyards.
        """
        free = parts > 0
        open_ = np.bincount(parts[self.outside], minlength=count + 1) > 0
        part, owner = distinct(parts[free], self.world.objects[self.grid.nearest[free]])
        closed = (np.bincount(part)[part] == 1) & ~open_[part]
        part, owner = part[closed], owner[closed]
        high = np.zeros(self.world.object_count, dtype=np.bool_)
        np.logical_or.at(high, self.world.objects, self.world.heights > DEFAULT_HEIGHT)
        enclosed = np.bincount(owner, minlength=len(high))
        is_building = high | ((enclosed == 1) & (len(high) > 1))
        in_building = np.zeros(count + 1, dtype=np.bool_)
        in_building[part] = is_building[owner]
        return in_building, open_

    def walls_along(self, parts: Int, *, count: int) -> Float:
        """Length [m] of the walls along each of the parts 0 (none) to count of the cells."""
        reach = np.full(count + 1, np.inf)
        np.minimum.at(reach, parts.reshape(-1), self.grid.gaps.reshape(-1))
        near = (parts > 0) & (self.grid.gaps < reach[parts] + 2 * BLOCK * self.grid.size)
        wall = self.grid.nearest[near]
        segments, long = self.segments[wall], lengths(self.segments)
        offset = self.grid.points(near) - segments[:, :2]
        station = np.einsum("ij,ij->i", offset, segments[:, 2:] - segments[:, :2]) / long[wall]
        station = np.clip(station, 0.0, 0.999 * long[wall]) // PIECE
        part, wall, piece = distinct(parts[near], wall, station.astype(np.int64))
        amount = np.minimum(PIECE, long[wall] - PIECE * piece)
        return np.bincount(part, amount, count + 1).astype(np.float64)


def survey(world: World, around: Float | None = None) -> Ground:
    """The land of a world, or its densest part where it is very large.

    Raises:
        InputError: There are no walls.
    """
    segments = world.segments - np.tile(world.origin, 2)
    around = None if around is None else around - world.origin
    grid = measure_distances(segments, around) if len(segments) else None
    if grid is None:
        near = " near the start" if len(segments) else ""
        raise InputError(f"{world.name or 'world'}: no walls{near}, so no route can be found")
    known = np.ones(grid.gaps.shape, dtype=np.bool_)
    if world.free is not None:
        known = world.free.contain(grid.points(known) + world.origin).reshape(known.shape)
    return Ground(world, segments, grid, known)
