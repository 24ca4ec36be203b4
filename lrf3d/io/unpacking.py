"""Bounds on what packed data unpack to: a few kilobytes may unpack to gigabytes.

The libraries that read bags unpack whole chunks, messages and files, however large; within
:func:`bounded_bags` they unpack no more than is named here.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from io import BytesIO
from types import SimpleNamespace
from typing import Any

from lrf3d.errors import InputError
from lrf3d.interrupts import check

MOST_UNPACKED = 1 << 28
"""Largest size [bytes] of a chunk or a message, and of all chunks that overlap in time: recorders
write chunks of a megabyte, some of a hundred."""

MOST_TIMES = 200
"""Largest factor by which a packed file is unpacked to a temporary one: bags have 2 to 20."""


@contextmanager
def bounded_bags() -> Iterator[None]:
    """Bound what rosbags unpacks in this block."""
    import bz2

    import lz4.frame
    from rosbags.rosbag1 import reader as old
    from rosbags.rosbag2 import reader, storage_mcap

    # Which module it is depends on the version of Python.
    zstd: Any = vars(storage_mcap)["zstd"]
    of_zstd, of_lz4 = _unpacker(zstd.open), _unpacker(lz4.frame.open)
    chunks = {**vars(storage_mcap)["DECOMPRESSORS"], "zstd": of_zstd, "lz4": of_lz4}
    parts = {**vars(old)["decompressors"], "bz2": _unpacker(bz2.open), "lz4": of_lz4}
    files = SimpleNamespace(open=lambda file, mode: _File(file, zstd), decompress=of_zstd)
    with ExitStack() as stack:
        for module, name, value in (
            (storage_mcap, "DECOMPRESSORS", chunks),
            (storage_mcap, "msgsrc", _Held(vars(storage_mcap)["msgsrc"]).messages),
            (old, "decompressors", parts),
            (reader, "zstd", files),
        ):
            stack.callback(setattr, module, name, vars(module)[name])
            setattr(module, name, value)
        yield


def _unpacker(opened: Callable[[Any], Any]) -> Callable[..., bytes]:
    """What unpacks data, to at most a size [bytes] and the byte that shows that there is more."""

    def unpacked(data: bytes, size: int = MOST_UNPACKED) -> bytes:
        check()
        with opened(BytesIO(data)) as stream:
            found: bytes = stream.read(min(size, MOST_UNPACKED) + 1)
        _check_size(len(found), "a chunk or a message")
        return found

    return unpacked


def _check_size(size: int, what: str) -> None:
    if size > MOST_UNPACKED:
        most = f"more than the {MOST_UNPACKED / 1e6:.0f} MB that are unpacked at a time"
        raise InputError(f"{what} of {most}; record in smaller chunks")


class _Held:
    """The chunks that are held: those that overlap in time are unpacked together."""

    def __init__(self, source: Callable[..., Iterator[Any]]) -> None:
        self._source, self._size = source, 0

    def messages(self, chunk: Any, *others: Any) -> Iterator[Any]:
        """The messages of a chunk, whose first stands for its beginning: nothing is unpacked."""
        found, size = self._source(chunk, *others), chunk.uncompressed_size
        yield next(found)
        self._size += size
        _check_size(self._size, "chunks that overlap in time, or one,")
        yield from found
        self._size -= size


class _File:
    """A packed file that is copied; what it unpacks to is bounded by its own size."""

    def __init__(self, file: Any, zstd: Any) -> None:
        self._stream = zstd.open(file)
        self._left = MOST_UNPACKED + MOST_TIMES * file.seek(0, 2)
        file.seek(0)

    def __enter__(self) -> "_File":
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def read(self, size: int) -> bytes:
        """The next bytes."""
        check()
        found: bytes = self._stream.read(size)
        self._left -= len(found)
        if self._left < 0:
            raise InputError(f"a packed file unpacks to more than {MOST_TIMES} times its size")
        return found
