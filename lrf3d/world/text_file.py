"""Opening world files within bounds: what cannot be read is a :class:`WorldError`."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

from lrf3d import input
from lrf3d.errors import WorldError
from lrf3d.input import LARGEST_TEXT

WHAT = "a world file"


def read_text(path: Path, *, largest: int = LARGEST_TEXT) -> str:
    """The text of a world file, UTF-8 with or without a byte order mark.

    Raises:
        WorldError: There is no such file, it is too large, or it cannot be read as text.
    """
    return input.read_text(path, what=WHAT, largest=largest, error=WorldError)


def open_within(path: Path, largest: int) -> AbstractContextManager[BinaryIO]:
    """Open a world file of limited size for reading.

    Raises:
        WorldError: It is not there, is no ordinary file, is too large, or cannot be read.
    """
    return input.opened(path, what=WHAT, largest=largest, error=WorldError)
