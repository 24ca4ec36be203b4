"""Reading and writing .npz files with limited memory; nothing is ever unpickled.

Large uncompressed arrays are memory-mapped when read. Arrays are written in blocks, so that none
has to be in memory as a whole; they are stored uncompressed and aligned to 64 bytes, so that they
can be mapped. The bytes of the file depend on nothing but the arrays.
"""

import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import DTypeLike, NDArray

from lrf3d.files import check_ordinary, replacing

MAPPED = 1 << 26
"""Least size [bytes] of an array that is mapped; smaller ones are read and checked."""

MOST_PACKED = 1 << 29
"""Largest size [bytes] that the packed arrays of a file may unpack to; ours are not packed."""

_LOCAL_HEADER = 30
"""Size [bytes] of the header of a member of a zip file, without its name and its extra fields."""

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
    tokenize.TokenError,
)
"""Exceptions of reading a damaged file."""

ALIGNED = 64
"""Alignment of arrays [bytes], as in NumPy's own files."""

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time stamp of all members, the earliest of zip files, so that equal runs are equal files."""

_ZIP64, _PADDING = 20, 4
"""Sizes [bytes] of a zip member's field for large sizes, and of an empty field."""

Array = NDArray[np.generic]


def read_arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """The arrays of a .npz file by their names."""
    check_ordinary(path, what="a .npz file")
    with zipfile.ZipFile(path) as file:
        packed = [e.file_size for e in file.infolist() if e.compress_type != zipfile.ZIP_STORED]
        if sum(packed) > MOST_PACKED:
            raise ValueError(f"it unpacks to {sum(packed):,} bytes; unpack it first")
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
        # NumPy allocates the whole array before it reads any of it.
        size = prod(shape) * dtype.itemsize
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
    """Position of the data of a member in a zip file."""
    with path.open("rb") as file:
        file.seek(entry.header_offset)
        header = file.read(_LOCAL_HEADER)
    name, fields = struct.unpack("<26xHH", header)
    return entry.header_offset + _LOCAL_HEADER + int(name) + int(fields)


@dataclass(frozen=True, slots=True)
class Column:
    """An array in blocks of some rows, with its name, shape and type."""

    name: str
    shape: tuple[int, ...]
    dtype: DTypeLike
    blocks: Iterable[Array]

    @classmethod
    def of(cls, name: str, array: Array) -> "Column":
        """The column of an array in memory."""
        return cls(name, array.shape, array.dtype, [array])


def write_npz(path: str | Path, columns: Iterable[Column]) -> None:
    """Write arrays to a file, completely or not at all, and flush it to the disk."""
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            try:
                for column in columns:
                    _write_member(archive, file, column)
            except BaseException:
                # Closing an archive would complete it, which fails as well and hides the error.
                archive.fp = None
                raise
        file.flush()
        os.fsync(file.fileno())


def _write_member(archive: zipfile.ZipFile, file: IO[bytes], column: Column) -> None:
    """Write an array to an archive, aligned in its file."""
    member = zipfile.ZipInfo(f"{column.name}.npy", EPOCH)
    taken = file.tell() + _LOCAL_HEADER + len(member.filename) + _ZIP64 + _PADDING
    padding = -taken % ALIGNED
    # An extra field of an unknown kind, which readers skip.
    member.extra = b"\0\0" + padding.to_bytes(2, "little") + bytes(padding)
    described = npy.dtype_to_descr(np.dtype(column.dtype))
    header = {"descr": described, "fortran_order": False, "shape": column.shape}
    with archive.open(member, "w", force_zip64=True) as stream:
        npy.write_array_header_1_0(stream, header)
        for block in column.blocks:
            stream.write(np.ascontiguousarray(block).reshape(-1).view(np.uint8).data)
