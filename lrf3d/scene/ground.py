"""The ground as a picture, painted once: the sun's shadows, contact shadows, pavement and streets.

A shadow that is drawn each frame costs a second pass over the city; baked it costs one look-up.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFilter
from scipy.spatial import QhullError, Voronoi

from lrf3d.geometry import Float, directions, lengths
from lrf3d.scene.look import SUN
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

_PAVEMENT = 1.7
"""Width of the pavement round buildings [m]."""

_TURN = 1.6
"""Radius of the turns of kerbs between houses [m]: alleys up to twice as wide are paved."""

_FINER = 2
"""Pixels to a side that marks and kerbs are painted with in place of one: their edges are seen from
near, where steps would show."""

_CONTACT = 0.9
"""How far the shadow at the foot of walls reaches [m]."""


_ASPHALT, _STONE, _MARK, _FLOOR = (94, 93, 91), (156, 152, 144), (204, 200, 188), (192, 185, 172)
_BEYOND, _BEYOND_INDOOR = (0.46, 0.475, 0.435), (0.765, 0.78, 0.79)
"""Colours of the ground: of streets, pavements, marks, floors, and of what lies past the world."""

_SHADE, _CONTACT_SHADE, _FLOOR_SHADE = (156, 163, 178), (164, 166, 171), (188, 186, 184)
"""What light is left: in the sun's shadow, where the sky still shines, and at the foot of walls."""

_CLOSEST = 4.0
"""Lines of the grid lie at least this many pixels apart."""

_GRID_STRENGTH = 22
"""Opacity 0…255 of the grid: one sees how far things are, and forgets it."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A picture of the ground.

    Args:
        picture: (h, w, 3) uint8: red, green, blue; row 0 lies at the smallest y.
        corner: (2,) x and y of its lower left corner in the film's frame [m].
        size: (2,) its width and height [m].
        beyond: Colour of the ground far past the picture, 0…1.
    """

    picture: NDArray[np.uint8]
    corner: Float
    size: Float
    beyond: tuple[float, float, float]


def paint_ground(structures: Structures) -> Ground:
    """Paint the ground of a world, coarser the larger it is."""
    ends = structures.segments.reshape(-1, 2)
    if not len(ends):
        ends = np.zeros((1, 2))
    margin = 2.0 if structures.indoor else _MARGIN + _reach(structures)
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    pixel = max(float((high - low).max()) / _PIXELS, 0.02 if structures.indoor else _FINEST)
    width, height = (np.ceil((high - low) / pixel).astype(int) + 1).tolist()
    return _paint(structures, _Brush(width, height, low, pixel))


def paint_tile(structures: Structures, corner: Float, side: float) -> Ground:
    """Paint a square of a side [m] of a large world's ground finely, from its lower left corner."""
    pixel = side / (_TILE_PIXELS - 2 * _OVERLAP)
    # The picture goes past the tile, so that blurs and smaller copies match those of neighbours.
    low = corner - _OVERLAP * pixel
    reach = 2.0 if structures.indoor else _STREETS + _reach(structures)
    near = structures.within(low - reach, low + side + reach)
    return _paint(near, _Brush(_TILE_PIXELS, _TILE_PIXELS, low, pixel))


def _paint(structures: Structures, brush: "_Brush") -> Ground:
    paint = _paint_floor if structures.indoor else _paint_streets
    picture = np.asarray(paint(structures, brush))
    beyond = _BEYOND_INDOOR if structures.indoor else _BEYOND
    return Ground(picture, brush.corner, np.array(brush.size) * brush.pixel, beyond)


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


def _paint_streets(structures: Structures, brush: _Brush) -> Image.Image:
    shadow, foot = brush.blank(), brush.blank()
    brush.quads(shadow, _shadows(structures))
    brush.lines(foot, structures.segments, 0.3)
    brush.polygons(foot, structures.solids)
    fine = brush.finer()
    pavement, marks, lines = fine.blank(), fine.blank(), brush.blank()
    kerb = shapely.buffer(structures.solids, _PAVEMENT, quad_segs=4)
    if brush.pixel <= _COARSE:
        # Rounding the kerb outward and inward again closes alleys that are narrower than a car,
        # and gives it the wide turns that streets have.
        kerb = shapely.buffer(shapely.union_all(kerb), _TURN, quad_segs=6)
        kerb = shapely.buffer(kerb, -_TURN, quad_segs=6)
        fine.lines(marks, dashes(centre_lines(structures, kerb)), 0.16)
        brush.grid(lines, 5.0, 0.07, _GRID_STRENGTH)
    fine.polygons(pavement, kerb)
    ground = Image.new("RGB", brush.size, _ASPHALT)
    ground.paste(_STONE, mask=fine.reduced(pavement))
    ground.paste((255, 255, 255), mask=lines)
    ground.paste(_MARK, mask=fine.reduced(marks))
    ground = ImageChops.multiply(ground, _tinted(brush.soft(shadow, 0.12), _SHADE))
    return ImageChops.multiply(ground, _tinted(brush.soft(foot, _CONTACT), _CONTACT_SHADE))


def _paint_floor(structures: Structures, brush: _Brush) -> Image.Image:
    foot, lines = brush.blank(), brush.blank()
    brush.lines(foot, structures.segments, 0.10)
    brush.polygons(foot, structures.solids)
    brush.grid(lines, 1.0, 0.02, 40)
    ground = Image.new("RGB", brush.size, _FLOOR)
    ground.paste((60, 55, 50), mask=lines)
    # Two widths: a dark line in the corner, and the wide shadow in the light of a room.
    for reach, gain in ((0.12, 2.2), (0.5, 3.0)):
        near = brush.soft(foot, reach).point([min(255, int(gain * value)) for value in range(256)])
        ground = ImageChops.multiply(ground, _tinted(near, _FLOOR_SHADE))
    return ground


def _tinted(mask: Image.Image, colour: tuple[int, int, int]) -> Image.Image:
    """White where the mask is 0, the colour where it is 255."""
    bands = [mask.point([255 - (255 - c) * value // 255 for value in range(256)]) for c in colour]
    return Image.merge("RGB", bands)


def _shadows(structures: Structures) -> Float:
    """What walls (n, 4) hide from the sun on the ground: quads (n, 4, 2).

    The walls of a solid together with its roof sweep just what the solid hides; the roof's own
    shadow is that of its walls' tops, so the walls are enough but for the ground under it.
    """
    slide = -SUN[:2] / SUN[2] * structures.heights[:, None]
    start, end = structures.segments[:, :2], structures.segments[:, 2:]
    return np.stack([start, end, end + slide, start + slide], axis=1)


_STEP = 2.0
"""Distance [m] between the samples along walls: a street's middle is found this finely."""

_NARROWEST, _WIDEST = 3.5, 14.0
"""Half the width [m] of what is taken for a street: not an alley, not a square."""

_SHORTEST = 8.0
"""A middle line below this length [m] is no street."""

_MOST_SAMPLES = 60_000
"""Beyond this many samples the lines are left out: they would cost seconds."""

_DASH, _GAP = 2.2, 3.8
"""Lengths [m] of a mark and of the gap to the next."""


def centre_lines(structures: Structures, kerb: Any) -> Any:
    """Middle lines of streets, as an array of shapely lines.

    They are the edges of the Voronoi diagram of the walls between two façades that run along each
    other, where both are a street's width apart.
    """
    walls = structures.segments[structures.closed]
    points, along = _samples(walls)
    if not 4 <= len(points) <= _MOST_SAMPLES:
        return np.empty(0, dtype=object)
    try:
        diagram = Voronoi(points)
    except QhullError:
        return np.empty(0, dtype=object)
    vertices = np.array(diagram.ridge_vertices)
    first, second = diagram.ridge_points.T
    gap = points[second] - points[first]
    half = 0.5 * np.hypot(gap[:, 0], gap[:, 1])
    street = (vertices.min(axis=1) >= 0) & (half > _NARROWEST) & (half < _WIDEST)
    parallel = np.abs(np.einsum("ij,ij->i", along[first], along[second])) > 0.94
    across = np.abs(np.einsum("ij,ij->i", along[first], gap)) < 0.5 * half
    chosen = vertices[street & parallel & across]
    if not len(chosen):
        return np.empty(0, dtype=object)
    edges = shapely.linestrings(np.round(diagram.vertices[chosen], 3))
    merged = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(edges)))
    # The samples make the line tremble by some decimetres; a street's line does not.
    smooth = shapely.simplify(merged, 0.8)
    if kerb is not None:
        smooth = shapely.get_parts(shapely.difference(smooth, kerb))
    return smooth[shapely.length(smooth) > _SHORTEST]


def dashes(lines: Any) -> Float:
    """Marks (n, 4) along lines."""
    marks = [np.empty((0, 4))]
    for line in lines:
        starts = np.arange(_GAP / 2, shapely.length(line) - _DASH, _DASH + _GAP)
        first = shapely.get_coordinates(shapely.line_interpolate_point(line, starts))
        second = shapely.get_coordinates(shapely.line_interpolate_point(line, starts + _DASH))
        marks.append(np.column_stack([first, second]))
    return np.concatenate(marks)


def _samples(walls: Float) -> tuple[Float, Float]:
    """Points (m, 2) along walls (n, 4) and the direction (m, 2) of the wall of each."""
    if not len(walls):
        return np.empty((0, 2)), np.empty((0, 2))
    counts = np.maximum(1, np.ceil(lengths(walls) / _STEP)).astype(int)
    wall = np.repeat(np.arange(len(walls)), counts)
    place = np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((place + 0.5) / counts[wall])[:, None]
    points = walls[wall, :2] * (1.0 - share) + walls[wall, 2:] * share
    return points, directions(walls)[wall]
