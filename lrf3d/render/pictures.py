"""Pictures: arrays (h, w, 4) uint8 of red, green, blue and opacity, row 0 at the top; PNG files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture = NDArray[np.uint8]

FrameProgress = Callable[[int, int], None]
"""Called with the frames of a film that are done and the number of all, or parts of frames."""


_EFFORT = 4
"""Compression 0…9: beyond, a file takes twice the time and hardly gets smaller."""


def frame_name(number: int) -> str:
    """The name of the file of a frame, so that names sort like numbers."""
    return f"frame_{number:06d}.png"


def save_png(picture: Picture, path: Path) -> None:
    """Write a picture (h, w, 3 or 4) uint8; it is opaque, so that three values a pixel are kept."""
    Image.fromarray(picture[:, :, :3]).save(path, compress_level=_EFFORT)


class PngEncoder:
    """Writes RGBA pictures to the files of a folder, which it makes.

    Args:
        path: The folder.
        size: Width and height of the pictures [pixels].
        fps: Frames a second.
        first: The number of the first picture in the film.
    """

    def __init__(self, path: Path, *, size: tuple[int, int], fps: float, first: int = 0) -> None:
        path.mkdir(exist_ok=True)
        self._folder, self._next = path, first

    def add(self, picture: Picture) -> None:
        """Write a picture (h, w, 4) uint8."""
        save_png(picture, self._folder / frame_name(self._next))
        self._next += 1

    def __enter__(self) -> "PngEncoder":
        return self

    def __exit__(self, *error: object) -> None:
        pass
