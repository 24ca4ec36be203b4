"""Sides: the land around the walls, and which of it is inside, among them, and which outside.

Doors, windows and gaps connect both, so connectivity alone does not decide it. Outside is what a
disc as wide as a wide door sweeps from the border; in a town it is all that is connected with that.
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

PIECE = 0.25
"""Length [m] of the pieces in which the walls along a space are counted."""


@dataclass(frozen=True)
class Ground:
    """The land that a route may be planned on: walls (n, 4) and a grid in the local frame [m].

    Cells (columns, rows) are known to be free, or may be as far as is known.
    """

    world: World
    segments: Float
    grid: Distances
    known: Bool

    @classmethod
    def around(cls, world: World, start: Float | None = None) -> "Ground":
        """The land of a world, or its densest part or that around a start if it is very large.

        Raises:
            InputError: There are no walls.
        """
        segments = world.segments - np.tile(world.origin, 2)
        start = None if start is None else start - world.origin
        grid = measure_distances(segments, start) if len(segments) else None
        if grid is None:
            near = " near the start" if len(segments) else ""
            raise InputError(f"{world.name or 'world'}: no walls{near}, so no route can be found")
        known = np.ones(grid.gaps.shape, dtype=np.bool_)
        if world.free is not None:
            known = world.free.contain(grid.points(known) + world.origin).reshape(known.shape)
        return cls(world, segments, grid, known)

    @cached_property
    def outside(self) -> Bool:
        """Which cells lie outside."""
        from scipy.ndimage import distance_transform_edt

        parts, _ = connected(self.grid.gaps >= 0.5 * WIDEST_DOOR)
        border = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
        swept = np.isin(parts, border[border > 0])
        away = distance_transform_edt(~swept, sampling=self.grid.size)
        return np.asarray(away <= 0.5 * WIDEST_DOOR) & swept.any()

    def permitted(self, free: Bool, where: Side | None, start: tuple[int, int] | None) -> Bool:
        """Which of the free cells may be driven in: those on one side, or all of a map's."""
        if where is None and self.world.free is not None:
            return free
        parts, count = connected(free)
        is_open = np.bincount(parts[self.outside], minlength=count + 1) > 0
        in_building = self._buildings(parts, is_open)
        groups = np.where(self.outside, 1, np.where(in_building[parts], 0, 2))
        _, outdoors, rooms = self.walls_along(np.where(free, groups, 0), 2)
        # Otherwise it is a town, or a few walls in the open, which enclose hardly anything.
        substantial = bool(rooms >= SUBSTANTIAL * outdoors)
        outside = self.outside if substantial else is_open[parts]
        if where is not None:
            open_air = where == "outside"
        else:
            open_air = not substantial if start is None else bool(outside[start])
        return np.asarray(free & (outside == open_air))

    def _buildings(self, parts: Int, is_open: Bool) -> Bool:
        """Which parts are the inside of a building: one object around them.

        It is a high one, or one of several that encloses nothing else; others are rooms.
        """
        free, objects = parts > 0, self.world.objects
        part, owner = distinct(parts[free], objects[self.grid.nearest[free]])
        closed = (np.bincount(part)[part] == 1) & ~is_open[part]
        part, owner = part[closed], owner[closed]
        heights = np.zeros(self.world.object_count)
        np.maximum.at(heights, objects, self.world.heights)
        alone = (np.bincount(owner, minlength=len(heights)) == 1) & (len(heights) > 1)
        in_building = np.zeros(len(is_open), dtype=np.bool_)
        in_building[part] = (alone | (heights > DEFAULT_HEIGHT))[owner]
        return in_building

    def walls_along(self, parts: Int, count: int) -> Float:
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
