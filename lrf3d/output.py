"""Writing files completely or not at all: under a temporary name first; one writer at a time.

Unfinished files of killed processes are removed by the next process that writes to the folder.
"""

import json
import os
import re
import shutil
import stat
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from platform import node
from typing import Any

from lrf3d.errors import InputError, Lrf3dError, OutputError
from lrf3d.interrupts import check

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no fcntl
    # Windows has no such locks.
    fcntl = None  # type: ignore[assignment]

LONGEST_STEM = 100
"""Bytes of a name that are kept in its temporary name: names have at most 255."""

FORGOTTEN = 7 * 86400.0
"""Age [s] after which unfinished files of another machine are removed, whose processes cannot be
checked."""

_UNFINISHED = re.compile(r"\..*\.(\d+)-\d+@([\w-]*)\.unfinished(\..*)?", re.DOTALL)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name next to ``path`` to write to, and rename it to ``path`` afterwards.

    The name has the ending of ``path``, from which libraries derive the format. If writing fails or
    is interrupted, an older file at ``path`` stays.

    Raises:
        OutputError: The file cannot be written there.
    """
    path = Path(path)
    if "\0" in str(path):
        raise OutputError(f"{path}: not a file name; remove its NUL character")
    unfinished = _unfinished(path)
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
        # If nothing could be written, as under a name that is too long, there is nothing to remove.
        with suppress(OSError):
            unfinished.unlink()


@contextmanager
def unfinished_folder(path: str | Path) -> Iterator[Path]:
    """Make a temporary folder next to ``path``, for files that are moved there when complete.

    The folder and what is left in it are removed afterwards.
    """
    # Its name differs from that of an unfinished file for the same path.
    folder = _unfinished(Path(f"{path}.parts"))
    with _removed_at_the_end(folder):
        folder.mkdir()
        yield folder


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a folder among the system's temporary files; it is removed afterwards."""
    folder = Path(tempfile.mkdtemp(prefix="lrf3d-"))
    with _removed_at_the_end(folder):
        yield folder


@contextmanager
def _removed_at_the_end(folder: Path) -> Iterator[None]:
    """Remove a folder when the block ends, even if removing it is interrupted."""
    try:
        yield
    finally:
        try:
            shutil.rmtree(folder)
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            # Files that an ending process still writes are removed by it or by the system.
            if not isinstance(error, OSError):
                raise


def write_text(path: str | Path, text: str) -> None:
    """Write a text file completely or not at all.

    Raises:
        OutputError: The file cannot be written there.
    """
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def make_folder(path: str | Path) -> Path:
    """Make a folder and its parents, and check that it can be written to.

    Raises:
        OutputError: It cannot be made or written to.
    """
    path = Path(path)
    if "\0" in str(path):
        raise OutputError(f"{path}: not a folder name; remove its NUL character")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: the folder cannot be made: {error.strerror}; choose another with --out"
        ) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: the folder cannot be written to; choose another with --out")
    return path


class Lock:
    """A lock that is held, with the contents of its file.

    Args:
        file: The open file.
        left: The note of the last holder, if it left the file behind.

    Attributes:
        keep: Whether the file stays with its note when the lock is released.
    """

    def __init__(self, file: int, left: Mapping[str, Any]) -> None:
        self._file, self.left, self.keep = file, left, False

    def note(self, **values: Any) -> None:
        """Write the holder of the lock, and a note for the next holder, to the file."""
        text = json.dumps({**values, "process": os.getpid(), "machine": _MACHINE})
        # The lock works without the note if the disk is full.
        with suppress(OSError):
            os.ftruncate(self._file, 0)
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, text.encode())


@contextmanager
def locked(path: Path, target: Path) -> Iterator[Lock]:
    """Hold a lock file, so that no other process writes to a target meanwhile.

    The system releases the lock however this process ends. On a file system without locks it is
    checked whether the process that the file names still runs.

    Args:
        path: The lock file, in an existing folder.
        target: The file or the folder that is locked, for messages.

    Raises:
        InputError: Another process holds it.
        OutputError: The file cannot be made.
    """
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
        except OSError as error:
            raise OutputError(
                f"{target}: cannot be written: {error.strerror}; choose another place"
            ) from error
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise OutputError(f"{path}: not an ordinary file; remove it")
            left = _note_of(file)
            if not _take(file, left):
                who = f"process {left['process']}" if "process" in left else "another process"
                raise InputError(
                    f"{target}: {who} writes here; wait for it, or choose another place with --out"
                )
            # A process that released the lock at this moment has removed the file.
            if _same_file(file, path):
                break
        except BaseException:
            os.close(file)
            raise
        os.close(file)
    lock = None
    try:
        lock = Lock(file, left)
        lock.note(**{name: value for name, value in left.items() if name not in _HOLDER})
        yield lock
    finally:
        # The lock is released even if an interrupt comes in between.
        try:
            if lock is None or not lock.keep:
                with suppress(OSError):
                    path.unlink()
        finally:
            try:
                # Closing is not enough: forked children have the file open, too.
                if fcntl is not None:
                    with suppress(OSError):
                        fcntl.flock(file, fcntl.LOCK_UN)
            finally:
                os.close(file)


def lock_of(path: Path) -> Path:
    """The lock file of a target, in the same folder."""
    return path.with_name(f".{_cut(path.name)}.lock")


def clear_unfinished(folder: Path) -> None:
    """Remove unfinished files of processes that have ended from a folder."""
    try:
        with os.scandir(folder) as entries:
            found = [(entry, _UNFINISHED.fullmatch(entry.name)) for entry in entries]
        for entry, match in found:
            if match is None or not _abandoned(entry, int(match[1]), match[2]):
                continue
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                os.unlink(entry.path)
    except OSError:
        # The file belongs to another user, or another process removes it as well.
        return


_MACHINE = re.sub(r"[^\w-]", "_", node(), flags=re.ASCII)[:40]

_HOLDER = ("process", "machine")


def _unfinished(path: Path) -> Path:
    """The temporary name for a path that this thread writes to."""
    clear_unfinished(path.parent)
    who = f"{os.getpid()}-{threading.get_native_id()}@{_MACHINE}"
    return path.with_name(f".{_cut(path.stem)}.{who}.unfinished{path.suffix}")


def _cut(name: str) -> str:
    return os.fsdecode(os.fsencode(name)[:LONGEST_STEM])


def _abandoned(entry: "os.DirEntry[str]", process: int, machine: str) -> bool:
    if machine != _MACHINE:
        return entry.stat(follow_symlinks=False).st_mtime < time.time() - FORGOTTEN
    return not _alive(process)


def _alive(process: int) -> bool:
    """Whether there is such a process on this machine."""
    if os.name != "posix":
        # Other systems have no harmless way to check.
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _take(file: int, left: Mapping[str, Any]) -> bool:
    """Take the lock on an open file; returns whether that succeeded."""
    if fcntl is not None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False
        except OSError:
            # The file system, such as some network ones, has no locks.
            pass
    process = left.get("process")
    if left.get("machine") != _MACHINE or not isinstance(process, int):
        return True
    return process == os.getpid() or not _alive(process)


def _note_of(file: int) -> dict[str, Any]:
    """The note in a lock file; empty if it is damaged."""
    try:
        note = json.loads(os.read(file, 1 << 16))
    except (ValueError, RecursionError):
        return {}
    return note if isinstance(note, dict) else {}


def _same_file(file: int, path: Path) -> bool:
    try:
        here, there = os.fstat(file), os.stat(path)
    except FileNotFoundError:
        return False
    return (here.st_dev, here.st_ino) == (there.st_dev, there.st_ino)


Drawing = tuple[Path, Callable[[Path], object]]
"""The file of a picture or a film, and the function that draws it to a path."""


def draw_all(drawings: Mapping[str, Drawing], kept: str) -> tuple[dict[str, Path], str]:
    """Draw pictures and films, each even if others fail.

    Args:
        drawings: The drawings by name.
        kept: The end of a message about a failure: where the data are, and how to draw again.

    Returns:
        The files that were drawn, by name, and a line about those that were not; it is empty if
        all were drawn.
    """
    drawn: dict[str, Path] = {}
    failed: list[str] = []
    reason = ""
    for name, (path, draw) in drawings.items():
        check()
        try:
            draw(path)
        except Exception as error:
            # Drawings come after the data, so no error here can lose data.
            failed.append(path.name)
            reason = reason or _reason(error)
        else:
            drawn[name] = path
    return drawn, f"{', '.join(failed)}: not drawn: {reason}; {kept}" if failed else ""


def _reason(error: Exception) -> str:
    """The last line of an error; errors of lrf3d have only one."""
    if isinstance(error, Lrf3dError):
        return str(error)
    return "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
