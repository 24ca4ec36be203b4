"""Free space: a grid over a world, the places where a robot can be, and the steps between them.

Doors, windows and gaps connect inside and outside, so connectivity alone does not tell them apart.
Outside is what a disc as wide as a wide door sweeps from the border; in a town it is all that is
connected with that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.planning import Side
from lrf3d.world.grid_walls import grown, on_border, parts_of
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import groups

# Width of an opening [m] above which the space behind it is outside, like the land around.
WIDEST_DOOR = 2.5

# Width of an opening [m] up to which it is a door between two rooms.
DOORWAY = 1.3

# Least length of the walls along rooms, as a share of those along the outside, for the robot to
# drive inside.
SUBSTANTIAL = 0.7

# Least distance of the robot from walls [m]: the error of the follower.
MARGIN = 0.05

# Distance of the robot from walls [m] where there is room.
COMFORT = 0.3

# Radius [m] of the smallest usual robot, for which sides of walls and rooms are computed.
THINNEST = 0.12


class Ground:
    """Square cells (columns, rows) of a size [m] over a world, or over a part that is very large.

    Each cell has a place (columns, rows, 2) [m] in the world's local frame, its distance to walls
    [m] as gap, 0 if a map does not know it to be free, and as nearest the number of the nearest of
    the pieces (k, 2), which belong to the walls (k,). Large worlds are cut off around a start (2,)
    [m]; areas (k, 2) [m] may be excluded.
    """

    def __init__(
        self, world: World, start: Float | None = None, keep_out: Sequence[Float] = ()
    ) -> None:
        segments = world.segments - np.tile(world.origin, 2)
        around = None if start is None else start - world.origin
        low, high = _window(segments.reshape(-1, 2), around)
        # Walls just outside of the planned area count, too, near its border.
        box = *(low - WIDEST_DOOR), *(high + WIDEST_DOOR)
        lines = shapely.clip_by_rect(shapely.linestrings(segments.reshape(-1, 2, 2)), *box)
        # Distances are measured to the ends of pieces of a decimetre, and off by 3 mm at most.
        pieces, walls = shapely.get_coordinates(shapely.segmentize(lines, 0.1), return_index=True)
        if not len(pieces):
            near = " near the start" if len(segments) else ""
            raise InputError(f"{world.name or 'world'}: no walls{near}, so no route can be found")
        self.world = world
        self.pieces = pieces
        self.walls = walls
        # Some 250,000 cells; of the least side a doorway is still some cells wide.
        self.size = max(float(np.sqrt(np.prod(high - low) / 250_000)), 0.08)
        self._corner = low + world.origin
        shape = tuple(np.ceil((high - low) / self.size).astype(int).tolist())
        self.places = low + self.size * (np.moveaxis(np.indices(shape), 0, -1) + 0.5)
        self.tree = cKDTree(pieces)
        self.gaps, self.nearest = map(np.asarray, self.tree.query(self.places))
        self._leave_walls()
        self.swept = self._swept()
        if world.free is not None:
            known = world.free.contain(self.places.reshape(-1, 2) + world.origin)
            self.gaps[~known.reshape(self.gaps.shape)] = 0.0
        areas = [shapely.Polygon(area - world.origin).buffer(0.0) for area in keep_out]
        self._kept_out = shapely.union_all(areas)
        if areas:
            self.gaps = np.minimum(self.gaps, self._off_areas(self.places))

    def clearance(self, places: Float) -> Float:
        """Distances (k,) [m] of places (k, 2), in the local frame, to walls and to areas."""
        off = np.asarray(self.tree.query(places)[0])
        return off if self._kept_out.is_empty else np.minimum(off, self._off_areas(places))

    def _off_areas(self, places: Float) -> Float:
        return np.asarray(shapely.distance(self._kept_out, shapely.points(places)))

    def cells_at(self, points: Float) -> Bool:
        """The cells (columns, rows) in which some points (k, 2) [m] lie."""
        cells = np.zeros(self.gaps.shape, dtype=np.bool_)
        place = np.floor((points - self._corner) / self.size).astype(np.int64)
        cells[tuple(place[((place >= 0) & (place < cells.shape)).all(axis=1)].T)] = True
        return cells

    def _leave_walls(self) -> None:
        """Move places near walls away from them within their cells: doors are passed mid-way."""
        near = (self.gaps < WIDEST_DOOR / 2.0) & (self.gaps > 0.0)
        places = self.places[near]
        away = (places - self.pieces[self.nearest[near]]) / self.gaps[near][:, None]
        for share in (0.25, 0.5):
            moved = places + share * self.size * away
            there, nearest = map(np.asarray, self.tree.query(moved))
            better = there > self.gaps[near]
            cells = tuple(each[better] for each in np.nonzero(near))
            self.places[cells] = moved[better]
            self.gaps[cells] = there[better]
            self.nearest[cells] = nearest[better]

    @cached_property
    def passable(self) -> Bool:
        """Which cells are far enough from walls that none stands between neighbouring cells."""
        return np.asarray(self.gaps >= max(THINNEST, 1.25 * self.size))

    @cached_property
    def steps(self) -> Int:
        """The flat indices (2, k) of pairs of neighbouring passable cells."""
        return neighbours(self.passable)

    @cached_property
    def wide(self) -> Bool:
        """Which cells are wider than a doorway."""
        return np.asarray(self.gaps >= 0.5 * DOORWAY)

    @cached_property
    def rooms(self) -> Int:
        """The room (columns, rows) of each passable cell, from 1; 0 in the others.

        A room is a connected area wider than a doorway, with the cells nearest to it. Narrow
        places, such as passages, are rooms of their own.
        """
        cores, _ = parts_of(self.wide)
        nearest = scipy.ndimage.distance_transform_edt(
            cores == 0, return_distances=False, return_indices=True
        )
        core = cores[tuple(nearest)].ravel()
        one, other = self.steps
        # Cells beyond a wall may be near to a room, but are not connected with it.
        same = core[one] == core[other]
        piece = groups(one[same], other[same], core.size).reshape(cores.shape)
        _, number = np.unique(np.where(self.passable, piece, -1), return_inverse=True)
        return number.reshape(cores.shape) + int(self.passable.all())

    @cached_property
    def doorways(self) -> tuple[Int, Int]:
        """The pairs (k, 2) of rooms side by side, and the widest cell (k,) between each two."""
        rooms = self.rooms.ravel()
        gaps = self.gaps.ravel()
        steps = self.steps[:, np.ptp(rooms[self.steps], axis=0) > 0]
        pairs = np.sort(rooms[steps], axis=0)
        order = np.argsort(-gaps[steps].min(axis=0), kind="stable")
        number = pairs[0] * (rooms.max() + 1) + pairs[1]
        _, first = np.unique(number[order], return_index=True)
        widest = order[first]
        one, other = steps[:, widest]
        return pairs[:, widest].T, np.where(gaps[one] < gaps[other], one, other)

    def _swept(self) -> Bool:
        """Which cells a disc as wide as a wide door sweeps from the border."""
        parts, _ = parts_of(self.gaps >= 0.5 * WIDEST_DOOR)
        border = on_border(parts)
        return grown(np.isin(parts, border[border > 0]), 0.5 * WIDEST_DOOR / self.size)

    @cached_property
    def _sides(self) -> tuple[Bool, bool]:
        """Which cells are outside, and whether the robot drives there if no side is given.

        The inside of a building is no room: a closed part with one object around it that is high,
        or that encloses nothing else and is seen from outside next to others, unlike a plan whose
        outer wall has a line on each side.
        """
        world = self.world
        parts, count = parts_of(self.passable)
        wall = self.walls[self.nearest]
        objects = world.objects[wall]
        is_open = np.bincount(parts[self.swept], minlength=count + 1) > 0
        owner = largest(objects, parts, count + 1)
        mixed = np.bincount(parts[objects != owner[parts]], minlength=count + 1) > 0
        closed = ~mixed & ~is_open
        alone = np.bincount(owner[closed], minlength=world.object_count)[owner] == 1
        several = len(np.unique(objects[self.swept])) > 1
        high = largest(world.heights[wall], parts, count + 1) > DEFAULT_HEIGHT
        building = closed & (high | alone & several)
        indoors = ~self.swept & ~building[parts]
        rooms = len(np.unique(self.nearest[self.passable & indoors]))
        outdoors = len(np.unique(self.nearest[self.passable & self.swept]))
        # Otherwise it is a town, or a few walls in the open, which enclose hardly anything.
        substantial = rooms >= SUBSTANTIAL * outdoors
        return (self.swept, False) if substantial else (is_open[parts], True)

    def on_side(self, where: Side | None, start: tuple[int, int] | None) -> Bool:
        """Which cells may be driven in: those on one side of the walls, or all of a map's."""
        if where is None and self.world.free is not None:
            return self.gaps > 0.0
        outside, open_air = self._sides
        if where is None and start is not None:
            where = "outside" if self.swept[start] else "inside"
        return np.asarray(outside == (open_air if where is None else where == "outside"))


@dataclass(frozen=True)
class FreeSpace:
    """The cells (columns, rows) in which the middle of a robot of a radius [m] may be.

    The drive starts in one of the cells, or anywhere.
    """

    ground: Ground
    radius: float
    allowed: Bool
    start: tuple[int, int] | None = None

    @cached_property
    def places(self) -> Float:
        """The places (k, 2) [m] in the cells, in the local frame."""
        return np.asarray(self.ground.places[self.allowed])

    @cached_property
    def gaps(self) -> Float:
        """Distances (k,) of the places to walls [m]."""
        return self.ground.gaps[self.allowed]

    @cached_property
    def number(self) -> Int:
        """The place of each of the cells (columns, rows); −1 in the others."""
        count = np.cumsum(self.allowed).reshape(self.allowed.shape)
        return np.where(self.allowed, count - 1, -1)

    def nearest(self, place: Float) -> int | None:
        """The free place nearest to a place (2,) [m] of the world; None if it is too far away.

        A robot that is sent into a corner drives as far as it can.
        """
        away = np.hypot(*(self.places - (place - self.ground.world.origin)).T)
        found = int(np.argmin(away))
        return found if away[found] <= self.radius + MARGIN + self.ground.size else None

    def why_missed(self, place: Float) -> str:
        """Why no free place is near to a place (2,) [m] of the world."""
        free = self.ground.world.free
        seen = free is None or free.contain(place[None])[0]
        return "no way leads there" if seen else "the map does not show that ground"

    @property
    def side(self) -> Side:
        """The side of the walls. In a map what is unknown may look like the outside."""
        outside = self.ground.swept[self.allowed]
        known = self.ground.world.free is not None
        return "outside" if (outside.mean() > 0.5 if known else outside.any()) else "inside"

    def cost(self, gaps: Float) -> Float:
        """The cost of a metre at distances to walls [m]: it rises steeply near them, from 2 m on.

        So doors and narrow places are passed only to get behind them, and in their middle.
        """
        near = np.maximum(2.0 / np.maximum(gaps, MARGIN), 1.0) ** 3
        return np.where(gaps < self.radius + COMFORT, 4.0 * near, near)

    @cached_property
    def graph(self) -> Any:
        """The costs of the steps between neighbouring places, as a sparse matrix (k, k)."""
        count = len(self.places)
        one, other = (self.number.ravel()[cells] for cells in neighbours(self.allowed))
        length = np.hypot(*(self.places[one] - self.places[other]).T)
        # Where walls are nearer than this, one may come too near to the line between the two.
        clear = np.minimum(self.gaps[one], self.gaps[other]) >= np.hypot(self.radius, 0.5 * length)
        price = self.cost(self.gaps)
        costs = (0.5 * length * (price[one] + price[other]))[clear]
        graph = coo_array((costs, (one[clear], other[clear])), shape=(count, count)).tocsr()
        return graph + graph.T


def largest(values: Float | Int, parts: Int, count: int) -> Any:
    """The largest of values (…), 0 or more, in each of a count of parts; 0 in those without any."""
    found = np.zeros(count, values.dtype)
    np.maximum.at(found, parts.ravel(), values.ravel())
    return found


def neighbours(cells: Bool) -> Int:
    """The flat indices (2, k) of pairs of neighbouring cells, also round corners."""
    index = np.arange(cells.size).reshape(cells.shape)
    pairs = []
    for here, there in (
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
        (np.s_[:-1, 1:], np.s_[1:, :-1]),
    ):
        both = cells[here] & cells[there]
        pairs.append(np.stack([index[here][both], index[there][both]]))
    return np.concatenate(pairs, axis=1)


def free_places(world: World, least: float) -> Float:
    """Places (k, 2) [m] at least so far away from all walls [m] between which a robot can drive."""
    return find_free_space(Ground(world), least - MARGIN).places + world.origin


def find_free_space(
    ground: Ground, radius: float, *, where: Side | None = None, start: Float | None = None
) -> FreeSpace:
    """The free space of a robot: of parts with walls between them that along most of the walls.

    If a start x, y [m] or a side of the walls is given, the space lies around or on it.
    """
    name = ground.world.name or "world"
    least = radius + MARGIN
    begin = None
    free = ground.gaps >= least
    if start is not None:
        apart = np.hypot(*np.moveaxis(ground.places - (start - ground.world.origin), -1, 0))
        apart[~free] = np.inf
        row, column = np.unravel_index(np.argmin(apart), apart.shape)
        begin = int(row), int(column)
        # A wall may be between them.
        if apart[begin] > ground.tree.query(start - ground.world.origin)[0]:
            x, y = start
            raise InputError(
                f"{name}: no room {least:g} m off walls around the start ({x:g}, {y:g})"
            )
    allowed = free & ground.on_side(where, begin)
    if not allowed.any():
        place = f"place {where} the walls" if where else "place"
        found = f"no {place} {least:g} m away from all walls"
        raise InputError(f"{name}: {found}; give a route or a smaller radius")
    if begin is not None and not allowed[begin]:
        raise InputError(f"{name}: the start does not lie {where} the walls")
    space = FreeSpace(ground, radius, allowed, begin)
    count, label = connected_components(space.graph, directed=False)
    # In 32 bits, the numbers of pairs of parts and pieces of a town wrap around.
    part = label.astype(np.int64)
    # The drive stays in the part around its start, or in that along most of the walls.
    if begin is not None:
        chosen = part[space.number[begin]]
    else:
        pieces = len(ground.pieces)
        along = np.unique(part * pieces + ground.nearest[allowed]) // pieces
        # Around the walls of a map there may be a strip of free cells.
        open_air = np.bincount(part, ground.swept[allowed]) > 0.5 * np.bincount(part)
        worth = np.where(open_air, SUBSTANTIAL, 1.0)
        chosen = np.argmax(worth * np.bincount(along, minlength=count))
    kept = allowed.copy()
    kept[allowed] = part == chosen
    return FreeSpace(ground, radius, kept, begin)


def _window(ends: Float, around: Float | None) -> tuple[Float, Float]:
    """Corners (2,) of the box around all ends (n, 2), or where most are if that is too wide."""
    inside = ends if around is None else np.vstack([ends, around])
    border = 6.0  # Distance around the walls [m] in which the robot may drive.
    # The middle of the world is at (0, 0).
    low = inside.min(axis=0, initial=0.0) - border
    high = inside.max(axis=0, initial=0.0) + border
    # Largest side [m] of the part of a world that is planned in, as much as a drive can show.
    widest_window = 500.0
    if (high - low).max() > widest_window:
        if around is None:
            tiles = np.floor(ends / (0.5 * widest_window))
            _, tile, counts = np.unique(tiles, axis=0, return_inverse=True, return_counts=True)
            around = ends[tile.reshape(-1) == np.argmax(counts)].mean(axis=0)
        low = np.maximum(low, around - widest_window / 2)
        high = np.minimum(high, around + widest_window / 2)
    return low, high
