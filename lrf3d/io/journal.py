"""The journal of a run: the scans so far, so that a crash loses only a moment.

The file is append-only. Its first line identifies the format; a JSON object holds the run's
fingerprint, which identifies the run. Chunks of scans follow, each after its length and a checksum,
and on the disk before the next is begun. If the file is truncated or damaged, the chunks before
that place are valid.

A chunk holds, for c scans of n beams:

==================  =======================================================================
state               JSON: the state of the random numbers after the last scan, and the map
                    snapshots among these scans with their numbers of segments
by snapshot         segments (m, 4), objects (m,), points (m,), codes of kinds (m,)
times, poses        (c,), (c, 3)
ranges, truth       (c, n) each
walls               (c, n)
intensities         (c, n), in worlds with materials; echoes (c, n, e) and echo_intensities
                    (c, n, e), if the range finder reports several echoes
==================  =======================================================================
"""

import hashlib
import json
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from types import FunctionType
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError, OutputError
from lrf3d.laser import LaserRangeFinder
from lrf3d.laser.noise import DeterministicNoise
from lrf3d.mapping import LineMap
from lrf3d.run import light_shapes
from lrf3d.steering import ControlledDrive, RecordedDrive
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.simulation import Simulation


MAGIC = b"lrf3d journal 3\n"

_LENGTH = struct.Struct("<QI")
"""Length and checksum [zlib.crc32] of what follows."""

_COUNTS = struct.Struct("<QQQ")
"""First scan, number of scans, and length of the state [bytes] of a chunk."""

Array = NDArray[Any]

Columns = dict[str, tuple[type[Any], tuple[int, ...]]]
"""The columns of a chunk, in their order, with their types and their shapes for one scan."""


def columns_of(world: World, lrf: LaserRangeFinder) -> Columns:
    """The columns of a run in a world with a range finder."""
    beams = (lrf.beams,)
    return {
        "times": (np.float64, ()),
        "poses": (np.float64, (3,)),
        "ranges": (np.float64, beams),
        "truth": (np.float64, beams),
        "walls": (np.int64, beams),
        **{name: (np.float64, shape) for name, shape in light_shapes(world, lrf).items()},
    }


@dataclass(frozen=True, slots=True)
class Chunk:
    """Where a whole chunk of a journal lies.

    Args:
        first: Its first scan.
        scans: Its number of scans.
        begin: Where its columns begin in the file.
        end: Where it ends.
        sums: The checksum of each column, in their order.
        rng: State of the random numbers after its last scan.
        snapshots: The map snapshots among its scans, by the scan after which each was kept.
    """

    first: int
    scans: int
    begin: int
    end: int
    sums: tuple[int, ...]
    rng: dict[str, Any]
    snapshots: dict[int, LineMap]


class Journal:
    """A journal, open for appending.

    Args:
        path: The file.
        fingerprint: Fingerprint of the run; a journal of another run is replaced.
        columns: What is kept of each scan.
        keep: Whether the valid chunks of a journal of the same run are kept.
    """

    def __init__(
        self, path: Path, fingerprint: dict[str, str], columns: Columns, *, keep: bool
    ) -> None:
        self.path, self.columns = path, columns
        self.chunks: list[Chunk] = []
        # The finished run holds the same text, which must not depend on the order.
        header = json.dumps(fingerprint, sort_keys=True).encode()
        mode = "r+b" if keep and path.exists() else "w+b"
        self._file: IO[bytes] = path.open(mode)
        begin = MAGIC + _LENGTH.pack(len(header), zlib.crc32(header)) + header
        self._begin = len(begin)
        if mode == "r+b" and read_fingerprint(self._file) == fingerprint:
            self._begin = self._file.tell()
            self._read_chunks()
        else:
            self._file.seek(0)
            self._file.write(begin)
        self._file.seek(self._end)
        self._file.truncate()
        self._sync()

    @property
    def scans(self) -> int:
        """Number of scans."""
        return self.chunks[-1].first + self.chunks[-1].scans if self.chunks else 0

    @property
    def _end(self) -> int:
        """End of the last valid chunk."""
        return self.chunks[-1].end if self.chunks else self._begin

    def add(
        self, columns: dict[str, Array], rng: dict[str, Any], snapshots: dict[int, LineMap]
    ) -> None:
        """Append a chunk of scans; when this returns, it is on the disk."""
        sizes = {scan: len(line_map) for scan, line_map in snapshots.items()}
        state = json.dumps({"rng": rng, "snapshots": sizes}).encode()
        first, scans = self.scans, len(columns["times"])
        parts = [_COUNTS.pack(first, scans, len(state)), state]
        for line_map in snapshots.values():
            parts += [_bytes(line_map.segments), _bytes(line_map.objects)]
            parts += [_bytes(line_map.points), _bytes(line_map.codes)]
        before = sum(map(len, parts))
        rows = [_bytes(columns[name]) for name in self.columns]
        parts += rows
        checksum = 0
        for part in parts:
            checksum = zlib.crc32(part, checksum)
        # A chunk that an interrupt left incomplete is overwritten.
        place, size = self._file.seek(self._end), sum(map(len, parts))
        self._file.write(_LENGTH.pack(size, checksum))
        for part in parts:
            self._file.write(part)
        self._sync()
        begin = place + _LENGTH.size + before
        end = place + _LENGTH.size + size
        sums = tuple(map(zlib.crc32, rows))
        self.chunks.append(Chunk(first, scans, begin, end, sums, rng, dict(snapshots)))

    def column(self, name: str) -> Iterator[Array]:
        """A column, chunk by chunk.

        Raises:
            OutputError: The file no longer holds what was written to it.
        """
        place = list(self.columns).index(name)
        dtype, part = self.columns[name]
        # A separate handle, so that reading does not move the position for writing.
        try:
            reading = self.path.open("rb")
        except FileNotFoundError:
            raise self._changed() from None
        with reading as file:
            for chunk in self.chunks:
                sizes = self._sizes(chunk.scans)
                file.seek(chunk.begin + sum(sizes[:place]))
                data = file.read(sizes[place])
                if zlib.crc32(data) != chunk.sums[place]:
                    raise self._changed()
                yield np.frombuffer(data, dtype).reshape(chunk.scans, *part)

    def _sizes(self, scans: int) -> list[int]:
        """The sizes of the columns of some scans [bytes]."""
        return [
            int(np.prod((scans, *part))) * np.dtype(dtype).itemsize
            for dtype, part in self.columns.values()
        ]

    def _changed(self) -> OutputError:
        return OutputError(
            f"{self.path}: another program has changed it; run again, into a folder of its own"
        )

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read_chunks(self) -> None:
        """Find the valid chunks."""
        while (chunk := self._read_chunk(self._end)) is not None:
            self.chunks.append(chunk)

    def _read_chunk(self, place: int) -> Chunk | None:
        """The chunk at a position in the file, or None if it is not valid."""
        payload = read_checked(self._file)
        if payload is None or len(payload) < _COUNTS.size:
            return None
        first, scans, length = _COUNTS.unpack_from(payload)
        at = _COUNTS.size + length
        state = json.loads(payload[_COUNTS.size : at])
        snapshots = {}
        for scan, size in state["snapshots"].items():
            segments = np.frombuffer(payload, np.float64, 4 * size, at).reshape(size, 4)
            objects = np.frombuffer(payload, np.int64, size, at + 32 * size)
            points = np.frombuffer(payload, np.int64, size, at + 40 * size)
            # Copies, so that a map does not keep the whole chunk in memory.
            codes = np.frombuffer(payload, np.int64, size, at + 48 * size)
            snapshots[int(scan)] = LineMap.of_codes(
                segments.copy(), objects.copy(), points.copy(), codes
            )
            at += 56 * size
        bounds = list(accumulate(self._sizes(scans), initial=at))
        if first != self.scans or bounds[-1] != len(payload):
            return None
        sums = tuple(zlib.crc32(payload[begin:end]) for begin, end in pairwise(bounds))
        begin, end = place + _LENGTH.size + at, place + _LENGTH.size + len(payload)
        return Chunk(first, scans, begin, end, sums, state["rng"], snapshots)


def read_fingerprint(file: IO[bytes]) -> dict[str, str] | None:
    """The fingerprint in a journal; None if the file is not a journal."""
    if file.read(len(MAGIC)) != MAGIC:
        return None
    header = read_checked(file)
    return None if header is None else dict(json.loads(header))


def read_checked(file: IO[bytes]) -> bytes | None:
    """The next record, or None if it is truncated or its checksum is wrong."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    length, checksum = _LENGTH.unpack(head)
    if length > os.fstat(file.fileno()).st_size:
        return None
    payload = file.read(length)
    return payload if len(payload) == length and zlib.crc32(payload) == checksum else None


def _bytes(array: Array) -> bytes:
    return np.ascontiguousarray(array).tobytes()


def fingerprint_of(simulation: "Simulation") -> dict[str, str]:
    """The fingerprint of a simulation: a digest or a name of each part."""
    world, drive = simulation.world, simulation.drive
    if isinstance(drive, RecordedDrive):
        drive_parts: list[Any] = [drive.trajectory.times, drive.trajectory.poses]
    else:
        assert isinstance(drive, ControlledDrive)
        drive_parts = [_name_of(drive.controller), drive.start, drive.interval, drive.radius]
    obstacles = [
        part
        for obstacle in simulation.obstacles
        for part in (obstacle.outline, obstacle.height, obstacle.poses.times, obstacle.poses.poses)
    ]
    return {
        "world": _digest(
            world.segments,
            world.objects,
            world.heights,
            world.colours,
            world.name,
            *world.materials,
        ),
        "range finder": _digest(simulation.lrf, *_light_of(simulation.lrf)),
        "drive": _digest(*drive_parts),
        "scans": str(simulation.scans),
        "dynamic obstacles": _digest(*obstacles),
        "caster": type(simulation.sensor.caster).__name__,
        "noise": _name_of(simulation.sensor.noise),
        "mapper": _name_of(simulation.mapper),
        "seed": _digest(json.dumps(_plain(simulation.rng), sort_keys=True)),
    }


def _light_of(lrf: LaserRangeFinder) -> tuple[Any, ...]:
    """What a range finder makes of the light, where that is not the default."""
    return () if lrf.light == LaserRangeFinder().light else lrf.light


def _plain(rng: np.random.Generator) -> dict[str, Any]:
    """The state of a random generator in JSON's types.

    Raises:
        InputError: JSON cannot represent it.
    """
    state = dict(rng.bit_generator.state)
    try:
        json.dumps(state)
    except TypeError:
        kind = type(rng.bit_generator).__name__
        raise InputError(
            f"rng with {kind}: its state cannot be saved; use numpy.random.default_rng"
        ) from None
    return state


def _name_of(part: Any) -> str:
    """The repr of a part, or its class if the repr contains only its address."""
    while isinstance(part, DeterministicNoise):
        part = part.change
    # A guarded plug-in counts as the plug-in.
    part = getattr(part, "__wrapped__", part)
    if isinstance(part, type | FunctionType):
        return f"{part.__module__}:{part.__qualname__}"
    text = repr(part)
    kind = f"{type(part).__module__}:{type(part).__qualname__}"
    return kind if " at 0x" in text else f"{kind} {text}"


def _digest(*parts: Any) -> str:
    digest = hashlib.sha256()
    for part in parts:
        array = isinstance(part, np.ndarray)
        said = part.tobytes() if array else repr(part).encode()
        digest.update(len(said).to_bytes(8, "little") + said)
    return digest.hexdigest()[:16]
