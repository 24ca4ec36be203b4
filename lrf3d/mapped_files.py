"""Arrays that are mapped from files: looked at in parts, so that no more of them is in memory."""

import mmap
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)

ROWS = 2048
"""Rows of an array that are looked at together."""


def in_parts(array: NDArray[Number], rows: int = ROWS) -> Iterator[NDArray[Number]]:
    """An array as some rows after the others; each is given back when the next is asked for."""
    for first in range(0, len(array), rows):
        yield array[first : first + rows]
        _release(array)


def some_rows(array: NDArray[Number], chosen: NDArray[Any]) -> NDArray[Number]:
    """Some rows of an array, copied."""
    if not len(chosen):
        return array[:0].copy()
    taken = []
    for part in np.array_split(chosen, max(1, len(chosen) // 256)):
        taken.append(array[part])
        _release(array)
    return np.concatenate(taken)


def _release(array: Any) -> None:
    """Give back the memory that looking at a mapped array took; the file still has it."""
    while isinstance(array, np.ndarray):
        if isinstance(array, np.memmap):
            mapping = getattr(array, "_mmap", None)
            if mapping is not None and hasattr(mmap, "MADV_DONTNEED"):
                mapping.madvise(mmap.MADV_DONTNEED)
            return
        array = array.base
