"""Arrays that are memory-mapped from files: read in parts, so that only a part is in memory."""

import mmap
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)

ROWS, SCATTERED_ROWS = 2048, 256
"""Rows of a part: consecutive ones, and single ones, each of which loads whole pages."""


def in_parts(array: NDArray[Number], rows: int = ROWS) -> Iterator[NDArray[Number]]:
    """The parts of an array; the memory of each is released when the next one is read."""
    for first in range(0, len(array), rows):
        yield array[first : first + rows]
        _release(array)


def some_rows(array: NDArray[Number], chosen: NDArray[Any]) -> NDArray[Number]:
    """A copy of some rows of an array."""
    if not len(chosen):
        return array[:0].copy()
    taken = []
    for part in np.array_split(chosen, max(1, len(chosen) // SCATTERED_ROWS)):
        taken.append(array[part])
        _release(array)
    return np.concatenate(taken)


def _release(array: Any) -> None:
    """Release the memory that a mapped array occupies; its data stay in the file."""
    while isinstance(array, np.ndarray):
        if isinstance(array, np.memmap):
            mapping = getattr(array, "_mmap", None)
            if mapping is not None and hasattr(mmap, "MADV_DONTNEED"):
                mapping.madvise(mmap.MADV_DONTNEED)
            return
        array = array.base
