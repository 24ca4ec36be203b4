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
from PIL import Image, ImageChops
from scipy.ndimage import distance_transform_edt, gaussian_filter

from lrf3d.geometry import Float, Single
from lrf3d.scene.brush import Brush, as_mask
from lrf3d.scene.light import Light, open_light, screen
from lrf3d.scene.look import SUN, SUNSHINE
from lrf3d.scene.streets import Strips, centre_lines, dashes, kerb_pieces, mark_pieces
from lrf3d.scene.structures import Structures
from lrf3d.scene.town import KERB, PAVEMENT, STREET, plan_town

_PIXELS = 2048
"""Longest side of the picture [pixels]; larger ones take longer to paint than a second."""

_HALVED = 32
"""Sides of the picture are multiples of this [pixels]."""

_FINEST = 0.06
"""Smallest size of a pixel [m]: finer ones show no more of a small room."""

_COARSE = 0.25
"""Size of a pixel [m] above which marks and lines would be too wide, and are left out."""

_TILE_PIXELS, _OVERLAP = 1024, 16
"""Side of the picture of a tile, and how far it reaches past the tile [pixels]."""

_STREETS = 30.0
"""Houses up to this far off a tile [m] determine where its streets are."""

_MARGIN = STREET + 2.0 * PAVEMENT + 6.0
"""How far the picture reaches past walls [m], or past their shadows if these reach farther: a town
ends within it."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""How bright red, green and blue are to an eye."""

_SHADOW_BLUR = 0.6
"""How far the rim of the sun's light is smoothed [pixels]: it is some centimetres wide."""

_STREET_PAINTS = np.array(
    [[0.86, 0.85, 0.81], [0.43, 0.43, 0.435], [0.70, 0.69, 0.66], [0.60, 0.585, 0.55],
     [0.43, 0.505, 0.335]]
)  # fmt: skip
MARK_PAINT, KERB_PAINT = 0, 2
_FLOOR_PAINTS = np.array(
    [[0.74, 0.75, 0.755], [0.70, 0.69, 0.67], [0.64, 0.61, 0.56], [0.775, 0.74, 0.685],
     [0.775, 0.74, 0.685]]
)  # fmt: skip
"""Colours of marks, asphalt, kerbs, pavements and lawns; and of what lies round a house, the edge
of its floor, the joints of its tiles, and tiles. The last of a town, and the first of a house, goes
on past the world."""

_STEPS = len(_STREET_PAINTS) - 1
"""Steps from the first paint to the last, which a picture's fourth channel has."""

_TILES, _JOINT, _JOINT_STRENGTH = 1.0, 0.015, 90
"""Side of a floor's tiles, width of the joints between them [m] and their opacity 0…255."""

_LIGHT_CELL, _LIGHT_CELL_INDOOR, _LIGHT_CELLS = 0.8, 0.25, 150
"""Least size of the cells that light is known in [m], and the most of them to a side."""

_LIGHT_BLUR = 0.8
"""How far that light is smoothed [cells]: rays are few, and it changes slowly."""

_MARK = 0.16
"""Width of lane marks [m]."""

_KERBS_FINER = 4
"""Pixels to a side that kerbs are painted with in place of one: they are seen from near, where
those of other shapes would make them tremble."""

_BED = 0.65
"""Radius of the bed of a tree in a pavement [m]."""

_LEAVES = 220
"""How much of the sun leaves hide, 0…255: some of it comes through."""

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
        picture: (h, w, 4) uint8: the light on it in the hues of its paints, red, green and blue,
            and what covers it, from marks over asphalt, kerbs and pavements to lawns; row 0 lies
            at the smallest y.
        corner: (2,) x and y of its lower left corner in the film's frame [m].
        size: (2,) its width and height [m].
        paints: (5, 3) colours of marks, asphalt, kerbs, pavements and lawns, 0…1.
        land: (3,) colour of the ground far past the picture, 0…1.
        light: (3,) light on open ground, as a factor of a screen's colours.
        strips: Marks and kerbs, also as shapes; none on floors and on very large ground.
    """

    picture: NDArray[np.uint8]
    corner: Float
    size: Float
    paints: Float
    land: Float
    light: Float
    strips: Strips

    @property
    def brightness(self) -> Float:
        """How bright (5,) the paints are, 0…1."""
        return np.asarray(self.paints @ _LUMINANCE)

    @property
    def beyond(self) -> tuple[float, ...]:
        """The colour of the land around, in its light."""
        return tuple(np.clip(self.land * self.light, 0.0, 1.0).tolist())

    def albedo(self) -> Float:
        """What covers the ground (h, w, 3), 0…1, in no light of its own."""
        kind = _STEPS / 255.0 * self.picture[..., 3]
        return np.stack(
            [np.interp(kind, np.arange(_STEPS + 1), band) for band in self.paints.T], axis=-1
        )

    def coloured(self, *, strips: bool = True) -> NDArray[np.uint8]:
        """The picture (h, w, 3) uint8 as it is seen from afar, with marks and kerbs or without."""
        seen = self.picture.astype(np.float32) / 255.0
        paints = self.brightness
        if not strips:
            paints[MARK_PAINT] = paints[MARK_PAINT + 1]
            paints[KERB_PAINT] = 0.5 * (paints[KERB_PAINT - 1] + paints[KERB_PAINT + 1])
        paint = np.interp(_STEPS * seen[..., 3], np.arange(_STEPS + 1), paints)
        lit = np.clip(BRIGHTEST * seen[..., :3] * paint[..., None], 0.0, 1.0)
        return np.asarray(np.round(255.0 * lit), np.uint8)

    def lit(self, places: Float, paint: int) -> Float:
        """Colours (n, 3), 0…1, of a paint by its number, in the light at places (n, 2) [m]."""
        height, width = self.picture.shape[:2]
        cells = (places - self.corner) / self.size * [width, height]
        column, row = np.clip(cells.astype(int), 0, [width - 1, height - 1]).T
        seen = BRIGHTEST / 255.0 * self.picture[row, column, :3]
        return np.asarray(np.clip(seen * self.brightness[paint], 0.0, 1.0))


def paint_ground(structures: Structures, light: Light) -> Ground:
    """Paint the ground of a world in its light, coarser the larger it is."""
    ends = structures.places
    if not len(ends):
        ends = np.zeros((1, 2))
    margin = 3.0 if structures.indoor else max(_MARGIN, 2.0 + _reach(structures))
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    if structures.indoor and len(structures.path):
        low = np.minimum(low, structures.path.min(axis=0) - margin)
        high = np.maximum(high, structures.path.max(axis=0) + margin)
    pixel = max(float((high - low).max()) / _PIXELS, 0.02 if structures.indoor else _FINEST)
    # Sides that can be halved some times have the same smaller copies in all renderers.
    width, height = (_HALVED * (np.ceil((high - low) / (_HALVED * pixel)).astype(int))).tolist()
    return _paint(structures, light, Brush(width, height, low, pixel))


def paint_tile(structures: Structures, light: Light, corner: Float, side: float) -> Ground:
    """Paint a square of a side [m] of a large world's ground finely, from its lower left corner."""
    pixel = side / (_TILE_PIXELS - 2 * _OVERLAP)
    # The picture goes past the tile, so that blurs and smaller copies match those of neighbours.
    low = corner - _OVERLAP * pixel
    reach = 2.0 * _HOLE if structures.indoor else _STREETS + _reach(structures)
    near = structures.within(low - reach, low + side + reach)
    return _paint(near, light, Brush(_TILE_PIXELS, _TILE_PIXELS, low, pixel))


def _paint(structures: Structures, light: Light, brush: Brush) -> Ground:
    indoor = structures.indoor
    paint = _paint_floor if indoor else _paint_streets
    cover, strips = paint(structures, brush)
    lit = _baked(light, brush, indoor=indoor)
    open_sky = open_light(indoor=indoor)
    if not indoor:
        fine = brush.finer()
        shadow = fine.blank()
        fine.polygons(shadow, structures.crowns.shadows(), fill=_LEAVES)
        fine.quads(shadow, _shadows(structures))
        shining = 1.0 - np.asarray(fine.reduced(shadow, _SHADOW_BLUR), np.float32) / 255.0
        lit += shining[..., None] * np.float32(SUN[2] * SUNSHINE)
        open_sky = open_sky + SUN[2] * SUNSHINE
    paints = _FLOOR_PAINTS if indoor else _STREET_PAINTS
    kind = _STEPS / 255.0 * np.asarray(cover, np.float32)
    hues = paints.T / (paints @ _LUMINANCE)
    hue = [np.interp(kind, np.arange(_STEPS + 1), band) for band in hues]
    seen = as_mask(screen(lit.astype(np.float64)) * np.stack(hue, axis=-1) / BRIGHTEST)
    return Ground(
        np.concatenate([seen, np.asarray(cover)[..., None]], axis=-1),
        brush.corner,
        np.array(brush.size) * brush.pixel,
        paints,
        paints[0] if indoor else paints[-1],
        screen(open_sky),
        strips,
    )


def _reach(structures: Structures) -> float:
    """How far the longest shadow reaches [m], along x or y."""
    tallest = max(each.max(initial=0.0) for each in (structures.heights, structures.trees[:, 3]))
    return float(tallest * np.abs(SUN[:2]).max() / SUN[2])


def _baked(light: Light, brush: Brush, *, indoor: bool) -> Single:
    """The light (h, w, 3) on the ground without the sun, linear."""
    size = np.array(brush.size) * brush.pixel
    least = _LIGHT_CELL_INDOOR if indoor else _LIGHT_CELL
    cell = max(least, float(size.max()) / _LIGHT_CELLS)
    columns, rows = np.ceil(size / cell).astype(int) + 1
    x, y = np.meshgrid(np.arange(columns) * cell, np.arange(rows) * cell)
    found, open_air = light.ground(brush.corner + np.column_stack([x.ravel(), y.ravel()]))
    found = found.reshape(rows, columns, 3)
    if open_air.any():
        # Under houses it is dark; what is next to them must not be for that.
        inside = ~open_air.reshape(rows, columns)
        near = distance_transform_edt(inside, return_distances=False, return_indices=True)
        found = gaussian_filter(found[tuple(near)], (_LIGHT_BLUR, _LIGHT_BLUR, 0.0))
    large = (round(columns * cell / brush.pixel), round(rows * cell / brush.pixel))
    # Cells are known at their corners, a resized picture at the middles of its pixels.
    shift = round(0.5 * cell / brush.pixel)
    area = (shift, shift, shift + brush.size[0], shift + brush.size[1])
    bands = [
        Image.fromarray(band.astype(np.float32)).resize(large, Image.Resampling.BILINEAR)
        for band in np.moveaxis(found, -1, 0)
    ]
    return np.stack([np.asarray(band.crop(area)) for band in bands], axis=-1)


def _paint_streets(structures: Structures, brush: Brush) -> tuple[Image.Image, Strips]:
    """What covers the ground of a town: marks, asphalt, kerbs, pavements and lawns, 0…255."""
    fine, kerb = brush.finer(), brush.finer(_KERBS_FINER)
    strips = Strips.none()
    marks, streets, kerbs, paved = brush.blank(), kerb.blank(), kerb.blank(), fine.blank()
    if brush.pixel <= _COARSE:
        plan = plan_town(structures)
        dashed = dashes(centre_lines(structures, plan.streets))
        strips = Strips(mark_pieces(dashed, _MARK), kerb_pieces(plan.streets))
        marks = brush.strips(dashed, _MARK)
        kerb.polygons(streets, plan.streets)
        kerb.polygons(kerbs, shapely.buffer(plan.streets, KERB))
        fine.polygons(paved, plan.paved)
        # Where the ground is paved, trees stand in beds of their own.
        trees = shapely.points(structures.trees[:, :2])
        trees = trees[shapely.dwithin(plan.paved, trees, _BED)]
        for picture, by in ((streets, kerb), (kerbs, kerb), (paved, fine)):
            by.polygons(picture, shapely.buffer(trees, _BED), fill=0)
    else:
        # From so far away, a street is what lies between houses.
        for picture, reach, by in ((streets, STREET, kerb), (paved, STREET + PAVEMENT, fine)):
            by.polygons(picture, shapely.buffer(structures.solids, reach, quad_segs=4))
        own = kerb.blank()
        kerb.polygons(own, shapely.buffer(structures.solids, PAVEMENT, quad_segs=4))
        kerbs = streets = ImageChops.subtract(streets, own)
    edges = kerb.reduced(streets), kerb.reduced(kerbs), fine.reduced(paved)
    return _stacked(*(ImageChops.invert(each) for each in (marks, *edges))), strips


def _stacked(*masks: Image.Image) -> Image.Image:
    """The sum of masks: each takes the ground from one paint to the next."""
    total = sum(np.asarray(mask, np.float32) for mask in masks)
    return Image.fromarray(as_mask(total / (_STEPS * 255.0)))


def _paint_floor(structures: Structures, brush: Brush) -> tuple[Image.Image, Strips]:
    """What covers the ground of a house: 0 around it, then the floor's edge, joints and tiles."""
    fine = brush.finer()
    floor, inner, lines = fine.blank(), fine.blank(), brush.blank()
    rooms = floor_of(structures)
    fine.polygons(floor, rooms)
    fine.polygons(inner, shapely.buffer(rooms, -0.06))
    brush.grid(lines, _TILES, _JOINT, _JOINT_STRENGTH)
    tiles = fine.reduced(inner)
    cover = _stacked(fine.reduced(floor), tiles, ImageChops.subtract(tiles, lines))
    return cover, Strips.none()


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
