"""The ground as a picture, painted once in its light: streets and floors."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from lrf3d.geometry import Float
from lrf3d.scene.light import open_light, screen
from lrf3d.scene.shapes import GroundPicture
from lrf3d.scene.structures import Structures, filled_between

_PIXELS = 3072
"""Longest side of the picture [pixels]; larger ones take longer to paint than a second."""

_FINEST, _FINEST_INDOOR = 0.06, 0.02
"""Smallest size of a pixel [m]: finer ones show no more of a small place."""

STREET, PAVEMENT = 8.0, 1.7
"""How far a street reaches past the houses of a town, and the width of the pavement round them [m].
"""

_MARGIN, _MARGIN_INDOOR = 30.0, 3.0
"""How far the picture, and with it light on the ground, reaches past walls [m]."""

_FINER, _BLUR = 2, 0.6
"""Pixels to a side that shapes are painted with in place of one, and how far they are smoothed
[pixels]: steps in their edges would show."""

_ASPHALT, _PAVEMENT = (0.47, 0.47, 0.475), (0.58, 0.575, 0.565)
_AROUND_HOUSE, _EDGE, _JOINT, _TILE = (
    (0.40, 0.42, 0.45),
    (0.70, 0.69, 0.67),
    (0.70, 0.67, 0.62),
    (0.775, 0.74, 0.685),
)
"""Paints of a town, and of a house: what lies round it, the edge of its floor, joints and tiles."""

_TILES, _JOINT_WIDTH = 1.0, 0.015
"""Side of a floor's tiles and width of the joints between them [m]."""

_BRIGHTEST = 1.3
"""What light, as a factor of a screen's colours, the largest value of a picture of light stands
for: what covers the ground is as much brighter in its own."""

_FADE = 0.06
"""Share of the picture, at its edges, in which it goes over into the land around."""

_HOLE, _RIM = 4.0, 0.1
"""A floor closes openings in walls of up to twice the first, and goes past them by the second [m].
"""

_AROUND = 1.6
"""How far round its path a robot has a floor under it [m], where there are no rooms."""


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
        fine = Image.new("L", (_FINER * self.size[0], _FINER * self.size[1]))
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


def canvas_of(structures: Structures) -> Canvas:
    """Where the picture of the ground of a world lies, coarser the larger it is."""
    indoor = structures.indoor
    ends = structures.places if len(structures.places) else np.zeros((1, 2))
    if indoor:
        ends = np.concatenate([ends, structures.path])
    margin = _MARGIN_INDOOR if indoor else _MARGIN
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    pixel = max(float((high - low).max()) / _PIXELS, _FINEST_INDOOR if indoor else _FINEST)
    width, height = np.ceil((high - low) / pixel).astype(int).tolist()
    return Canvas(low, pixel, (width, height))


def paint_ground(structures: Structures, canvas: Canvas, light: Float) -> GroundPicture:
    """Paint the ground of a world in its light (rows, columns, 3)."""
    indoor = structures.indoor
    far = np.clip(_land(indoor=indoor) * screen(open_light(indoor=indoor)), 0.0, 1.0)
    seen = ImageChops.multiply(_cover(structures, canvas), _as_light(light, canvas))
    around = Image.new("RGB", seen.size, tuple(np.round(255.0 * far).astype(int).tolist()))
    picture = Image.composite(seen, around, _fading(*canvas.size))
    return GroundPicture(np.asarray(picture), canvas.corner, canvas.extent, far)


def _cover(structures: Structures, canvas: Canvas) -> Image.Image:
    """What covers the ground of a world, in no light."""
    cover = Image.new("RGB", canvas.size)
    for mask, paint in (_floor if structures.indoor else _town)(structures, canvas):
        bright = np.round(255.0 * np.minimum(_BRIGHTEST * np.array(paint), 1.0)).astype(int)
        cover.paste(tuple(bright.tolist()), (0, 0, *canvas.size), mask)
    return cover


Paints = list[tuple[Image.Image | None, tuple[float, ...]]]
"""Paints laid over each other, each where its mask says; everywhere without one."""


def _town(structures: Structures, canvas: Canvas) -> Paints:
    """What covers the ground of a town: asphalt, and a pavement round its houses."""
    pavement = shapely.buffer(structures.houses, PAVEMENT, join_style="mitre")
    return [(None, _ASPHALT), (canvas.mask(pavement), _PAVEMENT)]


def _floor(structures: Structures, canvas: Canvas) -> Paints:
    """What covers the ground of a house: its floor, with an edge, tiles and joints."""
    rooms = floor_of(structures)
    tiles = canvas.mask(shapely.buffer(rooms, -0.06))
    low, high = canvas.corner, canvas.corner + canvas.extent
    half = 0.5 * max(_JOINT_WIDTH, canvas.pixel)
    x, y = (_TILES * np.arange(np.ceil(low[k] / _TILES), high[k] / _TILES) for k in (0, 1))
    joints = [
        *shapely.box(x - half, low[1], x + half, high[1]),
        *shapely.box(low[0], y - half, high[0], y + half),
    ]
    between = ImageChops.multiply(tiles, canvas.mask(joints))
    return [
        (None, _AROUND_HOUSE), (canvas.mask(rooms), _EDGE), (tiles, _TILE), (between, _JOINT)
    ]  # fmt: skip


def _land(*, indoor: bool) -> Float:
    return np.array(_AROUND_HOUSE if indoor else _ASPHALT)


def _fading(width: int, height: int) -> Image.Image:
    """How much of the ground is seen: all of it but at the edges, where it fades."""
    along, up = (
        np.clip(np.minimum(places, 1.0 - places) / _FADE, 0.0, 1.0)
        for places in ((np.arange(side) + 0.5) / side for side in (width, height))
    )
    return Image.fromarray(np.round(255.0 * np.outer(up, along)).astype(np.uint8))


def _as_light(cells: Float, canvas: Canvas) -> Image.Image:
    """Light in cells (rows, columns, 3) as a picture of what it makes of white."""
    values = np.clip(255.0 * screen(cells) / _BRIGHTEST, 0.0, 255.0)
    return Image.fromarray(np.round(values).astype(np.uint8)).resize(
        canvas.size, Image.Resampling.BICUBIC
    )


def floor_of(structures: Structures) -> Any:
    """The floor of a house, as a shapely geometry: its rooms, and under the path outside them."""
    filled = filled_between(structures.segments, _HOLE)
    rooms = shapely.union_all(shapely.buffer(filled, _RIM - _HOLE, join_style="mitre"))
    shapely.prepare(rooms)
    path = structures.path[:: max(1, len(structures.path) // 2000)]
    outside = path[~shapely.contains_xy(rooms, path[:, 0], path[:, 1])]
    floor = shapely.union_all([rooms, *shapely.buffer(shapely.points(outside), _AROUND)])
    # Where these meet rooms there are no corners.
    return shapely.buffer(shapely.buffer(floor, _AROUND), -_AROUND)
