"""A .npz file written as a stream: its arrays come in blocks, so that none is ever held whole.

Arrays lie in it as they are in memory, not packed and each at a multiple of 64 bytes, so that
huge ones can be mapped instead of read. Nothing but the arrays decides the bytes of the file.
"""

import os
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import DTypeLike, NDArray

from lrf3d.errors import OutputError
from lrf3d.output import replacing

ALIGNED = 64
"""Bytes that arrays begin at a multiple of, as NumPy's own files have it."""

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time of all members, the earliest of a zip file: equal runs are equal files at any time."""

_HEADER, _ZIP64, _PADDING = 30, 20, 4
"""Sizes [bytes] of a zip member's header, of its field for large sizes, and of an empty field."""

Array = NDArray[np.generic]


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
                taken = file.tell() + _HEADER + len(member.filename) + _ZIP64 + _PADDING
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
