"""Writing files whole or not at all: first under another name, then renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lrf3d.errors import OutputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a name beside ``path`` to write to, and rename it to ``path`` when all went well.

    The name keeps the ending of ``path``, by which libraries choose their format. When the
    writing fails or is interrupted, what stood at ``path`` before stays.

    Raises:
        OutputError: The file cannot be written there.
    """
    path = Path(path)
    if "\0" in str(path):
        raise OutputError(f"{path}: no name of a file; leave out its NUL character")
    unfinished = path.with_name(f".{path.stem}.{os.getpid()}.unfinished{path.suffix}")
    try:
        try:
            yield unfinished
            os.replace(unfinished, path)
        except OSError as error:
            if isinstance(error, OutputError) or error.errno is None:
                raise
            reason = error.strerror or str(error)
            raise OutputError(
                f"{path}: cannot be written: {reason}; choose another place"
            ) from error
    finally:
        unfinished.unlink(missing_ok=True) if unfinished.parent.is_dir() else None


def write_text(path: str | Path, text: str) -> None:
    """Write a text file whole or not at all.

    Raises:
        OutputError: The file cannot be written there.
    """
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def make_folder(path: str | Path) -> Path:
    """Make a folder, with those above it, and see that it can be written to.

    Raises:
        OutputError: It cannot be made or written to.
    """
    path = Path(path)
    if "\0" in str(path):
        raise OutputError(f"{path}: no name of a folder; leave out its NUL character")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: the folder cannot be made: {error.strerror}; choose another with --out"
        ) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: the folder cannot be written to; choose another with --out")
    return path
