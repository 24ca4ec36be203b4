"""Structures: the visible part of a world, as buildings and free-standing walls.

A world and the path of the robot enter; arrays of the visible walls leave, in the frame of the
film. Rendering cost depends only on the visible part, however large the world is: walls beyond the
farthest distance that is drawn are cut off. The origin of the frame lies among the walls, because
graphics compute in float32, which far from the origin does not resolve centimetres.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.geometry.lines import LEFT, Bool, Float, Int, cross, directions, lengths
from lrf3d.studio.scene import look
from lrf3d.studio.scene.look import ROOMS, SECTION, TOWN, Setting, object_colours
from lrf3d.studio.scene.shapes import Lines, single
from lrf3d.studio.scene.shown import Shown
from lrf3d.world import World
from lrf3d.world.materials import Material

# Places at which a robot of 1 m radius is to be seen (5, 2) [m].
AROUND = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])

# Distance [m] up to which things are drawn: haze hides what is far beyond a tenth of it.
SIGHT_DISTANCE = 4000.0


class Sight(NamedTuple):
    """The part of a world that can be seen."""

    # The walls within `SIGHT_DISTANCE` of the path; where those are all, the world itself.
    world: World
    # (2,) whole metres near their middle: the origin of the frame to draw in.
    origin: Float

    @classmethod
    def of(cls, world: World, path: Float | None = None) -> "Sight":
        """What can be seen of a world from a path (k, 2) and from its cameras; all without one."""
        if path is None or not len(path):
            return cls(world, world.origin)
        stands = [np.reshape([c.position[:2], c.target[:2]], (2, 2)) for c in world.cameras]
        places = np.concatenate([path, *stands])
        low = places.min(axis=0)
        high = places.max(axis=0)
        world = _near(world, low - SIGHT_DISTANCE, high + SIGHT_DISTANCE)
        return cls(world, world.origin if len(world.segments) else np.round(0.5 * (low + high)))


def _near(world: World, low: Float, high: Float) -> World:
    """The world, its walls clipped to a box; the same object if none leaves the box."""
    ends = world.segments.reshape(-1, 2)
    if ((ends >= low) & (ends <= high)).all() and world.heights.max(initial=0.0) <= SIGHT_DISTANCE:
        return world
    pieces = shapely.clip_by_rect(shapely.linestrings(ends.reshape(-1, 2, 2)), *low, *high)
    kept = np.flatnonzero(shapely.length(pieces) > 0.0)
    objects = world.objects[kept]
    count = int(objects.max(initial=-1)) + 1
    return replace(
        world,
        segments=shapely.get_coordinates(pieces[kept]).reshape(-1, 4),
        objects=objects,
        heights=np.minimum(world.heights[kept], SIGHT_DISTANCE),
        object_names=world.object_names[:count],
        colours=world.colours[:count],
        materials=world.materials[:count],
    )


# Largest height of walls that are those of rooms [m].
INDOOR_HEIGHT = 3.5

# Half the width of openings in the walls of a hall [m].
_DOOR = 2.0

# Least share of all walls that stand in a hall.
_ENCLOSED = 0.9

# Least height of the walls of a hall, in the highest wall.
_AS_HIGH = 0.4

# Tolerance within which the outline of a hall is simplified [m].
_SIMPLER = 0.1

# Distance from a wall at which its inside is looked for [m], less than any wall is thick.
_PROBE = 0.005

# Least share of the walls of an object that lie on the outline of its solid.
_WHOLE = 0.99

# Least area of a solid [m²].
_LEAST_AREA = 1e-4

# Distance within which ends of walls are one corner [m]: files round their coordinates.
_CORNER = 1e-3

# Opacity of upright edges at the foot, in that at the top.
_FOOT_STRENGTH = 0.2

# Range up to which beams without a return light the ground, and from which on hits have the last
# colour [m].
FARTHEST = 30.0

# Largest number of legs of a beam: casters turn it up to eight times.
_MOST_LEGS = 9


@dataclass(frozen=True, eq=False)
class Structures:
    """The walls of a world in the film's frame, and the solids that they close round."""

    # (n, 4) walls x1 y1 x2 y2 [m]; those of solids run with the inside on the left.
    segments: Float
    # (n,) the object of each wall.
    objects: Int
    # (n,) [m].
    heights: Float
    # (n, 3).
    colours: Float
    # (n,) whether a wall is of a solid, and so has one visible side.
    closed: Bool
    # (n,) whether a wall is glass.
    glass: Bool
    # (n,) whether a wall is a mirror.
    mirrors: Bool
    # (k,) polygons of the solids.
    solids: NDArray[Any]
    # (k,) the object that each solid is.
    solid_objects: Int
    # (k,) heights of the roofs [m].
    solid_heights: Float
    # (k, 3).
    solid_colours: Float
    # Whether this is the inside of a house.
    indoor: bool
    # (2,) where the origin of the film's frame lies in the world [m].
    origin: Float
    # (k, 2) where a robot drives [m].
    path: Float

    @cached_property
    def tree(self) -> shapely.STRtree:
        """A search tree of the walls."""
        return shapely.STRtree(shapely.linestrings(self.segments.reshape(-1, 2, 2)))

    @classmethod
    def from_run(cls, run: Shown) -> "Structures":
        """Find the solids of a run's world; outlines that it drove inside of are not.

        Walls that are known from scans alone are low: they hide neither the robot nor the map.
        """
        world = run.world
        if not run.knows_truth:
            world = replace(world, heights=np.minimum(world.heights, SECTION))
        return cls.from_world(world, run.trajectory.poses[:, :2])

    @classmethod
    def from_world(cls, world: World, path: Float | None = None) -> "Structures":
        """Find the solids of a world; an outline around a robot's path (k, 2) is not one.

        What cannot be seen from the path is left out; all is there where no path is given.
        """
        world, origin = Sight.of(world, path)
        segments = world.segments - np.tile(origin, 2)
        path = np.zeros((0, 2)) if path is None else path - origin
        areas = np.full(world.object_count, None, dtype=object)
        groups, built = enclosed_areas(segments, world.objects, world.object_count)
        # Each wall of a solid is a part of its outline; a wall that is not leaves the object open.
        whole = shapely.length(shapely.boundary(built)) >= _WHOLE * shapely.length(groups)
        solid = whole & (shapely.area(built) > _LEAST_AREA)
        areas[solid] = built[solid]
        areas[_rooms(areas, segments, world.objects, path)] = None
        left, right = (_inside(areas[world.objects], segments, aside) for aside in (1.0, -1.0))
        closed = left != right
        turned = right & ~left
        facing = segments.copy()
        facing[turned] = segments[turned][:, [2, 3, 0, 1]]
        indoor = bool(world.heights.max(initial=0.0) <= INDOOR_HEIGHT) or _enclosed(
            segments, world.heights, closed, path
        )
        colours = object_colours(world, indoor=indoor)
        found = np.flatnonzero(~shapely.is_missing(areas))
        tops = np.zeros(world.object_count)
        np.maximum.at(tops, world.objects, world.heights)
        return cls(
            segments=facing,
            objects=world.objects,
            heights=world.heights,
            colours=colours[world.objects].reshape(-1, 3),
            closed=closed,
            glass=walls_of(world, lambda material: material.passes),
            mirrors=turning_walls(world),
            solids=areas[found],
            solid_objects=found,
            solid_heights=tops[found],
            solid_colours=colours[found].reshape(-1, 3),
            indoor=indoor,
            origin=origin,
            path=path,
        )

    @property
    def tops(self) -> Float:
        """Heights (n,) at which walls end in pictures that cut those of rooms [m]."""
        return np.minimum(self.heights, SECTION if self.indoor else np.inf)

    def crossed(self, starts: Float, ends: Float) -> tuple[Int, Int, Float]:
        """Ways from starts to ends (n, 2) and walls that cross: numbers, and shares of the ways."""
        ways = shapely.linestrings(np.stack([starts, ends], axis=1))
        number, wall = self.tree.query(ways, predicate="intersects")
        begin, end = np.hsplit(self.segments[wall], 2)
        turn = cross((ends - starts)[number], end - begin)
        # What runs along a wall meets it at once.
        turn = np.where(turn == 0.0, np.inf, turn)
        return number, wall, cross(begin - starts[number], end - begin) / turn

    def blocked(self, eyes: Float, ends: Float, tops: Float) -> tuple[Int, Int, Float]:
        """Which lines of sight from eyes to ends (n, 3) which walls block, and at which shares.

        The walls have tops (w,).
        """
        number, wall, share = self.crossed(eyes[:, :2], ends[:, :2])
        blocks = tops[wall] > eyes[number, 2] + share * (ends - eyes)[number, 2]
        number, wall, share = number[blocks], wall[blocks], share[blocks]
        nearest = np.lexsort([share, number])
        number, first = np.unique(number[nearest], return_index=True)
        return number, wall[nearest][first], share[nearest][first]

    def hides(self, eyes: Float, robots: Float, radius: float, tops: Float) -> Float:
        """Which share of a robot at places (m, 2) walls with tops (w,) hide, on average.

        It has a radius [m] and is seen from eyes (k, m, 3).
        """
        feet = np.insert(robots[:, None] + radius * AROUND, 2, 0.0, axis=2)
        ends = np.broadcast_to(feet, (len(eyes), *feet.shape)).reshape(-1, 3)
        number, *_ = self.blocked(eyes.reshape(-1, 3).repeat(len(AROUND), axis=0), ends, tops)
        count = len(ends) // len(eyes)
        return np.bincount(number // count, minlength=len(eyes)) / count

    @property
    def setting(self) -> Setting:
        """How streets or rooms look."""
        return ROOMS if self.indoor else TOWN

    @property
    def places(self) -> Float:
        """Ends (m, 2) of all walls [m]."""
        return self.segments.reshape(-1, 2)


def turning_walls(world: World) -> Bool:
    """Which walls (n,) turn beams; glass turns little of the light, and lets the rest pass."""
    return walls_of(world, lambda material: material.mirrors and not material.passes)


def walls_of(world: World, chosen: Callable[[Material], bool]) -> Bool:
    """Which walls (n,) are of chosen materials."""
    objects = [one is not None and chosen(one) for one in world.materials]
    return np.isin(world.objects, np.flatnonzero(objects))


def folded(origin: Float, ends: Float, mirrors: Float) -> tuple[Float, Int, Float]:
    """The legs (l, 4) of beams from an origin (2,) to ends (beams, 2), folded at mirrors (m, 4).

    Returns also the beam (l,) of each, and how far it has gone where the leg begins (l,) [m].
    """
    going = np.arange(len(ends))
    start = np.tile(origin, (len(ends), 1))
    end = ends
    gone = np.zeros(len(ends))
    found: list[tuple[Float, Int, Float]] = []
    while len(going) and len(found) < _MOST_LEGS:
        share, mirror = _first_crossing(start, end, mirrors)
        path = end - start
        place = start + share[:, None] * path
        found.append((np.hstack([start, place]), going, gone))
        turned = mirror >= 0
        gone = (gone + share * np.hypot(*path.T))[turned]
        going = going[turned]
        start = place[turned]
        end = end[turned]
        along = directions(mirrors[mirror[turned]])
        end = end - 2.0 * cross(along, end - start)[:, None] * along @ LEFT
    legs, beams, distances = (np.concatenate(column) for column in zip(*found, strict=True))
    return legs, beams, distances


def _first_crossing(starts: Float, ends: Float, mirrors: Float) -> tuple[Float, Int]:
    """The shares (n,) of paths from starts to ends (n, 2) up to a first mirror, and which it is.

    The share is 1 and the mirror −1 where a path meets none.
    """
    path = (ends - starts)[:, None]
    along = mirrors[:, 2:] - mirrors[:, :2]
    offset = mirrors[:, :2] - starts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = cross(path, along)
        share = cross(offset, along) / turn
        place = cross(offset, path) / turn
    meets = (share > look.TINY) & (share < 1.0) & (place >= 0.0) & (place <= 1.0)
    share = np.column_stack([np.ones(len(starts)), np.where(meets, share, np.inf)])
    nearest = np.argmin(share, axis=1)
    return share[np.arange(len(share)), nearest], nearest - 1


def outlines_of(structures: Structures) -> Lines:
    """Edges of houses as faint lines; of rooms, where walls are cut."""
    walls = structures.segments
    tops = structures.tops
    if not structures.indoor:
        walls = walls[structures.closed]
        tops = tops[structures.closed]
    a, b = (np.column_stack([ends, tops]) for ends in np.hsplit(walls, 2))
    starts = np.concatenate([a, a * [1.0, 1.0, 0.0]])
    colours = np.tile(look.OUTLINE, (len(starts), 1))
    opacities = np.full((len(starts), 2), look.OUTLINE_STRENGTH)
    opacities[len(a) :, 0] *= _FOOT_STRENGTH
    ends = np.concatenate([b, a])
    return Lines(single(starts), single(ends), single(colours), single(opacities), look.FINE)


def _enclosed(segments: Float, heights: Float, closed: Bool, path: Float) -> bool:
    """Whether free-standing walls enclose the rest and the path: a hall or a flat, not a town."""
    free = ~closed
    if not free.any() or not len(path):
        return False
    if float(np.median(heights[free])) < _AS_HIGH * float(heights.max()):
        return False
    filled = filled_between(segments[free], _DOOR)
    hall = shapely.simplify(filled[int(np.argmax(shapely.area(filled)))], _SIMPLER)
    shapely.prepare(hall)
    middles = 0.5 * (segments[:, :2] + segments[:, 2:])
    within = shapely.contains_xy(hall, *middles.T) * lengths(segments)
    inside = shapely.contains_xy(shapely.buffer(hall, -_DOOR), *path.T)
    return bool(inside.all() and within.sum() >= _ENCLOSED * lengths(segments).sum())


def filled_between(segments: Float, reach: float) -> NDArray[Any]:
    """Polygons (k,), without holes, that walls (n, 4) thickened by a reach [m] enclose."""
    walls = shapely.buffer(shapely.linestrings(segments.reshape(-1, 2, 2)), reach)
    parts = shapely.get_parts(shapely.union_all(walls))
    parts = parts[shapely.get_type_id(parts) == 3]
    return np.asarray(shapely.polygons(shapely.get_exterior_ring(parts)))


def enclosed_areas(segments: Float, objects: Int, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The walls (count,) of each object, and what they enclose; None for objects without walls."""
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    order = np.argsort(objects, kind="stable")
    groups = np.full(count, None, dtype=object)
    groups = shapely.multilinestrings(lines[order], indices=objects[order], out=groups)
    # Areas need an end wherever walls touch or cross, and one wall where two lie on each other.
    groups = shapely.union(groups, shapely.MultiLineString(), grid_size=_CORNER)
    return groups, shapely.build_area(groups)


def _rooms(areas: NDArray[Any], segments: Float, objects: Int, path: Float) -> Bool:
    """Which areas (k,) are rooms: the robot was inside, or all walls of another object are."""
    tree = shapely.STRtree(areas)
    count = len(areas)
    _, rooms = tree.query(shapely.points(path), "within")
    middles = shapely.points(0.5 * (segments[:, :2] + segments[:, 2:]))
    wall, area = tree.query(middles, predicate="within")
    # Pairs of an object and an area that some of its walls are in.
    pairs, counts = np.unique(objects[wall] * count + area, return_counts=True)
    owner, around = np.divmod(pairs, count)
    whole = (owner != around) & (counts == np.bincount(objects, minlength=count)[owner])
    return np.isin(np.arange(count), [*rooms, *around[whole]])


def _inside(areas: NDArray[Any], walls: Float, aside: float) -> Bool:
    """Whether areas (n,) lie on the left (1), or the right (−1), of walls (n, 4)."""
    places = 0.5 * (walls[:, :2] + walls[:, 2:]) + aside * _PROBE * directions(walls) @ LEFT
    shapely.prepare(areas)
    return np.asarray(shapely.contains_xy(areas, *places.T))
