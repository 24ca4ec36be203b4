"""Writing files whole or not at all: first under another name, then renamed."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
        # Where nothing can be written, as under a name that is too long, nothing is left.
        with suppress(OSError):
            unfinished.unlink()


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
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: the folder cannot be made: {error.strerror}; choose another with --out"
        ) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: the folder cannot be written to; choose another with --out")
    return path


@contextmanager
def scratch_folder(beside: str | Path | None = None) -> Iterator[Path]:
    """A folder to work in, which is gone afterwards, even when its removal is interrupted.

    Args:
        beside: The folder that it is made in; the system's for temporary files where None.
    """
    prefix = "lrf3d-" if beside is None else ".unfinished-"
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=beside))
    try:
        yield folder
    finally:
        try:
            shutil.rmtree(folder)
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            # What a process that was ended still writes is removed by that process or the system.
            if not isinstance(error, OSError):
                raise
