"""The stage of a run, painted once for all pictures: walls, roofs, ground and light.

Walls and roofs are faces, as bright as they look at the sky; the ground is a picture of streets or
floors, darker next to walls. Painting takes a second, so the stage that was asked for last is kept;
it can be pickled, to be handed to other processes.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFilter

from lrf3d.geometry.lines import LEFT, Float, Int, Single, directions, lengths
from lrf3d.simulation.run import Run
from lrf3d.studio.scene.look import SUN, WALL_LIGHT, WHITE
from lrf3d.studio.scene.shapes import GroundPicture, Painted, single
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.exposure import Exposure, expose, unexposed
from lrf3d.studio.scene.stage.furniture import bedding, is_furniture, is_wooden
from lrf3d.studio.scene.stage.structures import Structures

# What walls show: nothing, windows and doors, skirting and frames, or shelves and drawers. For the
# wall of a room, add 1 if its first end is free, and 2 if its last one is.
PLAIN = 0.0
FACADE = 1.0
ROOM_WALL = 2.0
FURNITURE = 6.0

# Factors of the colour of tops of wood.
_WOOD = np.array([1.12, 0.84, 0.58])

# Largest length of a side of a wall's outline that is its end, at a door [m].
_JAMB = 0.45

# Least height of houses with windows [m].
_WINDOWS_FROM = 3.5

# Inverse of the golden ratio: the fractions of its consecutive multiples are far apart.
_GOLDEN = (5**0.5 - 1) / 2

# Upper bound of the fraction that differs between objects.
_OWN = 0.9

# Length over which two walls at one place are one [m].
_TOGETHER = 0.05

# Half the gap between both faces of a free wall [m]: a ray meets the one that looks at it.
_APART = 0.004

# Least area of a triangle [m²]: outlines that touch themselves have smaller ones.
_LEAST = 1e-7

# Largest number of walls that show reflections: each takes the time of a picture.
_MOST_MIRRORS = 4

# Width of the pavement round houses [m].
PAVEMENT = 1.7

# Longest side of the picture of the ground [pixels]: old graphics cards take no larger ones.
_LONGEST_SIDE = 2048

# Pixels to a side that shapes are painted with in place of one: steps in their edges would show.
_FINER = 2

# Radius by which these are smoothed [pixels].
_BLUR = 0.6

# Brightness of pavements, 0…255.
_PAVED = 134

# Brightness of the joints between tiles, 0…255.
_JOINT = 134

# Share of light that is lost next to walls.
_SHADED = 0.45

# Standard deviation of that loss, in its reach.
_SHADE_SLOPE = 0.25

# Colour of floors, whose tiles are a metre wide, with joints of a pixel.
_FLOOR = np.array([1.0, 0.96, 0.90])


class Stage(NamedTuple):
    """What stands in a world: its structures, their faces, the ground, and its light."""

    structures: Structures
    faces: Painted
    ground: GroundPicture
    exposure: Exposure
    # (m, 5) the longest of the walls that are mirrors, and their heights [m].
    mirrors: Float


@lru_cache(1)
def stage_of(run: Shown) -> Stage:
    """Paint what can be seen of a run's world, or take what was painted for it before."""
    return paint_stage(Structures.from_run(run), run)


def paint_stage(structures: Structures, run: Shown | None = None) -> Stage:
    """Paint walls, roofs and the ground, and when the scans of a run first met them."""
    grid = ground_grid(structures)
    box = grid.corner, grid.corner + grid.extent
    # What is driven by hand has no scans yet: they light it as they come.
    exposure = unexposed(structures, *box)
    if isinstance(run, Run):
        exposure = expose(run, structures, *box)
    walls, tops = (each[structures.mirrors] for each in (structures.segments, structures.heights))
    return Stage(
        structures,
        lay_faces(structures, exposure),
        paint_ground(structures, grid),
        exposure,
        np.column_stack([walls, tops])[np.argsort(-lengths(walls), kind="stable")[:_MOST_MIRRORS]],
    )


def _free_walls(structures: Structures) -> tuple[Int, Float]:
    """The free walls (n,), and the parts (n, 4) of them that lie on no higher or earlier wall.

    Plans have a line twice where rooms meet, and two faces in one plane would flicker.
    """
    lines = structures.tree.geometries
    free = np.flatnonzero(~structures.closed & ~structures.glass)
    later, other = structures.tree.query(lines[free], predicate="dwithin", distance=_APART)
    ranks = np.argsort(np.lexsort([np.arange(len(lines)), -structures.heights]))
    hides = ranks[other] < ranks[free[later]]
    later = later[hides]
    other = other[hides]
    strips = shapely.buffer(lines[other], _APART, cap_style="flat")
    along = shapely.length(shapely.intersection(lines[free[later]], strips)) > _TOGETHER
    hidden = np.full(len(free), shapely.Polygon(), dtype=object)
    shapely.geometrycollections(strips[along], indices=later[along], out=hidden)
    left = shapely.difference(lines[free], shapely.union_all(hidden[:, None], axis=1))
    parts, owner = shapely.get_parts(left, return_index=True)
    there = shapely.length(parts) > _APART
    return free[owner[there]], shapely.get_coordinates(parts[there]).reshape(-1, 4)


def lay_faces(structures: Structures, exposure: Exposure) -> Painted:
    """All walls and flat roofs.

    A wall looks at the cell before it, a roof at that wall of its house which was mapped first.
    """
    # Those of solids are seen from outside, free ones from both sides, and glass has no face.
    solid = np.flatnonzero(structures.closed & ~structures.glass)
    free, parts = _free_walls(structures)
    number = np.concatenate([solid, free, free])
    segments = np.concatenate([structures.segments[solid], parts, parts[:, [2, 3, 0, 1]]])
    off = -directions(segments) @ LEFT
    *_, sun_up = SUN
    even, sunny, foot = WALL_LIGHT
    apart = np.where(structures.closed[number], 0.0, _APART)[:, None]
    level = segments.reshape(-1, 2, 2)[:, [0, 1, 1, 0]] + (apart * off)[:, None]
    high = structures.heights[number, None] * [0.0, 0.0, 1.0, 1.0]
    light = (even + sunny * (off @ SUN[:2]))[:, None] * [foot, foot, 1.0, 1.0]
    steps = exposure.cell * structures.setting.before
    before = np.insert(level + steps * off[:, None], 2, 1.0, axis=2)
    walls = Painted(
        single(np.dstack([level, high])),
        single(light[..., None] * structures.colours[number, None]),
        single(before),
        _skins(structures, number, segments),
        structures.objects[number],
    )
    quads, beds, tints = bedding(structures)
    plain = structures.solids.copy()
    plain[beds] = shapely.Polygon()
    corners, owner = triangles(plain)
    level = np.concatenate([corners[:, [0, 1, 2, 2]], quads])
    tints = np.concatenate([np.where(is_wooden(structures)[owner, None], _WOOD, 1.0), tints])
    owner = np.append(owner, beds)
    count = len(owner)
    high = np.broadcast_to(structures.solid_heights[owner, None], (count, 4))
    light = (even + sunny * sun_up) * tints
    objects = structures.solid_objects[owner]
    roofs = Painted(
        single(np.dstack([level, high])),
        single(np.repeat((light * structures.solid_colours[owner])[:, None], 4, axis=1)),
        np.zeros((count, 4, 3), np.float32),
        np.zeros((count, 4, 4), np.float32),
        objects,
    )
    if count:
        middles = before[..., :2].mean(axis=1)
        order = np.lexsort((exposure.sampled(middles)["mapped"], walls.objects))
        among, first = np.unique(walls.objects[order], return_index=True)
        roofs.before[..., :2] = middles[order[first][np.searchsorted(among, objects)], None]
    columns: zip[Any] = zip(walls, roofs, strict=True)
    return Painted(*map(np.concatenate, columns))


def _skins(structures: Structures, number: Int, segments: Float) -> Single:
    """What the walls of numbers (n,) show, whose parts are segments (n, 4): see `Painted`."""
    whole = structures.segments[number]
    along = directions(segments)
    # Distances along the wall count from its end that comes first in the part's direction.
    ends = whole.reshape(-1, 2, 2)
    turned = (directions(whole) * along).sum(axis=1) < 0.0
    ends[turned] = ends[turned, ::-1]
    corners = segments.reshape(-1, 2, 2)[:, [0, 1, 1, 0]]
    places = ((corners - ends[:, :1]) * along[:, None]).sum(axis=2)
    tops = structures.heights[number]
    closed = structures.closed[number]
    # A fraction for each object, so that houses have different windows.
    own = _OWN * np.mod(structures.objects[number] * _GOLDEN, 1.0)
    if structures.indoor:
        # A wall of a room whose end is free ends at an opening.
        jamb = closed & (lengths(whole) < _JAMB)
        free = [jamb | (_meeting(structures, each) < 2) for each in np.moveaxis(ends, 1, 0)]
        standing = structures.solid_objects[is_furniture(structures)]
        kind = ROOM_WALL + free[0] + 2.0 * free[1]
        kind[np.isin(structures.objects[number], standing)] = FURNITURE
    else:
        kind = np.where(closed & (tops > _WINDOWS_FROM), FACADE, PLAIN)
    columns = lengths(whole), tops, kind + own
    even = [np.broadcast_to(each[:, None], places.shape) for each in columns]
    return single(np.stack([places, *even], axis=2))


def _meeting(structures: Structures, places: Float) -> Int:
    """The number of walls that meet at each of places (n, 2)."""
    points = shapely.points(places)
    number, _ = structures.tree.query(points, "dwithin", distance=_TOGETHER)
    return np.bincount(number, minlength=len(places))


def triangles(polygons: Any) -> tuple[Float, Int]:
    """Cut polygons (p,) into counter-clockwise triangles (t, 3, 2), and which each (t,) is of."""
    if not len(polygons):
        return np.zeros((0, 3, 2)), np.zeros(0, np.int64)
    found, piece = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    there = shapely.area(found) > _LEAST
    turned = shapely.orient_polygons(found[there])
    return shapely.get_coordinates(turned).reshape(-1, 4, 2)[:, :3], piece[there]


class GroundGrid(NamedTuple):
    """The pixels of the picture of the ground, and where they lie."""

    # (2,) its lower left corner [m].
    corner: Float
    # Side of a pixel [m].
    pixel: float
    # Its width and height [pixels].
    size: tuple[int, int]

    @property
    def extent(self) -> Float:
        """Width and height (2,) of what is painted [m]."""
        return self.pixel * np.array(self.size)

    def mask(self, polygons: Any) -> Image.Image:
        """How much of each pixel polygons cover, with smooth edges."""
        fine = Image.new("L", [_FINER * side for side in self.size])
        draw = ImageDraw.Draw(fine)
        parts = shapely.get_parts(polygons)
        # Where nothing is near, a union is one polygon of no points.
        parts = parts[~shapely.is_empty(parts)]
        # Large ones come first, as what stands in their holes is painted again.
        for polygon in parts[np.argsort(-shapely.area(parts), kind="stable")]:
            for ring, value in [(polygon.exterior, 255), *((r, 0) for r in polygon.interiors)]:
                places = (np.asarray(ring.coords) - self.corner) * (_FINER / self.pixel)
                draw.polygon(places.ravel().tolist(), fill=value)
        return fine.reduce(_FINER).filter(ImageFilter.BoxBlur(_BLUR))


def ground_grid(structures: Structures) -> GroundGrid:
    """Where the picture of the ground of a world lies, coarser the larger it is."""
    setting = structures.setting
    ends = structures.places if len(structures.places) else np.zeros((1, 2))
    if structures.indoor:
        ends = np.concatenate([ends, structures.path])
    low = ends.min(axis=0) - setting.margin
    high = ends.max(axis=0) + setting.margin
    pixel = max(float((high - low).max()) / _LONGEST_SIDE, setting.pixel)
    sides = np.ceil((high - low) / pixel).clip(max=_LONGEST_SIDE)
    width, height = sides.astype(int).tolist()
    return GroundGrid(low, pixel, (width, height))


def paint_ground(structures: Structures, grid: GroundGrid) -> GroundPicture:
    """Paint the ground of a world: asphalt and pavements, or the floor of a house."""
    indoor = structures.indoor
    land = structures.setting.land
    cover = Image.new("L", grid.size, land)
    walls = shapely.buffer(structures.tree.geometries, 2.0 * grid.pixel)
    if indoor:
        left, low = grid.corner
        right, high = grid.corner + grid.extent
        half = 0.5 * grid.pixel
        x, y = (np.arange(np.ceil(begin), end) for begin, end in ((left, right), (low, high)))
        across = shapely.box(left, y - half, right, y + half)
        cover.paste(_JOINT, mask=grid.mask([*shapely.box(x - half, low, x + half, high), *across]))
    else:
        cover.paste(
            _PAVED, mask=grid.mask(shapely.buffer(structures.solids, PAVEMENT, join_style="mitre"))
        )
        walls = np.concatenate([walls, structures.solids])
    # Little light gets next to walls; what changes slowly is painted coarsely.
    blur = ImageFilter.GaussianBlur(_SHADE_SLOPE * structures.setting.shade / grid.pixel)
    near = grid.mask(walls).reduce(4).filter(blur)
    shade = np.asarray(near.resize(grid.size, Image.Resampling.BILINEAR)) / np.float32(WHITE)
    seen = np.asarray(cover) * (1.0 - _SHADED * shade)
    paint = _FLOOR if indoor else np.ones(3)
    picture = np.stack([np.round(seen * tint).astype(np.uint8) for tint in paint], axis=-1)
    return GroundPicture(picture, grid.corner, grid.extent, land / WHITE * paint)
