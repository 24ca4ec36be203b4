"""Opening world files within bounds, with one clear line where that fails."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from lrf3d.errors import WorldError

LARGEST_TEXT = 1 << 28
"""Bytes of text that are read into memory: about two million walls as TOML."""


def read_text(path: Path, *, largest: int = LARGEST_TEXT) -> str:
    """The text of a file, UTF-8 with or without a byte order mark.

    Args:
        path: The file.
        largest: How many bytes it may have.

    Raises:
        WorldError: There is no such file, it is too large, or it cannot be read as text.
    """
    with open_within(path, largest) as file:
        data = file.read()
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise WorldError(f"{path}:{line}: not a text file in UTF-8") from None


@contextmanager
def open_within(path: Path, largest: int) -> Iterator[BinaryIO]:
    """Open a file of at most so many bytes for reading.

    Raises:
        WorldError: It is not there, is no file, is too large, or cannot be read.
    """
    try:
        # Opening a pipe would wait for a writer, so what it is is asked before.
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise WorldError(f"{path}: a folder, expected a world file")
        if not stat.S_ISREG(status.st_mode):
            raise WorldError(f"{path}: no ordinary file")
        if status.st_size > largest:
            raise WorldError(
                f"{path}: {status.st_size / 1e6:.3g} MB, more than the {largest / 1e6:.3g} MB that"
                " such a file may have; cut it down to what is needed"
            )
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise WorldError(f"{path}: no such file") from None
    except OSError as error:
        raise WorldError(f"{path}: cannot be read: {error.strerror or error}") from None
