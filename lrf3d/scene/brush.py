"""Brush: paints shapes, given in metres, into pictures of one size and place."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

from lrf3d.geometry import Float, directions

_FINER = 2
"""Pixels to a side that shapes are painted with in place of one: steps in their edges would show.
"""

_RISE = 3.0
"""Width of the rise at the edge of a mark [pixels]."""

_CLOSEST = 4.0
"""Joints lie at least this many pixels apart."""


def as_mask(values: Any) -> NDArray[np.uint8]:
    """Values of 0…1 as 0…255."""
    return np.asarray(np.round(255.0 * np.clip(values, 0.0, 1.0)), np.uint8)


class Brush:
    """Paints shapes, given in metres, into pictures of one size."""

    def __init__(
        self, width: int, height: int, corner: Float, pixel: float, *, finer: int = 1
    ) -> None:
        self._finer = finer
        self.size = (width, height)
        self.corner = corner
        self.pixel = pixel

    def finer(self, times: int = _FINER) -> "Brush":
        """A brush for the same place with pixels so many times as fine."""
        width, height = self.size
        pixel = self.pixel / times
        return Brush(times * width, times * height, self.corner, pixel, finer=times)

    def reduced(self, picture: Image.Image, blur: float = 1.1) -> Image.Image:
        """A picture of this brush in the pixels of the coarser one, blurred by some of these."""
        return picture.reduce(self._finer).filter(ImageFilter.BoxBlur(blur))

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

    def strips(self, segments: Float, width: float) -> Image.Image:
        """Segments (n, 4) as strips of a width [m] whose edges rise evenly over some pixels.

        Where such a rise is magnified, the edge between both halves of it is straight and sharp.
        """
        cover = np.zeros(self.size[::-1], np.float32)
        local = (segments - np.tile(self.corner, 2)) / self.pixel
        half, most = 0.5 * width / self.pixel, np.array(self.size)
        for x1, y1, x2, y2 in local:
            low = np.floor(np.minimum([x1, y1], [x2, y2]) - half - _RISE).astype(int).clip(0)
            high = np.ceil(np.maximum([x1, y1], [x2, y2]) + half + _RISE).astype(int)
            high = np.minimum(high, most)
            if (high <= low).any():
                continue
            x = np.arange(low[0], high[0])[None] + 0.5 - 0.5 * (x1 + x2)
            y = np.arange(low[1], high[1])[:, None] + 0.5 - 0.5 * (y1 + y2)
            length = float(np.hypot(x2 - x1, y2 - y1))
            along = np.abs(x * (x2 - x1) + y * (y2 - y1)) / length - 0.5 * length
            across = np.abs(x * (y2 - y1) - y * (x2 - x1)) / length - half
            window = cover[low[1] : high[1], low[0] : high[0]]
            rise = np.clip(0.5 - np.maximum(along, across) / _RISE, 0.0, 1.0)
            np.maximum(window, rise, out=window)
        return Image.fromarray(as_mask(cover))

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

    def _points(self, points: Float) -> list[float]:
        flat: list[float] = ((points - self.corner) / self.pixel).ravel().tolist()
        return flat
