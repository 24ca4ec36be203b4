"""Files: only regular ones of limited size are read; writing is complete or not at all.

All files that users name are opened here, so that a pipe, a device or a folder gives a clear error
instead of a program that never ends or fills the memory. The built-in worlds and the assets are
next to the package in a checkout, and inside it in a wheel.
"""

import os
import re
import shutil
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import BinaryIO

from lrf3d.base.errors import InputError, OutputError, shown, storage
from lrf3d.base.interrupts import unfinished as unfinished_paths

# Largest text file [bytes]: about two million walls as TOML.
LARGEST_TEXT = 1 << 28

# File names that say only what kind of file it is; the name of the folder is put before them.
GENERAL = frozenset(
    "building data drawing export floorplan grid journal log map model plan run scan scene"
    " sweep untitled world".split()
)


def as_path(path: object) -> Path:
    """A path that comes from outside; a number would be an open file, such as the output."""
    name = os.fspath(path) if isinstance(path, str | os.PathLike) else None
    if not isinstance(name, str):
        raise InputError(f"path {shown(path)}: expected the name of a file, as a text or a Path")
    return Path(name)


def check_ordinary(
    path: str | Path,
    *,
    what: str = "a file",
    largest: int | None = None,
    missing: str = "no such file",
    error: type[InputError] = InputError,
) -> None:
    """Check that a path is a regular file, of at most the largest size [bytes].

    Messages say what is expected there, or ``missing`` if nothing is there.
    """
    path = as_path(path)
    try:
        # Opening a pipe would wait for a writer, so its kind is checked before.
        status = os.stat(path)
    except FileNotFoundError:
        raise error(f"{path}: {missing}") from None
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"{path}: cannot be read: {reason}") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not an ordinary file"
        raise error(f"{path}: {kind}, expected {what}")
    if largest is not None and status.st_size > largest:
        raise error(
            f"{path}: {storage(status.st_size)}, more than the {storage(largest)} that"
            " such a file may have; cut it down to what is needed"
        )


@contextmanager
def opened(
    path: str | Path, *, what: str = "a file", largest: int | None = None
) -> Iterator[BinaryIO]:
    """Open a regular file for reading; the arguments are those of :func:`check_ordinary`."""
    check_ordinary(path, what=what, largest=largest)
    try:
        with open(path, "rb") as file:
            yield file
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror or problem}") from None


def read_text(path: str | Path, *, what: str = "a text file", largest: int = LARGEST_TEXT) -> str:
    """The text of a regular file, UTF-8 with or without a byte order mark."""
    with opened(path, what=what, largest=largest) as file:
        data = file.read()
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as problem:
        line = data[: problem.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: not a text file in UTF-8") from None


def toml_as_json(path: Path) -> str:
    """The values of a TOML file as JSON; a date becomes a list, which no key accepts."""
    import json
    import tomllib

    text = read_text(path)
    try:
        return json.dumps(tomllib.loads(text), default=lambda date: [str(date)])
    except ValueError as error:
        raise InputError(f"{path}: not TOML: {error}") from None


def own_name(path: str | Path, given: object = None, *, stem: str | None = None) -> str:
    """The name of the contents of a file, for pictures and for the folder of the results.

    It is the name in the file if that is a text, else the stem, which is the file's name without
    its ending. If that is as general as ``map.yaml``, the name of its folder comes before it.

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


def folder_name(name: str) -> str:
    """A name for a folder, of letters, digits, dots, hyphens and underscores.

    Example:
        >>> folder_name("Lab 3/west"), folder_name("../..")
        ('Lab_3_west', 'world')
    """
    # Largest length of a folder's name: file systems allow 255 bytes, and suffixes are added.
    longest_name = 60
    return re.sub(r"[^\w.+-]+", "_", name)[:longest_name].strip("._") or "world"


def data_folder(name: str) -> Path:
    """The folder ``worlds``, one TOML file each, or ``assets``, the robot's mesh and pictures."""
    installed = Path(__file__).parents[1] / name
    return installed if installed.is_dir() else installed.parents[1] / name


@contextmanager
def writing(path: str | Path, advice: str = "choose another place") -> Iterator[None]:
    """Let errors of the system name the path that is written, and what to do."""
    if "\0" in str(path):
        raise OutputError(f"{path}: not a file name; remove its NUL character")
    try:
        yield
    except OSError as error:
        if isinstance(error, OutputError) or error.errno is None:
            raise
        reason = error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written: {reason}; {advice}") from error


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a place of the same name in a private folder, and move what is written there to `path`.

    If writing fails or is interrupted, an older file at ``path`` stays. A symbolic link at ``path``
    is replaced, not followed.
    """
    path = as_path(path)
    with writing(path), unfinished_folder(path) as folder:
        unfinished = folder / path.name
        yield unfinished
        os.replace(unfinished, path)


@contextmanager
def unfinished_folder(path: str | Path) -> Iterator[Path]:
    """Make a private folder next to ``path``, for files that are moved there when complete.

    All that lrf3d writes begins in one. Nobody else can guess its name, or put a link into it that
    would lead what is written elsewhere. It is removed afterwards, and so are those that processes
    left there when they were killed.
    """
    place = as_path(path).parent
    # Beginning and end of the names of the private folders in which files are written.
    private = ".lrf3d-"
    unfinished = ".unfinished"
    with writing(path):
        for left in place.glob(f"{private}*{unfinished}"):
            with suppress(OSError), _hold(left):
                shutil.rmtree(left)
        folder = None
        held = ExitStack()
        # Between its making and its locking another process may take a folder for one that is left.
        while folder is None or not folder.exists():
            folder = Path(mkdtemp(unfinished, private, place))
            unfinished_paths.add(str(folder))
            with suppress(FileNotFoundError):
                held.enter_context(_hold(folder, wait=True))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        unfinished_paths.discard(str(folder))
        held.close()


@contextmanager
def _hold(folder: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold the lock of a private folder, which the system releases however this process ends.

    Where the system has no such locks, it can be held by waiting alone.
    """
    try:
        import fcntl
    except ImportError:
        if not wait:
            raise OSError from None
        yield
        return
    file = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        status = os.fstat(file)
        if status.st_uid != os.geteuid() or stat.S_IMODE(status.st_mode) != stat.S_IRWXU:
            raise OSError(f"{folder}: of somebody else")
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(file)


def opened_own(path: Path, *, fresh: bool = False, buffering: int = -1) -> BinaryIO:
    """Open a file of one's own for reading and appending, or make a fresh one in its place.

    A symbolic link is not followed: somebody else may have put it there.
    """
    if fresh:
        path.unlink(missing_ok=True)
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
    return os.fdopen(os.open(path, flags | (os.O_EXCL if fresh else 0), 0o666), "r+b", buffering)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file completely or not at all."""
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def make_folder(path: str | Path) -> Path:
    """Make a folder and its parents, and check that it can be written to."""
    path = as_path(path)
    with writing(path, "choose another with --out"):
        path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: the folder cannot be written to; choose another with --out")
    return path


@contextmanager
def locked(target: Path, shown: Path | None = None) -> Iterator[None]:
    """Hold the lock of a target, so that no other process writes to it meanwhile.

    The lock is a hidden file next to it, which the system releases however this process ends.
    Messages call the target by what is shown, if given.
    """
    from filelock import FileLock, Timeout

    path = target.with_name(f".{target.name}.lock")
    shown = shown or target
    lock = FileLock(path, blocking=False)
    if not path.parent.is_dir():
        raise OutputError(f"{shown}: cannot be written: there is no folder {path.parent}; make it")
    try:
        with writing(shown):
            lock.acquire()
    except Timeout:
        raise InputError(
            f"{shown}: another process writes here; wait for it, or choose another place with --out"
        ) from None
    unfinished_paths.add(str(path))
    try:
        yield
    finally:
        # Removed while it is held: whoever waits for a removed file looks again.
        with suppress(OSError):
            path.unlink()
        unfinished_paths.discard(str(path))
        lock.release()
