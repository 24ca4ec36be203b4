"""The journal of a run: its scans so far, one row after the other, so that a crash loses a moment.

The file begins with a line of JSON, the fingerprint of the run. Rows of a fixed size follow, one
for each scan: its number from 1, what the run keeps of it, and the state of the random numbers
after it. Rows are appended, and flushed every few seconds; the file is valid up to the first row
that is truncated or does not have the number of its place.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError, OutputError
from lrf3d.laser import LaserRangeFinder
from lrf3d.run import LIGHT, keep_light, light_shapes
from lrf3d.simulation import Step
from lrf3d.world import World

FLUSHED_EVERY = 2.0
"""Time between two flushes [s]: what a killed process loses at most."""

BLOCK_BYTES = 1 << 22
"""Size of the rows that are in memory at a time [bytes]."""

RNG_BYTES = 256
"""Room for the state of NumPy's default generator as JSON, which takes some 150 bytes."""

LONGEST_HEADER = 1 << 16
"""Length of the longest first line [bytes]; a file without a line end before it is no journal."""


def row_type(world: World, lrf: LaserRangeFinder) -> np.dtype[Any]:
    """The type of a row of a run in a world with a range finder."""
    beams = (lrf.beams,)
    light = [(name, np.float64, shape) for name, shape in light_shapes(world, lrf).items()]
    return np.dtype(
        [
            ("number", np.int64),
            ("times", np.float64),
            ("poses", np.float64, (3,)),
            ("ranges", np.float64, beams),
            ("truth", np.float64, beams),
            ("walls", np.int64, beams),
            *light,
            ("rng", f"S{RNG_BYTES}"),
        ]
    )


class Journal:
    """A journal, open for appending.

    Args:
        path: The file.
        fingerprint: Fingerprint of the run.
        dtype: The type of its rows.
        keep: Whether the valid rows of a journal of the same run are kept.

    Raises:
        InputError: It shall be kept, and is of another run.
    """

    def __init__(
        self, path: Path, fingerprint: dict[str, str], dtype: np.dtype[Any], *, keep: bool
    ) -> None:
        self.path, self.dtype, self.scans = path, dtype, 0
        header = json.dumps(fingerprint, sort_keys=True).encode() + b"\n"
        self._begin = len(header)
        if keep and _is_of(path, fingerprint):
            self.scans = sum(map(len, self._valid_rows()))
        else:
            path.write_bytes(header)
        self._file = path.open("r+b", buffering=BLOCK_BYTES)
        self._file.truncate(self._begin + self.scans * dtype.itemsize)
        self._file.seek(0, 2)
        self._row = np.zeros(1, dtype)
        self._light = {name: self._row[name] for name in LIGHT if name in self.columns}
        self._flushed = monotonic()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what a finished run keeps of each scan."""
        return tuple(name for name in self.dtype.names or () if name not in ("number", "rng"))

    def add(self, step: Step, rng: np.random.Generator) -> None:
        """Append a scan, and the state of the random numbers after it."""
        row = self._row
        row["number"], row["times"], row["poses"] = self.scans + 1, step.time, step.pose
        row["ranges"], row["truth"] = step.scan.ranges, step.true_scan.ranges
        row["walls"], row["rng"] = step.true_scan.walls, rng_state(rng)
        keep_light(self._light, 0, step.scan)
        self._file.write(row.tobytes())
        self.scans += 1
        if monotonic() - self._flushed > FLUSHED_EVERY:
            self._file.flush()
            self._flushed = monotonic()

    def blocks(self) -> Iterator[NDArray[Any]]:
        """The rows, some megabytes at a time.

        Raises:
            OutputError: The file no longer holds what was written to it.
        """
        self._file.flush()
        rows = 0
        for block in self._valid_rows():
            rows += len(block)
            yield block
        if rows != self.scans:
            raise OutputError(
                f"{self.path}: another program has changed it; run again, into another folder"
            )

    def kept(self) -> int:
        """The number of scans in the file."""
        return (self.path.stat().st_size - self._begin) // self.dtype.itemsize

    def close(self) -> None:
        """Close the file, with all rows in it."""
        self._file.close()

    def _valid_rows(self) -> Iterator[NDArray[Any]]:
        size, first = self.dtype.itemsize, 1
        try:
            reading = self.path.open("rb")
        except FileNotFoundError:
            return
        with reading as file:
            file.seek(self._begin)
            while data := file.read(max(1, BLOCK_BYTES // size) * size):
                rows = np.frombuffer(data[: len(data) // size * size], self.dtype)
                wrong = np.flatnonzero(rows["number"] != np.arange(first, first + len(rows)))
                yield rows[: wrong[0]] if len(wrong) else rows
                if len(wrong):
                    return
                first += len(rows)


def _is_of(path: Path, fingerprint: dict[str, str]) -> bool:
    """Whether a file is a journal of a run; false if it is none, an error if of another run."""
    try:
        with path.open("rb") as file:
            other = json.loads(file.readline(LONGEST_HEADER))
    except (FileNotFoundError, ValueError):
        return False
    if not isinstance(other, dict):
        return False
    parts = [
        name for name in sorted({*fingerprint, *other}) if fingerprint.get(name) != other.get(name)
    ]
    if parts:
        raise InputError(
            f"{path}: of another run, whose {', '.join(parts)} differ; give the same settings, or"
            " leave out --resume to begin again"
        )
    return True


def rng_state(rng: np.random.Generator) -> bytes:
    """The state of a random generator as JSON.

    Raises:
        InputError: It has another kind of state than NumPy's default generator.
    """
    try:
        state = json.dumps(rng.bit_generator.state).encode()
    except TypeError:
        state = b""
    if not 0 < len(state) <= RNG_BYTES:
        raise InputError(
            f"rng with {type(rng.bit_generator).__name__}: its state cannot be saved; use"
            " numpy.random.default_rng"
        )
    return state
