"""What stands in a run's world, painted once for all pictures: walls, roofs, ground and light.

Walls and roofs are faces, as bright as they look at the sky; the ground is a picture of streets or
floors, darker next to walls. Painting takes a second, so the stage
asked for last is kept; it can be pickled, to be handed to other processes.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from lrf3d.geometry.lines import LEFT, Float, Int, directions, lengths
from lrf3d.simulation.run import Run
from lrf3d.studio.scene.look import SUN, WALL_LIGHT
from lrf3d.studio.scene.shapes import GroundPicture, Painted, single
from lrf3d.studio.scene.stage.exposure import Exposure, expose, unexposed
from lrf3d.studio.scene.stage.structures import Structures, filled_between

# Length [m] over which two walls at one place are one; half the gap between both faces of a free
# wall [m], as a ray meets the one that looks at it; and the least area of a triangle [m²]: outlines
# that touch themselves have smaller ones.
_TOGETHER = 0.05
_APART = 0.004
_LEAST = 1e-7

# How far a street reaches past the houses of a town, and the width of the pavement round them [m].
STREET = 8.0
PAVEMENT = 1.7

# Colour of floors, whose tiles are a metre wide, with joints of a pixel.
_FLOOR = np.array([1.0, 0.96, 0.90])


class Stage(NamedTuple):
    """What stands in a world: its structures, their faces, the ground, and its light.

    The longest of the walls that are mirrors (m, 5) have their heights [m] as the fifth column.
    """

    structures: Structures
    faces: Painted
    ground: GroundPicture
    exposure: Exposure
    mirrors: Float


@lru_cache(maxsize=1)
def stage_of(run: Run) -> Stage:
    """Paint what can be seen of a run's world, or take what was painted for it before."""
    return paint_stage(Structures.from_run(run), run)


def paint_stage(structures: Structures, run: Run | None = None) -> Stage:
    """Paint walls, roofs and the ground, and when the scans of a run first met them."""
    canvas = canvas_of(structures)
    box = canvas.corner, canvas.corner + canvas.extent
    # What is driven by hand has no scans yet: they light it as they come.
    exposure = unexposed(structures, *box)
    if isinstance(run, Run):
        exposure = expose(run, structures, *box)
    walls, tops = (each[structures.mirrors] for each in (structures.segments, structures.heights))
    most_mirrors = 4  # Most walls that show reflections: each takes the time of a picture.
    longest = np.argsort(-lengths(walls), kind="stable")[:most_mirrors]
    mirrors = np.column_stack([walls, tops])[longest]
    faces = lay_faces(structures, exposure)
    ground = paint_ground(structures, canvas)
    return Stage(structures, faces, ground, exposure, mirrors)


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
    along = directions(segments)
    off = -along @ LEFT
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
        structures.objects[number],
    )
    corners, owner = triangles(structures.solids)
    level = corners[:, [0, 1, 2, 2]]
    count = len(corners)
    high = np.broadcast_to(structures.solid_heights[owner, None], (count, 4))
    light = even + sunny * sun_up
    objects = structures.solid_objects[owner]
    roofs = Painted(
        single(np.dstack([level, high])),
        single(np.repeat(light * structures.solid_colours[owner, None], 4, axis=1)),
        np.zeros((count, 4, 3), np.float32),
        objects,
    )
    if count:
        middles = before[..., :2].mean(axis=1)
        order = np.lexsort((exposure.sampled(middles)["mapped"], walls.objects))
        among, first = np.unique(walls.objects[order], return_index=True)
        best = order[first][np.searchsorted(among, objects)]
        roofs.before[..., :2] = middles[best, None]
    columns: zip[Any] = zip(walls, roofs, strict=True)
    return Painted(*map(np.concatenate, columns))


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


class Canvas(NamedTuple):
    """Where a picture of the ground lies."""

    corner: Float
    """(2,) its lower left corner [m]."""
    pixel: float
    """Size of a pixel [m]."""
    size: tuple[int, int]
    """Its width and height [pixels]."""

    @property
    def extent(self) -> Float:
        """Width and height (2,) of what is painted [m]."""
        return self.pixel * np.array(self.size)

    def mask(self, polygons: Any) -> Image.Image:
        """How much of each pixel polygons cover, with smooth edges."""
        # Pixels to a side that shapes are painted with in place of one, and how far they are
        # smoothed [pixels]: steps in their edges would show.
        finer = 2
        blur = 0.6
        fine = Image.new("L", [finer * side for side in self.size])
        draw = ImageDraw.Draw(fine)
        parts = shapely.get_parts(polygons)
        # Where nothing is near, a union is one polygon of no points.
        parts = parts[~shapely.is_empty(parts)]
        # Large ones come first, as what stands in their holes is painted again.
        for polygon in parts[np.argsort(-shapely.area(parts), kind="stable")]:
            for ring, value in [(polygon.exterior, 255), *((r, 0) for r in polygon.interiors)]:
                places = (np.asarray(ring.coords) - self.corner) * (finer / self.pixel)
                draw.polygon(places.ravel().tolist(), fill=value)
        return fine.reduce(finer).filter(ImageFilter.BoxBlur(blur))


def canvas_of(structures: Structures) -> Canvas:
    """Where the picture of the ground of a world lies, coarser the larger it is."""
    setting = structures.setting
    ends = structures.places if len(structures.places) else np.zeros((1, 2))
    if structures.indoor:
        ends = np.concatenate([ends, structures.path])
    low = ends.min(axis=0) - setting.margin
    high = ends.max(axis=0) + setting.margin
    pixels = 2048  # Longest side of the picture [pixels].
    pixel = max(float((high - low).max()) / pixels, setting.pixel)
    width, height = np.ceil((high - low) / pixel).astype(int).tolist()
    return Canvas(low, pixel, (width, height))


def paint_ground(structures: Structures, canvas: Canvas) -> GroundPicture:
    """Paint the ground of a world: asphalt and pavements, or the floor of a house."""
    indoor = structures.indoor
    land = structures.setting.land
    cover = Image.new("L", canvas.size, land)
    walls = shapely.buffer(structures.tree.geometries, 2.0 * canvas.pixel)
    # Brightness, 0…255, of pavements, tiles of a floor, and the joints between them.
    paved = 134
    tile = 178
    joint = 160
    if indoor:
        tiles = canvas.mask(_floor(structures))
        cover.paste(tile, mask=tiles)
        left, low = canvas.corner
        right, high = canvas.corner + canvas.extent
        half = 0.5 * canvas.pixel
        x, y = (np.arange(np.ceil(begin), end) for begin, end in ((left, right), (low, high)))
        across = shapely.box(left, y - half, right, y + half)
        joints = canvas.mask([*shapely.box(x - half, low, x + half, high), *across])
        cover.paste(joint, mask=ImageChops.multiply(tiles, joints))
    else:
        around = shapely.buffer(structures.solids, PAVEMENT, join_style="mitre")
        cover.paste(paved, mask=canvas.mask(around))
        walls = np.concatenate([walls, structures.solids])
    # Little light gets next to walls; what changes slowly is painted coarsely.
    blur = ImageFilter.GaussianBlur(0.25 * structures.setting.shade / canvas.pixel)
    near = canvas.mask(walls).reduce(4).filter(blur)
    shade = np.asarray(near.resize(canvas.size, Image.Resampling.BILINEAR)) / np.float32(255.0)
    # Share of light that is lost next to walls, and the share of the picture, at its edges, in
    # which the ground fades into the land around.
    shaded = 0.45
    fade = 0.06
    seen = np.asarray(cover) * (1.0 - shaded * shade)
    # At the edges it goes over into the land.
    fading = (
        np.clip(np.minimum(places, 1.0 - places) / fade, 0.0, 1.0)
        for places in ((np.arange(side) + 0.5) / side for side in canvas.size[::-1])
    )
    seen = land + np.outer(*fading) * (seen - land)
    paint = _FLOOR if indoor else np.ones(3)
    picture = np.round(seen[..., None] * paint).astype(np.uint8)
    return GroundPicture(picture, canvas.corner, canvas.extent, land / 255.0 * paint)


def _floor(structures: Structures) -> Any:
    """The floor of a house, as a shapely geometry: its rooms, and under the path outside them."""
    # A floor closes openings in walls of up to twice the first, goes past them by the second, and
    # lies so far round the path of a robot where there are no rooms [m].
    hole = 4.0
    rim = 0.1
    around = 1.6
    filled = filled_between(structures.segments, hole)
    rooms = shapely.union_all(shapely.buffer(filled, rim - hole, join_style="mitre"))
    shapely.prepare(rooms)
    path = structures.path[:: max(1, len(structures.path) // 2000)]
    outside = path[~shapely.contains_xy(rooms, *path.T)]
    floor = shapely.union_all([rooms, *shapely.buffer(shapely.points(outside), around)])
    # Where these meet rooms there are no corners.
    return shapely.buffer(shapely.buffer(floor, around), -around)
