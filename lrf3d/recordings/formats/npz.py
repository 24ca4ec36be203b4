"""Arrays in .npz files, of runs and others: large ones are memory-mapped, none is unpickled."""

import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from math import prod
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lrf3d.base.files import check_ordinary, replacing

# Least size [bytes] of an array that is memory-mapped; smaller ones are read, with checksums.
MAPPED = 1 << 26

# Largest size [bytes] to which packed arrays may unpack; lrf3d writes unpacked ones.
MOST_PACKED = 1 << 29

# Size [bytes] of the header of a member of a zip file, without its name and its extra fields.
_LOCAL_HEADER = 30

# Alignment of arrays [bytes], as in NumPy's own files.
_ALIGNED = 64

# The time stamp of all members, the earliest of zip files, so that equal runs are equal files.
_EPOCH = (1980, 1, 1, 0, 0, 0)

# Sizes [bytes] of a zip member's field for large sizes, and of an empty field.
_FIELDS = 20 + 4

# Exceptions that reading a damaged file raises.
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
        with path.open("rb") as whole:
            whole.seek(entry.header_offset)
            name, extra = struct.unpack("<26xHH", whole.read(_LOCAL_HEADER))
        begin += entry.header_offset + _LOCAL_HEADER + name + extra
        return np.asarray(np.memmap(path, dtype, "r", begin, shape))
    with file.open(entry) as stream:
        return npy.read_array(stream, allow_pickle=False)


def write_npz(path: str | Path, arrays: Mapping[str, Array]) -> None:
    """Write arrays to a file, completely or not at all, and flush it to the disk."""
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            try:
                for name, array in arrays.items():
                    _write_member(archive, file.tell(), name, array)
            except BaseException:
                # Closing the archive would finish it, which also fails and would hide the error.
                archive.fp = None
                raise
        file.flush()
        os.fsync(file.fileno())


def _write_member(archive: zipfile.ZipFile, begin: int, name: str, array: Array) -> None:
    """Write an array to an archive, from this byte of its file on."""
    member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
    header = _LOCAL_HEADER + len(member.filename) + _FIELDS
    padding = -(begin + header) % _ALIGNED
    # An extra field of an unknown kind, which readers skip.
    member.extra = b"\0\0" + padding.to_bytes(2, "little") + bytes(padding)
    with archive.open(member, "w", force_zip64=True) as stream:
        # NumPy writes some megabytes at a time, of rows in a mapped file too.
        npy.write_array(stream, array, version=(1, 0), allow_pickle=False)
