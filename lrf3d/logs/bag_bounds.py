"""Bounds on what a bag may unpack to: a few kilobytes can hold gigabytes of zeros."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError
from lrf3d.logs.packed import BLOCK, LARGEST_RATIO, UNSUSPICIOUS

LARGEST_CHUNK = 1 << 27
"""Bytes that a chunk of an MCAP file may unpack to: recorders write chunks of some megabytes."""

LONGEST_METADATA = 1 << 17
"""Bytes of metadata that are read: those of a bag cut into a thousand files, in two seconds."""


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """Let rosbags unpack a chunk to the size that it is said to have, and no farther.

    rosbags looks at the size only when all is unpacked. Its table of decompressors hands them
    the size; while this holds, those in it heed it.
    """
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    before = dict(DECOMPRESSORS)
    DECOMPRESSORS.update({kind: _unpack_lz4 for kind in before if kind == "lz4"})
    DECOMPRESSORS.update({kind: _unpack_zstd for kind in before if kind == "zstd"})
    try:
        yield
    finally:
        DECOMPRESSORS.update(before)


def check_metadata(folder: Path) -> None:
    """See that what a folder says of its bag is not longer than takes a second to read.

    Raises:
        InputError: It is.
    """
    path = folder / "metadata.yaml"
    if path.is_file() and path.stat().st_size > LONGEST_METADATA:
        raise InputError(
            f"{path}: longer than {LONGEST_METADATA:,} bytes; read its files one by one"
        )


def check_packed_files(folder: Path) -> None:
    """See that files of a bag that are packed as a whole do not unpack to far more than they are.

    Raises:
        InputError: One of them does.
    """
    for path in sorted(folder.glob("*.zstd")):
        allowed, total = max(UNSUSPICIOUS, LARGEST_RATIO * path.stat().st_size), 0
        with _zstd().open(path, "rb") as stream:
            while block := stream.read(BLOCK):
                total += len(block)
                if total > allowed:
                    raise InputError(
                        f"{path}: unpacks to over {LARGEST_RATIO} times its size, which no bag"
                        " does; unpack it first if it is one"
                    )


def _unpack_lz4(data: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return _unpack(LZ4FrameDecompressor(), data, size)


def _unpack_zstd(data: bytes, size: int) -> bytes:
    return _unpack(_zstd().ZstdDecompressor(), data, size)


def _unpack(decompressor: Any, data: bytes, size: int) -> bytes:
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size:,} bytes, at most {LARGEST_CHUNK:,} are read")
    # A byte more than there should be is enough to see that there are too many.
    raw = decompressor.decompress(data, max_length=size + 1)
    parts = [raw]
    while raw and not decompressor.eof and sum(map(len, parts)) <= size:
        raw = decompressor.decompress(b"", max_length=size + 1)
        parts.append(raw)
    return b"".join(parts)


def _zstd() -> Any:
    """The library that rosbags unpacks with."""
    from rosbags.rosbag2 import storage_mcap

    return vars(storage_mcap)["zstd"]
