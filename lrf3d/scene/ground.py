"""The ground as a picture, painted once: its light, pavement, streets and floors.

The world and its light enter; pictures leave whose channels say what covers the ground, and how
much light is on it. Renderers mix the paints from that: kerbs and marks are then as crisp as the
screen is fine, however coarse the picture.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFilter
from scipy.ndimage import distance_transform_edt, gaussian_filter

from lrf3d.geometry import Float, directions
from lrf3d.scene.light import Light, open_light, screen
from lrf3d.scene.look import SUN, SUNSHINE
from lrf3d.scene.streets import centre_lines, dashes
from lrf3d.scene.structures import Structures

_PIXELS = 2048
"""Longest side of the picture [pixels]; larger ones take longer to paint than a second."""

_FINEST = 0.06
"""Smallest size of a pixel [m]: below, a small room would be blown up for nothing."""

_COARSE = 0.25
"""Size of a pixel [m] above which marks and lines would be too wide, and are left out."""

_TILE_PIXELS, _OVERLAP = 1024, 16
"""Side of the picture of a tile, and how far it reaches past the tile [pixels]."""

_STREETS = 30.0
"""Houses up to this far off a tile [m] have a say in where its streets are."""

_MARGIN = 6.0
"""How far the picture reaches past walls and their shadows [m]: farther than pavements go."""

_PAVEMENT, _KERB = 1.7, 0.16
"""Width of the pavement round buildings, and of the kerb round it [m]."""

_TURN = 1.4
"""Radius of the corners of kerbs [m]."""

_BLOCK = 7.0
"""Houses less than this apart [m] are of one block, whose kerb runs straight before them."""

_LOCAL = 8.0
"""Only what of two houses is this near to the other [m] makes their common kerb."""

_FINER = 2
"""Pixels to a side that marks and kerbs are painted with in place of one: their edges are seen from
near, where steps would show."""

_SHADOW_RIM = 0.14
"""Width of the rim of the sun's light on the ground [m]."""

_STREET_PAINTS = np.array(
    [[0.370, 0.370, 0.370], [0.66, 0.65, 0.62], [0.545, 0.53, 0.50], [0.80, 0.79, 0.75]]
)
_FLOOR_PAINTS = np.array(
    [[0.74, 0.75, 0.755], [0.70, 0.69, 0.67], [0.775, 0.74, 0.685], [0.64, 0.61, 0.56]]
)
"""Colours of the ground, of kerbs, pavements and marks; and of what lies round a house, the edge of
its floor, the floor and the joints of its tiles."""

_BEYOND, _BEYOND_INDOOR = (0.50, 0.52, 0.455), _FLOOR_PAINTS[0]
"""Colours of what lies past the world."""

_CLOSEST = 4.0
"""Joints lie at least this many pixels apart."""

_TILES, _JOINT, _JOINT_STRENGTH = 0.6, 0.015, 150
"""Side of a floor's tiles, width of the joints between them [m] and their opacity 0…255."""

_LIGHT_CELL, _LIGHT_CELL_INDOOR, _LIGHT_CELLS = 0.8, 0.25, 150
"""Least size of the cells that light is known in [m], and the most of them to a side."""

_LIGHT_BLUR = 0.8
"""How far that light is smoothed [cells]: rays are few, and it changes slowly."""

BRIGHTEST = 1.3
"""What light, as a factor of a screen's colours, the largest value of a picture stands for."""

_HOLE, _RIM = 4.0, 0.1
"""A floor closes openings in walls of up to twice the first, and goes past them by the second [m].
"""

_AROUND = 1.6
"""How far round its path a robot has a floor under it [m], wherever walls are."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A picture of the ground.

    Args:
        picture: (h, w, 4) uint8: how far from ground over kerb to pavement, how much of it is
            marked, its light and the sun's share in that; row 0 lies at the smallest y.
        corner: (2,) x and y of its lower left corner in the film's frame [m].
        size: (2,) its width and height [m].
        paints: (4, 3) colours of ground, kerb, pavement and marks, 0…1.
        tints: (2, 3) colours of the light where the sun is hidden, and where it is not.
        beyond: Colour of the ground far past the picture in its light, 0…1.
    """

    picture: NDArray[np.uint8]
    corner: Float
    size: Float
    paints: Float
    tints: Float
    beyond: tuple[float, float, float]

    def coloured(self) -> NDArray[np.uint8]:
        """The picture (h, w, 3) uint8 as it is seen from afar."""
        cover, mark, light, sun = np.moveaxis(self.picture.astype(np.float32) / 255.0, -1, 0)
        kerb, pave = np.clip(2.0 * cover, 0.0, 1.0), np.clip(2.0 * cover - 1.0, 0.0, 1.0)
        base, edge, stone, line = self.paints.astype(np.float32)
        paint = base + kerb[..., None] * (edge - base)
        paint += pave[..., None] * (stone - paint)
        paint += mark[..., None] * (line - paint)
        tint = self.tints[0] + sun[..., None] * (self.tints[1] - self.tints[0])
        lit = np.clip(paint * tint * (BRIGHTEST * light[..., None]), 0.0, 1.0)
        return np.asarray(np.round(255.0 * lit), np.uint8)


def paint_ground(structures: Structures, light: Light) -> Ground:
    """Paint the ground of a world in its light, coarser the larger it is."""
    ends = structures.segments.reshape(-1, 2)
    if not len(ends):
        ends = np.zeros((1, 2))
    margin = 3.0 if structures.indoor else _MARGIN + _reach(structures)
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    if structures.indoor and len(structures.path):
        low = np.minimum(low, structures.path.min(axis=0) - margin)
        high = np.maximum(high, structures.path.max(axis=0) + margin)
    pixel = max(float((high - low).max()) / _PIXELS, 0.02 if structures.indoor else _FINEST)
    width, height = (np.ceil((high - low) / pixel).astype(int) + 1).tolist()
    return _paint(structures, light, _Brush(width, height, low, pixel))


def paint_tile(structures: Structures, light: Light, corner: Float, side: float) -> Ground:
    """Paint a square of a side [m] of a large world's ground finely, from its lower left corner."""
    pixel = side / (_TILE_PIXELS - 2 * _OVERLAP)
    # The picture goes past the tile, so that blurs and smaller copies match those of neighbours.
    low = corner - _OVERLAP * pixel
    reach = 2.0 * _HOLE if structures.indoor else _STREETS + _reach(structures)
    near = structures.within(low - reach, low + side + reach)
    return _paint(near, light, _Brush(_TILE_PIXELS, _TILE_PIXELS, low, pixel))


def _paint(structures: Structures, light: Light, brush: "_Brush") -> Ground:
    indoor = structures.indoor
    paint = _paint_floor if indoor else _paint_streets
    cover, marks = paint(structures, brush)
    shadow = brush.blank()
    if not indoor:
        brush.quads(shadow, _shadows(structures))
        shadow = brush.soft(shadow, _SHADOW_RIM)
    shining = 1.0 - np.asarray(shadow, np.float32) / 255.0
    baked, sun = brush.light(light, indoor=indoor)
    total = screen(baked + shining * sun) if not indoor else screen(baked)
    share = shining * sun / np.maximum(baked + shining * sun, 1e-6)
    channels = [cover, marks, _as_mask(total / BRIGHTEST), _as_mask(share / _full_share(sun))]
    tints, open_light = _tints(indoor=indoor)
    beyond = np.array(_BEYOND_INDOOR if indoor else _BEYOND) * open_light
    return Ground(
        np.stack([np.asarray(channel) for channel in channels], axis=-1),
        brush.corner,
        np.array(brush.size) * brush.pixel,
        _FLOOR_PAINTS if indoor else _STREET_PAINTS,
        tints,
        tuple(np.clip(beyond, 0.0, 1.0).tolist()),
    )


def _as_mask(values: Any) -> NDArray[np.uint8]:
    return np.asarray(np.round(255.0 * np.clip(values, 0.0, 1.0)), np.uint8)


_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""How bright red, green and blue are to an eye."""


def _full_share(sun: float) -> float:
    """The share of the sun's light in that on open ground."""
    return max(sun / (sun + float(open_light(indoor=False) @ _LUMINANCE)), 1e-6)


def _tints(*, indoor: bool) -> tuple[Float, Float]:
    """Colours (2, 3) of the light without and with the sun; and the light (3,) on open ground."""
    sky = open_light(indoor=indoor)
    sun = np.zeros(3) if indoor else SUN[2] * SUNSHINE
    both = np.stack([sky, sky + sun])
    tints = screen(both) / screen(both @ _LUMINANCE)[:, None]
    return tints, screen(sky + sun)


def _reach(structures: Structures) -> float:
    """How far the longest shadow reaches [m], along x or y."""
    return float(structures.heights.max(initial=0.0) * np.abs(SUN[:2]).max() / SUN[2])


class _Brush:
    """Paints shapes, given in metres, into pictures of one size."""

    def __init__(self, width: int, height: int, corner: Float, pixel: float) -> None:
        self.size = (width, height)
        self.corner = corner
        self.pixel = pixel

    def finer(self) -> "_Brush":
        """A brush for the same place with finer pixels."""
        width, height = self.size
        return _Brush(_FINER * width, _FINER * height, self.corner, self.pixel / _FINER)

    def reduced(self, picture: Image.Image) -> Image.Image:
        """A picture of this brush in the pixels of the one that it is finer than."""
        return picture.reduce(_FINER).filter(ImageFilter.BoxBlur(0.6))

    def blank(self) -> Image.Image:
        return Image.new("L", self.size, 0)

    def polygons(self, picture: Image.Image, polygons: Any, fill: int = 255) -> None:
        """Fill polygons, holes left out by being painted over."""
        draw = ImageDraw.Draw(picture)
        parts = shapely.get_parts(polygons)
        # Where nothing is near, a union is one polygon of no points.
        for polygon in parts[~shapely.is_empty(parts)]:
            for ring, value in [(polygon.exterior, fill), *((r, 0) for r in polygon.interiors)]:
                draw.polygon(self._points(np.asarray(ring.coords)), fill=value)

    def quads(self, picture: Image.Image, quads: Float) -> None:
        """Fill convex shapes (n, corners, 2)."""
        draw = ImageDraw.Draw(picture)
        for quad in quads:
            draw.polygon(self._points(quad), fill=255)

    def lines(self, picture: Image.Image, segments: Float, width: float) -> None:
        """Draw segments (n, 4) of a width [m]."""
        draw = ImageDraw.Draw(picture)
        if width > 2.0 * self.pixel:
            # Lines are as wide as whole pixels; as shapes they are as wide as they should be.
            side = 0.5 * width * directions(segments)[:, ::-1] * [-1.0, 1.0]
            start, end = segments[:, :2], segments[:, 2:]
            self.quads(picture, np.stack([start - side, end - side, end + side, start + side], 1))
            return
        for segment in segments.reshape(-1, 2, 2):
            draw.line(self._points(segment), fill=255, width=1)

    def grid(self, picture: Image.Image, metres: float, width: float, fill: int) -> None:
        """Draw lines at a spacing [m], at its multiples in the film's frame.

        Nothing where they would lie so close together that they are one grey.
        """
        if metres < _CLOSEST * self.pixel:
            return
        draw = ImageDraw.Draw(picture)
        pixels = max(1, round(width / self.pixel))
        for axis, (across, along) in enumerate([self.size, self.size[::-1]]):
            first = np.ceil(self.corner[axis] / metres) * metres
            places = np.arange(first, self.corner[axis] + across * self.pixel, metres)
            for at in ((places - self.corner[axis]) / self.pixel).tolist():
                ends = [at, 0.0, at, float(along)] if axis == 0 else [0.0, at, float(along), at]
                draw.line(ends, fill=fill, width=pixels)

    def light(self, light: Light, *, indoor: bool) -> tuple[Any, float]:
        """How bright (h, w) the ground is without the sun, and what the sun adds, linear."""
        size = np.array(self.size) * self.pixel
        least = _LIGHT_CELL_INDOOR if indoor else _LIGHT_CELL
        cell = max(least, float(size.max()) / _LIGHT_CELLS)
        columns, rows = np.ceil(size / cell).astype(int) + 1
        x, y = np.meshgrid(np.arange(columns) * cell, np.arange(rows) * cell)
        places = self.corner + np.column_stack([x.ravel(), y.ravel()])
        found, open_air = light.ground(places)
        bright = (found @ _LUMINANCE).reshape(rows, columns).astype(np.float32)
        if open_air.any():
            # Under houses it is dark; what is next to them must not be for that.
            inside = ~open_air.reshape(rows, columns)
            near = distance_transform_edt(inside, return_distances=False, return_indices=True)
            bright = gaussian_filter(bright[tuple(near)], _LIGHT_BLUR)
        whole = Image.fromarray(bright).resize(
            (round(columns * cell / self.pixel), round(rows * cell / self.pixel)),
            Image.Resampling.BICUBIC,
        )
        shift = round(0.5 * cell / self.pixel)
        area = (shift, shift, shift + self.size[0], shift + self.size[1])
        sun = 0.0 if indoor else float(SUN[2] * SUNSHINE @ _LUMINANCE)
        return np.asarray(whole.crop(area), np.float32), sun

    def soft(self, picture: Image.Image, reach: float) -> Image.Image:
        """The picture blurred over a reach [m]; wide blurs go by a smaller picture."""
        radius = reach / self.pixel
        shrink = max(1, int(radius / 2))
        if shrink == 1:
            return picture.filter(ImageFilter.BoxBlur(radius))
        small = picture.reduce(shrink).filter(ImageFilter.GaussianBlur(radius / shrink))
        return small.resize(self.size, Image.Resampling.BILINEAR)

    def _points(self, points: Float) -> list[float]:
        flat: list[float] = ((points - self.corner) / self.pixel).ravel().tolist()
        return flat


def _paint_streets(structures: Structures, brush: _Brush) -> tuple[Image.Image, Image.Image]:
    """What is paved, with its kerb, and the marks on streets."""
    fine = brush.finer()
    pavement, inner, marks = fine.blank(), fine.blank(), fine.blank()
    kerb = shapely.buffer(structures.solids, _PAVEMENT, quad_segs=4)
    if brush.pixel <= _COARSE:
        kerb = blocks(structures.solids)
        fine.lines(marks, dashes(centre_lines(structures, kerb)), 0.16)
        fine.polygons(inner, shapely.buffer(kerb, -_KERB))
    fine.polygons(pavement, kerb)
    cover = Image.blend(fine.reduced(pavement), fine.reduced(inner), 0.5)
    return cover, fine.reduced(marks)


def blocks(solids: Any) -> Any:
    """Pavements of the blocks that houses make up, as a shapely geometry.

    Houses that stand side by side have one kerb, which runs straight before them; the corners of
    blocks are round.
    """
    first, second = shapely.STRtree(solids).query(solids, predicate="dwithin", distance=_BLOCK)
    pair = first < second
    first, second = solids[first[pair]], solids[second[pair]]
    sides = [
        shapely.intersection(one, shapely.buffer(other, _LOCAL))
        for one, other in ((first, second), (second, first))
    ]
    hulls = shapely.convex_hull(shapely.union(*sides))
    # The hull of two long houses round a corner would fill the street between them.
    filled = shapely.area(sides[0]) + shapely.area(sides[1])
    hulls = hulls[shapely.area(hulls) < 1.7 * filled]
    whole = shapely.union_all(np.concatenate([solids, hulls]))
    wide = shapely.buffer(whole, _PAVEMENT, join_style="mitre", mitre_limit=1.5)
    closed = shapely.buffer(shapely.buffer(wide, _TURN, quad_segs=8), -_TURN, quad_segs=8)
    return shapely.buffer(shapely.buffer(closed, -_TURN, quad_segs=8), _TURN, quad_segs=8)


def _paint_floor(structures: Structures, brush: _Brush) -> tuple[Image.Image, Image.Image]:
    """The floor, with its edge, and the joints of its tiles."""
    fine = brush.finer()
    floor, inner, lines = fine.blank(), fine.blank(), brush.blank()
    rooms = floor_of(structures)
    fine.polygons(floor, rooms)
    fine.polygons(inner, shapely.buffer(rooms, -0.06))
    brush.grid(lines, _TILES, _JOINT, _JOINT_STRENGTH)
    cover = Image.blend(fine.reduced(floor), fine.reduced(inner), 0.5)
    return cover, ImageChops.multiply(lines, fine.reduced(inner))


def floor_of(structures: Structures) -> Any:
    """The floor of a house, as a shapely geometry: within its walls, and under the path."""
    parts = [shapely.linestrings(structures.segments.reshape(-1, 2, 2))]
    some = structures.path[:: max(1, len(structures.path) // 2000)]
    parts.append(shapely.buffer(shapely.points(some), _AROUND))
    wide = shapely.get_parts(shapely.union_all(shapely.buffer(np.concatenate(parts), _HOLE)))
    filled = shapely.polygons(shapely.get_exterior_ring(wide[shapely.get_type_id(wide) == 3]))
    edge = _HOLE - _RIM
    return shapely.union_all(shapely.buffer(filled, -edge, join_style="mitre"))


def _shadows(structures: Structures) -> Float:
    """What walls (n, 4) hide from the sun on the ground: quads (n, 4, 2).

    The walls of a solid together with its roof sweep just what the solid hides; the roof's own
    shadow is that of its walls' tops, so the walls are enough but for the ground under it.
    """
    slide = -SUN[:2] / SUN[2] * structures.heights[:, None]
    start, end = structures.segments[:, :2], structures.segments[:, 2:]
    return np.stack([start, end, end + slide, start + slide], axis=1)
