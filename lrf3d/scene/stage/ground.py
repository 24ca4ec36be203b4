"""The ground as a picture, painted once: streets and floors, darker next to walls."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from lrf3d.geometry import Float
from lrf3d.scene.shapes import GroundPicture
from lrf3d.scene.stage.structures import Structures, filled_between

STREET, PAVEMENT = 8.0, 1.7
"""How far a street reaches past the houses of a town, and the width of the pavement round them [m].
"""

_FLOOR, _JOINT_WIDTH = np.array([1.0, 0.96, 0.90]), 0.015
"""Colour of floors, and the width of joints between their tiles, which are a metre wide [m]."""


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
        finer, blur = 2, 0.6
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
    low, high = ends.min(axis=0) - setting.margin, ends.max(axis=0) + setting.margin
    pixels = 2048  # Longest side of the picture [pixels].
    pixel = max(float((high - low).max()) / pixels, setting.pixel)
    width, height = np.ceil((high - low) / pixel).astype(int).tolist()
    return Canvas(low, pixel, (width, height))


def paint_ground(structures: Structures, canvas: Canvas) -> GroundPicture:
    """Paint the ground of a world: asphalt and pavements, or the floor of a house."""
    indoor, land = structures.indoor, structures.setting.land
    cover = Image.new("L", canvas.size, land)
    walls = shapely.buffer(structures.tree.geometries, 2.0 * canvas.pixel)
    # Brightness, 0…255, of pavements, tiles of a floor, and the joints between them.
    paved, tile, joint = 134, 178, 160
    if indoor:
        tiles = canvas.mask(_floor(structures))
        cover.paste(tile, mask=tiles)
        (left, low), (right, high) = canvas.corner, canvas.corner + canvas.extent
        half = 0.5 * max(_JOINT_WIDTH, canvas.pixel)
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
    shaded, fade = 0.45, 0.06
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
    hole, rim, around = 4.0, 0.1, 1.6
    filled = filled_between(structures.segments, hole)
    rooms = shapely.union_all(shapely.buffer(filled, rim - hole, join_style="mitre"))
    shapely.prepare(rooms)
    path = structures.path[:: max(1, len(structures.path) // 2000)]
    outside = path[~shapely.contains_xy(rooms, *path.T)]
    floor = shapely.union_all([rooms, *shapely.buffer(shapely.points(outside), around)])
    # Where these meet rooms there are no corners.
    return shapely.buffer(shapely.buffer(floor, around), -around)
