"""Arrays of a .npz file, read within bounds of memory and never unpickled.

Huge arrays that are not packed are mapped: they take memory as they are looked at, and none when
memory is short.
"""

import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lrf3d.input import check_ordinary
from lrf3d.logs.packed import LARGEST_RATIO

UNSUSPICIOUS = 1 << 28
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
        if total > max(UNSUSPICIOUS, LARGEST_RATIO * path.stat().st_size):
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
