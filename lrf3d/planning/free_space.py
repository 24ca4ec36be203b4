"""Free space: the places where a robot can be between the walls, and the steps between them."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.planning.ground import Ground, Side
from lrf3d.world import World

MARGIN = 0.05
"""Distance [m] of the robot from walls that is needed, for what the follower is off the route."""

COMFORT, TIGHT = 0.3, 4.0
"""Distance [m] of the robot from walls that is kept where there is room, and the factor of the cost
of a metre where there is less."""

CLEARANCE = 2.0
"""Distance to walls [m] above which a metre costs no less, if none is given."""


@dataclass(frozen=True)
class FreeSpace:
    """The cells (columns, rows) in which the middle of a robot of a radius [m] may be.

    The drive starts in one of the cells, or anywhere.
    """

    ground: Ground
    radius: float
    clearance: float
    allowed: Bool
    side: Side = "inside"
    start: tuple[int, int] | None = None

    @cached_property
    def places(self) -> Float:
        """The middles (k, 2) [m] of the cells in the local frame."""
        return self.ground.points(self.allowed)

    @cached_property
    def gaps(self) -> Float:
        """Distances (k,) of the places to walls [m]."""
        return self.ground.gaps[self.allowed]

    @cached_property
    def number(self) -> Int:
        """The place of each of the cells (columns, rows); −1 in the others."""
        count = np.cumsum(self.allowed).reshape(self.allowed.shape)
        return np.where(self.allowed, count - 1, -1)

    def cost(self, gaps: Float) -> Float:
        """The cost of a metre at distances to walls [m]: it rises steeply near them.

        So doors and narrow places are passed only to get behind them, and in their middle.
        """
        near = np.maximum(self.clearance / np.maximum(gaps, 1e-3), 1.0) ** 3
        return np.where(gaps < self.radius + COMFORT, TIGHT * near, near)

    @cached_property
    def graph(self) -> Any:
        """The costs of the steps between neighbouring places, as a sparse matrix (k, k)."""
        from scipy.sparse import coo_array

        count, padded = len(self.places), np.pad(self.number, (0, 1), constant_values=-1)
        parts = []
        for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
            other = np.roll(padded, (-step[0], -step[1]), (0, 1))[:-1, :-1]
            both = (self.number >= 0) & (other >= 0)
            pairs = np.stack([self.number[both], other[both]])
            length = self.ground.size * math.hypot(*step)
            # Where walls are nearer than this, one may come too near to the line between the two.
            clear = self.gaps[pairs].min(axis=0) >= math.hypot(self.radius, 0.5 * length)
            parts.append((pairs[:, clear], length * self.cost(self.gaps)[pairs[:, clear]].mean(0)))
        ends, costs = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
        graph = coo_array((costs, tuple(ends)), shape=(count, count)).tocsr()
        return graph + graph.T


def free_places(world: World, least: float) -> Float:
    """Places (k, 2) [m] at least so far away from all walls [m] between which a robot can drive.

    Raises:
        InputError: There is none.
    """
    return find_free_space(Ground.around(world), least - MARGIN).places + world.origin


def find_free_space(
    ground: Ground,
    radius: float,
    *,
    further: Float | float = 0.0,
    clearance: float = CLEARANCE,
    where: Side | None = None,
    start: Float | None = None,
) -> FreeSpace:
    """The free space of a robot: of parts with walls between them that along most of the walls.

    Further is the additional distance to walls [m] of each cell (columns, rows). If a start x, y
    [m] or a side of the walls is given, the space lies around or on it.

    Raises:
        InputError: There is no room for the robot between the walls.
    """
    from scipy.sparse.csgraph import connected_components

    name, least = ground.world.name or "world", radius + MARGIN
    free = ground.gaps >= least + further
    begin = None if start is None else _cell_near(ground, free, start, least)
    allowed = ground.permitted(free, where, begin)
    if not allowed.any():
        what = "free cell" if ground.world.free is not None else "place"
        on_side = "" if where is None else f" {where} the walls"
        raise InputError(
            f"{name}: no {what}{on_side} that is {least:g} m away from all walls; give a route or a"
            " smaller radius"
        )
    if begin is not None and not allowed[begin]:
        raise InputError(f"{name}: the start does not lie {where} the walls")
    space = FreeSpace(ground, radius, clearance, allowed, start=begin)
    count, part = connected_components(space.graph, directed=False)
    if begin is None:
        pieces = len(ground.pieces)
        along = np.unique(part * pieces + ground.nearest[allowed]) // pieces
        chosen = int(np.argmax(np.bincount(along, minlength=count)))
    else:
        chosen = part[space.number[begin]]
    allowed[allowed] = part == chosen
    outside = ground.outside[allowed]
    # In a map what is unknown may look like the outside.
    is_open = outside.mean() > 0.5 if ground.world.free is not None else outside.any()
    return FreeSpace(ground, radius, clearance, allowed, "outside" if is_open else "inside", begin)


def _cell_near(ground: Ground, free: Bool, start: Float, least: float) -> tuple[int, int]:
    """The free cell nearest to a start, if no wall can be between them.

    Raises:
        InputError: There is none.
    """
    local = start - ground.world.origin
    points = ground.points(free)
    apart = np.hypot(*(points - local).T)
    if apart.min(initial=np.inf) > np.hypot(*(ground.pieces - local).T).min():
        raise InputError(
            f"{ground.world.name or 'world'}: no room around the start ({start[0]:g}, {start[1]:g})"
            f" for a robot that stays {least:g} m away from walls"
        )
    column, row = ground.cells(points[np.argmin(apart)])
    return int(column), int(row)
