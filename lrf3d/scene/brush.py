"""Brush: paints shapes, given in metres, into pictures of one size and place."""

from typing import Any

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFilter

from lrf3d.geometry import Float

_FINER = 2
"""Pixels to a side that shapes are painted with in place of one: steps in their edges would show.
"""

_CLOSEST = 4.0
"""Joints lie at least this many pixels apart."""


class Brush:
    """Paints shapes, given in metres, into pictures of one size [pixels].

    Args:
        width: Width of the pictures.
        height: Their height.
        corner: (2,) place of the lower left corner [m].
        pixel: Size of a pixel [m].
    """

    def __init__(self, width: int, height: int, corner: Float, pixel: float) -> None:
        self.size = (width, height)
        self.corner = corner
        self.pixel = pixel

    @property
    def extent(self) -> Float:
        """Width and height (2,) of what is painted [m]."""
        return self.pixel * np.array(self.size)

    def finer(self) -> "Brush":
        """A brush for the same place with finer pixels."""
        width, height = self.size
        return Brush(_FINER * width, _FINER * height, self.corner, self.pixel / _FINER)

    def reduced(self, picture: Image.Image, blur: float = 0.6) -> Image.Image:
        """A picture of this brush in the pixels of the coarser one, blurred by some of these."""
        return picture.reduce(_FINER).filter(ImageFilter.BoxBlur(blur))

    def blank(self) -> Image.Image:
        """A picture of nothing."""
        return Image.new("L", self.size, 0)

    def polygons(self, picture: Image.Image, polygons: Any, fill: int = 255) -> None:
        """Fill polygons, holes left out by being painted over."""
        draw = ImageDraw.Draw(picture)
        parts = shapely.get_parts(polygons)
        # Where nothing is near, a union is one polygon of no points.
        parts = parts[~shapely.is_empty(parts)]
        # Large ones come first, as what stands in their holes is painted again.
        for polygon in parts[np.argsort(-shapely.area(parts), kind="stable")]:
            for ring, value in [(polygon.exterior, fill), *((r, 0) for r in polygon.interiors)]:
                draw.polygon(self._points(np.asarray(ring.coords)), fill=value)

    def grid(self, picture: Image.Image, metres: float, width: float) -> None:
        """Draw lines of a width [m] at a spacing [m], at its multiples in the film's frame.

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
                draw.line(ends, fill=255, width=pixels)

    def _points(self, points: Float) -> list[float]:
        flat: list[float] = ((points - self.corner) / self.pixel).ravel().tolist()
        return flat
