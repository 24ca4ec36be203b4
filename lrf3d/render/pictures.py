"""Pictures: arrays (h, w, 3 or 4) uint8 of red, green, blue and what else, row 0 at the top."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture = NDArray[np.uint8]

FrameProgress = Callable[[int, int], None]
"""Called with the frames of a film that are done and the number of all."""

_EFFORT = 4
"""Compression 0…9: beyond, a file takes twice the time and hardly gets smaller."""


def save_png(picture: Picture, path: Path) -> None:
    """Write a picture (h, w, 3 or 4) uint8; it is opaque, so that three values a pixel are kept."""
    Image.fromarray(picture[:, :, :3]).save(path, compress_level=_EFFORT)
