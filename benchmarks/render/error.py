"""How clean a picture is: its distance from the same picture drawn with many samples a pixel."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lrf3d.geometry import Float

REFERENCE = 4
"""Pixels a side that a pixel of the reference is the mean of: 16 samples."""


def supersampled(
    make: Callable[[tuple[int, int]], Any], size: tuple[int, int], time: float, factor: int
) -> Float:
    """A picture (h, w, 3) drawn with so many pixels a side for each of its pixels.

    Args:
        make: Makes a film of a size [pixels].
        size: Width and height of the picture [pixels].
        time: Time of the run [s].
        factor: Pixels a side that are averaged to one.
    """
    film = make((factor * size[0], factor * size[1]))
    picture = np.asarray(film.draw(time)[:, :, :3], dtype=np.float64)
    film.close()
    pixels = picture.reshape(size[1], factor, size[0], factor, 3)
    return np.asarray(pixels.mean(axis=(1, 3)), dtype=np.float64)


def picture_error(picture: Float, reference: Float) -> float:
    """Root mean square difference of two pictures, of 255."""
    return float(np.sqrt(np.mean((picture - reference) ** 2)))
