"""Boxes on roofs: chimneys on hipped ones, and the tops of stairs and lifts on flat ones.

Houses enter; leave boxes, their faces in the rows of :mod:`lrf3d.scene.walls`, and their shadows.
They stand higher than any beam.
"""

from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Float, Int, Single, directions, lengths
from lrf3d.scene.facades import CAP
from lrf3d.scene.hipped_roofs import HippedRoofs
from lrf3d.scene.structures import Structures

_CHIMNEY, _CHIMNEY_TOP = 0.62, 0.8
"""Side of a chimney [m], and how far it stands over its roof there."""

_CHIMNEY_PLACE = 0.55
"""How far along the ridge it stands, from the middle of the roof."""

_LIFT, _LIFT_TOP = (2.6, 2.0, 1.3), 1.9
"""Length, width and height of the top of a lift [m], and its least distance from the parapet."""

_LOWEST = 6.0
"""Flat roofs below this height [m] have none."""

_SPACING = 17.0
"""Boxes on one roof stand at least so far apart [m]."""

_MOST = 3000
"""Number of boxes that are drawn at the most."""

_GREY, _BRICK = np.array([0.66, 0.66, 0.65]), np.array([0.50, 0.34, 0.29])
"""Colours of both."""


class RoofBoxes(NamedTuple):
    """Boxes that stand on roofs.

    Args:
        outlines: (b, 4, 2) their corners, counter-clockwise [m].
        low: (b,) height of their feet [m].
        high: (b,) height of their tops [m].
        colours: (b, 3) their colours.
        solids: (b,) the solid that each stands on.
    """

    outlines: Float
    low: Float
    high: Float
    colours: Float
    solids: Int

    def sides(self) -> Single:
        """Their sides (4 b, 4, 14)."""
        count = len(self.low)
        faces = np.zeros((count, 4, 4, 14), np.float32)
        after = np.roll(self.outlines, -1, axis=1)
        along = (after - self.outlines) / np.linalg.norm(after - self.outlines, axis=2)[..., None]
        for corner, (place, height) in enumerate(
            [(self.outlines, self.low), (after, self.low), (after, self.high),
             (self.outlines, self.high)]
        ):  # fmt: skip
            faces[:, :, corner, :2], faces[:, :, corner, 2] = place, height[:, None]
        faces[..., 3], faces[..., 4] = along[:, :, None, 1], -along[:, :, None, 0]
        faces[..., 8:10] = 1.0
        faces[..., 10:13] = self.colours[:, None, None]
        faces[..., 13] = CAP + 0.5
        return faces.reshape(-1, 4, 14)

    def tops(self) -> Single:
        """Their tops (b, 4, 14)."""
        faces = self.sides()[::4].copy()
        faces[:, :, :2] = self.outlines
        faces[:, :, 2] = self.high[:, None]
        faces[:, :, 3:6] = [0.0, 0.0, 1.0]
        return faces


def plan_boxes(structures: Structures, hips: HippedRoofs, roofs: Any, low: Float) -> RoofBoxes:
    """Choose where boxes stand.

    Args:
        structures: The houses.
        hips: Which have hipped roofs.
        roofs: (k,) what of each house its flat roof covers, as polygons.
        low: (k,) the heights of flat roofs [m].
    """
    tiled = np.flatnonzero(hips.chosen)
    side = np.where(tiled % 2 == 0, 1.0, -1.0)[:, None]
    reach = _CHIMNEY_PLACE * np.maximum(hips.half[tiled, :1] - hips.half[tiled, 1:], 1.0)
    places = hips.middle[tiled] + side * reach * hips.along[tiled]
    rise = hips.rise(tiled, places)
    half = np.full(2, 0.5 * _CHIMNEY)
    eaves = structures.solid_heights[tiled]
    chimneys = RoofBoxes(
        _outlines(places, hips.along[tiled], half),
        eaves + np.maximum(rise - 0.7, 0.0),
        eaves + rise + _CHIMNEY_TOP,
        np.tile(_BRICK, (len(tiled), 1)),
        tiled,
    )
    spots, flat = _spots(structures, roofs)
    lifts = RoofBoxes(
        _outlines(spots, _ways(structures, flat), 0.5 * np.array(_LIFT[:2])),
        low[flat],
        low[flat] + _LIFT[2],
        np.tile(_GREY, (len(flat), 1)),
        flat,
    )
    both = zip(chimneys, lifts, strict=True)
    return RoofBoxes(*(np.concatenate(column)[:_MOST] for column in both))


def _spots(structures: Structures, roofs: Any) -> tuple[Float, Int]:
    """Places (b, 2) on flat roofs with room for a lift's top, and the solid (b,) of each."""
    high = np.flatnonzero((structures.solid_heights >= _LOWEST) & (not structures.indoor))
    inner = shapely.buffer(roofs[high], -_LIFT_TOP - 0.5 * np.hypot(*_LIFT[:2]))
    parts, owner = shapely.get_parts(inner, return_index=True)
    there = ~shapely.is_empty(parts)
    parts, owner = parts[there], owner[there]
    found, solids = [np.zeros((0, 2))], [np.zeros(0, np.int64)]
    for part, solid in zip(parts, high[owner], strict=True):
        x0, y0, x1, y1 = shapely.bounds(part)
        # One in the middle of a small roof; on a large one, a loose grid of them.
        grid = [np.arange(a + 0.5 * ((b - a) % _SPACING), b + 1e-9, _SPACING)
                for a, b in ((x0, x1), (y0, y1))]  # fmt: skip
        x, y = (axis.ravel() for axis in np.meshgrid(*grid))
        inside = shapely.contains_xy(part, x, y)
        places = np.column_stack([x, y])[inside]
        if not len(places):
            places = shapely.get_coordinates(shapely.point_on_surface(part))
        found.append(places)
        solids.append(np.full(len(places), solid))
    return np.concatenate(found), np.concatenate(solids)


def _ways(structures: Structures, solids: Int) -> Float:
    """Direction (n, 2) of the longest wall of solids (n,), of unit length."""
    order = np.argsort(lengths(structures.segments), kind="stable")
    longest = np.zeros(int(structures.objects.max(initial=-1)) + 1, np.int64)
    longest[structures.objects[order]] = order
    return directions(structures.segments[longest[structures.solid_objects[solids]]])


def _outlines(places: Float, along: Float, half: Float) -> Float:
    """Rectangles (n, 4, 2) round places (n, 2), counter-clockwise."""
    across = np.column_stack([-along[:, 1], along[:, 0]])
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half
    return np.asarray(
        places[:, None] + corners[:, :1] * along[:, None] + corners[:, 1:] * across[:, None]
    )
