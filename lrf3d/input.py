"""Reading files: only regular files of limited size, and the names of their contents.

All files that users name are opened here, so that a pipe, a device or a folder gives a clear error
instead of a program that hangs or fills the memory. The built-in worlds and the assets are next to
the package in a checkout, and inside it in a wheel.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from lrf3d.errors import InputError

LARGEST_TEXT = 1 << 28
"""Largest text file [bytes]: about two million walls as TOML."""

GENERAL = frozenset(
    "building data drawing export floorplan grid journal log map model plan run scan scene"
    " sweep untitled world".split()
)
"""File names that say only what kind of file it is; the name of the folder is put before them."""


_PACKAGE = Path(__file__).parent


def check_ordinary(
    path: str | Path,
    *,
    what: str = "a file",
    largest: int | None = None,
    missing: str = "no such file",
    error: type[InputError] = InputError,
) -> None:
    """Check that a path is a regular file of limited size.

    Args:
        path: The path; links are followed.
        what: What is expected there, for messages.
        largest: Largest size [bytes].
        missing: The message if nothing is there.
        error: The class of the error.

    Raises:
        InputError: It is not there, is a folder, a pipe, a socket or a device, or is too large.
    """
    try:
        # Opening a pipe would wait for a writer, so its kind is checked before.
        status = os.stat(path)
    except FileNotFoundError:
        raise error(f"{path}: {missing}") from None
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror or problem}") from None
    except ValueError:
        raise error(f"{str(path)!r}: not a path of a file") from None
    if stat.S_ISDIR(status.st_mode):
        raise error(f"{path}: a folder, expected {what}")
    if not stat.S_ISREG(status.st_mode):
        raise error(f"{path}: not an ordinary file, expected {what}")
    if largest is not None and status.st_size > largest:
        raise error(
            f"{path}: {status.st_size / 1e6:.3g} MB, more than the {largest / 1e6:.3g} MB that"
            " such a file may have; cut it down to what is needed"
        )


@contextmanager
def opened(
    path: str | Path,
    *,
    what: str = "a file",
    largest: int | None = None,
    error: type[InputError] = InputError,
) -> Iterator[BinaryIO]:
    """Open a regular file for reading; the arguments are those of :func:`check_ordinary`.

    Raises:
        InputError: It does not exist, is not a regular file, is too large, or cannot be read.
    """
    check_ordinary(path, what=what, largest=largest, error=error)
    try:
        with open(path, "rb") as file:
            yield file
    except FileNotFoundError:
        raise error(f"{path}: no such file") from None
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror or problem}") from None


def read_text(
    path: str | Path,
    *,
    what: str = "a text file",
    largest: int = LARGEST_TEXT,
    error: type[InputError] = InputError,
) -> str:
    """The text of a regular file, UTF-8 with or without a byte order mark.

    Raises:
        InputError: There is no such file, it is too large, or it cannot be read as text.
    """
    with opened(path, what=what, largest=largest, error=error) as file:
        data = file.read()
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as problem:
        line = data[: problem.start].count(b"\n") + 1
        raise error(f"{path}:{line}: not a text file in UTF-8") from None


def own_name(path: str | Path, given: object = None, *, stem: str | None = None) -> str:
    """The name of the contents of a file, for pictures and for the folder of the results.

    It is the name in the file if there is one, else the file's name without its ending. If that is
    as general as ``map.yaml``, the name of its folder comes before it.

    Args:
        path: The file, or the folder.
        given: The name in the file, if it is a text.
        stem: The file's name without its ending, where that has more than one part.

    Example:
        >>> own_name("plans/office.dxf"), own_name("berlin/map.yaml"), own_name("x.toml", "Lab 3")
        ('office', 'berlin_map', 'Lab 3')
    """
    if isinstance(given, str) and given.strip():
        return given
    full_path = Path(os.path.abspath(path))
    name = full_path.stem if stem is None else stem
    folder = full_path.parent.name
    return f"{folder}_{name}" if folder and name.lower() in GENERAL else name


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def worlds_folder() -> Path:
    """The folder of the built-in worlds, one TOML file each."""
    return _folder("worlds")


def assets_folder() -> Path:
    """The folder of the robot's mesh and of the pictures."""
    return _folder("assets")
