"""Arrays of a .npz file, in and out as streams, within bounds of memory and never unpickled.

Reading maps huge arrays that are not packed: they take memory as they are looked at, and none when
memory is short. Writing takes arrays in blocks, so that none is ever held whole. They lie in the
file as they are in memory, not packed and each at a multiple of 64 bytes, so that huge ones can be
mapped. Nothing but the arrays decides the bytes of the file.
"""

import os
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import DTypeLike, NDArray

from lrf3d.errors import OutputError
from lrf3d.input import check_ordinary
from lrf3d.io.packed import LARGEST_RATIO
from lrf3d.output import replacing

SMALL_RUN = 1 << 28
"""Bytes that any file may unpack to, however small."""

MAPPED = 1 << 26
"""Bytes from which on an array is mapped where it can be: smaller ones are read and checked."""

_LOCAL_HEADER = 30
"""Size of what stands before a member of a zip file [bytes], beside its name and its fields."""

DAMAGES = (
    OSError,
    ValueError,
    TypeError,
    IndexError,
    OverflowError,
    EOFError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)
"""What reading a damaged file may raise."""

ALIGNED = 64
"""Bytes that arrays begin at a multiple of, as NumPy's own files have it."""

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time of all members, the earliest of a zip file: equal runs are equal files at any time."""

_ZIP64, _PADDING = 20, 4
"""Sizes [bytes] of a zip member's field for large sizes, and of an empty field."""

Array = NDArray[np.generic]


def read_arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """The arrays of a .npz file by their names.

    Raises:
        InputError: There is no such file, or it is no ordinary one.
        ValueError: It holds what is no array, or unpacks to far more than a run does; or one of
            the others of :data:`DAMAGES`.
    """
    check_ordinary(path, what="a .npz file")
    with zipfile.ZipFile(path) as file:
        total = sum(entry.file_size for entry in file.infolist())
        if total > max(SMALL_RUN, LARGEST_RATIO * path.stat().st_size):
            raise ValueError(f"it unpacks to {total:,} bytes, over {LARGEST_RATIO} times its size")
        return {
            entry.filename.removesuffix(".npy"): _read(path, file, entry)
            for entry in file.infolist()
        }


def _read(path: Path, file: zipfile.ZipFile, entry: zipfile.ZipInfo) -> NDArray[np.generic]:
    with file.open(entry) as stream:
        version = npy.read_magic(stream)
        if version > (2, 0):
            raise ValueError(f"{entry.filename} is of version {version} of its format")
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, dtype = read(stream)
        begin = stream.tell()
        # Room is made for all of an array before any of it is read.
        size = dtype.itemsize
        for length in shape:
            size *= length
        if dtype.hasobject or size > entry.file_size:
            raise ValueError(f"{entry.filename} is not a plain array, or incomplete")
    if size >= MAPPED and entry.compress_type == zipfile.ZIP_STORED and not by_columns:
        begin += _start_of(path, entry)
        if begin + size > path.stat().st_size:
            raise ValueError(f"{entry.filename} is incomplete")
        mapped = np.memmap(path, dtype, "r", begin, shape)
        return np.asarray(mapped)
    with file.open(entry) as stream:
        return npy.read_array(stream, allow_pickle=False)


def _start_of(path: Path, entry: zipfile.ZipInfo) -> int:
    """Where in a zip file the data of a member begin."""
    with path.open("rb") as file:
        file.seek(entry.header_offset)
        header = file.read(_LOCAL_HEADER)
    name, fields = struct.unpack("<26xHH", header)
    return entry.header_offset + _LOCAL_HEADER + int(name) + int(fields)


@dataclass(frozen=True, slots=True)
class Column:
    """An array that comes in blocks.

    Args:
        name: Its name.
        shape: Its shape.
        dtype: Its type.
        blocks: Its rows, some at a time.
    """

    name: str
    shape: tuple[int, ...]
    dtype: DTypeLike
    blocks: Iterable[Array]

    @classmethod
    def of(cls, name: str, array: Array) -> "Column":
        """The column of an array that is there."""
        return cls(name, array.shape, array.dtype, [array])


def write_npz(path: str | Path, columns: Iterable[Column]) -> None:
    """Write arrays to a file whole or not at all, so that it stays when the power fails.

    Raises:
        OutputError: The file cannot be written.
    """
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            for column in columns:
                member = zipfile.ZipInfo(f"{column.name}.npy", EPOCH)
                taken = file.tell() + _LOCAL_HEADER + len(member.filename) + _ZIP64 + _PADDING
                padding = -taken % ALIGNED
                # A field of its own kind, which readers pass over.
                member.extra = b"\0\0" + padding.to_bytes(2, "little") + bytes(padding)
                with archive.open(member, "w", force_zip64=True) as stream:
                    stream.write(_header(column))
                    for block in _checked(column, path):
                        stream.write(np.ascontiguousarray(block).reshape(-1).view(np.uint8).data)
        file.flush()
        os.fsync(file.fileno())


def _checked(column: Column, path: str | Path) -> Iterator[Array]:
    """The blocks of a column; together they are of the type and the shape that stand before it."""
    rows = 0
    for block in column.blocks:
        rows += len(block) if block.ndim else 1
        if block.dtype != np.dtype(column.dtype) or block.shape[1:] != column.shape[1:]:
            raise OutputError(f"{path}: not written: {column.name} has {block.dtype}{block.shape}")
        yield block
    if rows != (column.shape[0] if column.shape else 1):
        raise OutputError(f"{path}: not written: {column.name} has {rows} rows of {column.shape}")


def _header(column: Column) -> bytes:
    """What stands before an array in a .npy file."""
    header = BytesIO()
    described = npy.dtype_to_descr(np.dtype(column.dtype))
    npy.write_array_header_1_0(
        header, {"descr": described, "fortran_order": False, "shape": column.shape}
    )
    return header.getvalue()
