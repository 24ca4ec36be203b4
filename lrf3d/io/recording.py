"""Recording: a simulation is written to a run.npz scan by scan, and can be resumed.

Until ``run.npz`` is complete, ``run.journal`` stands next to it: a line of JSON, the fingerprint of
the run, and a row for each scan, with its number from 1, what the run keeps of it, and the state of
the random numbers after it. Rows are appended, and flushed every few seconds; the file is valid up
to the first row that is truncated or does not have the number of its place. To resume, the mapper
is given the scans again, a millisecond each; the result is the same, byte for byte, as without the
interruption. However many scans there are, only a few megabytes of them are in memory.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.digest import digest, name_of
from lrf3d.errors import InputError, OutputError
from lrf3d.files import check_ordinary, locked
from lrf3d.interrupts import check, noting, stoppable
from lrf3d.io.npz import DAMAGES, Column, read_arrays, write_npz
from lrf3d.io.run_file import (
    estimate_columns,
    head_columns,
    load_run,
    map_columns,
    obstacle_columns,
)
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap
from lrf3d.pose import Pose
from lrf3d.progress import Progress, silent
from lrf3d.robot import Trajectory
from lrf3d.run import LIGHT, Run, SnapshotSchedule, keep_light, light_shapes
from lrf3d.simulation import Simulation, Step
from lrf3d.world.cameras import FilmPlan

JOURNAL = ".journal"
"""Ending of the auxiliary file that stands next to a run until it is complete."""

FLUSHED_EVERY = 2.0
"""Time between two flushes [s]: what a killed process loses at most."""

BLOCK_BYTES = 1 << 22
"""Size of the rows that are in memory at a time [bytes]."""

RNG_BYTES = 256
"""Room for the state of NumPy's default generator as JSON, which takes some 150 bytes."""


@stoppable()
def record(
    simulation: Simulation,
    path: str | Path,
    *,
    resume: bool = False,
    film: FilmPlan | None = None,
    progress: Progress = silent,
) -> Run:
    """Run a simulation into a file, in constant memory and safe from crashes.

    Args:
        simulation: The simulation, at its beginning.
        path: The file; its ending is ``.npz``.
        resume: Continue an interrupted run of the same simulation into this file, if there is one;
            otherwise it is discarded.
        film: How the run is filmed if nothing else is given, instead of the simulation's
            plan; it is kept beside the run.
        progress: Called with the number of scans that are done, and of all.

    Returns:
        The run, whose large arrays are mapped from the file.

    Raises:
        InputError: The number of scans is unknown, the file has another ending, the run to resume
            is a different one, or another process writes to the file.
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> simulation = lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> run = lrf3d.record(simulation, "run.npz")
        >>> len(run), len(lrf3d.load_run("run.npz"))
        (2, 2)
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"{path}: expected a name that ends in .npz")
    total, journal_path = simulation.total, path.with_suffix(JOURNAL)
    fingerprint = fingerprint_of(simulation)
    if film is not None:
        simulation.film = film
    journal: Journal | None = None

    def kept() -> str:
        # If somebody has deleted the folder, nothing is kept.
        if journal is None or not journal_path.exists():
            return ""
        return f"{journal.kept()} of {total} scans kept; go on with --resume"

    with locked(path), noting(kept):
        for name in (path, journal_path):
            # Files that cannot be replaced are found now, not after hours of work.
            if name.exists():
                check_ordinary(name, what="a file of an earlier run")
        if not (resume and _finished(path, fingerprint)):
            try:
                journal = Journal(journal_path, fingerprint, simulation, keep=resume)
                try:
                    maps = _run(simulation, journal, progress)
                    _write(simulation, journal, maps, path, fingerprint)
                finally:
                    # An error of closing would replace the one that ended the run.
                    with suppress(OSError):
                        journal.close()
            except OSError as error:
                if isinstance(error, OutputError) or error.errno is None:
                    raise
                raise OutputError(
                    f"{journal_path}: cannot be written: {error.strerror}; make room or choose"
                    " another place"
                ) from error
        # A program that was stopped may have left it even beside a finished run.
        journal_path.unlink(missing_ok=True)
        return load_run(path)


def fingerprint_of(simulation: Simulation) -> dict[str, str]:
    """A digest or a name of each part of a simulation: a resumed one knows its journal by it."""
    world, drive = simulation.world, simulation.drive
    path: list[Any]
    if isinstance(drive, Trajectory):
        path = [drive.times, drive.poses]
    else:
        path = [name_of(drive.controller), drive.start, drive.interval, drive.radius]
    bodies = [[each.outline, each.height, each.poses] for each in simulation.obstacles]
    walls = [world.segments, world.objects, world.heights, world.colours, world.name]
    parts = {
        "world": [*walls, world.materials],
        "range finder": simulation.lrf,
        "drive": path,
        "dynamic obstacles": bodies,
        "seed": _rng_state(simulation.rng).decode(),
    }
    return {
        **{name: digest(part)[:16] for name, part in parts.items()},
        "scans": str(simulation.scans),
        "caster": type(simulation.sensor.caster).__name__,
        "noise": name_of(simulation.sensor.noise),
        "mapper": name_of(simulation.mapper),
    }


class Journal:
    """A journal, open for appending; the rows of one of the same run may be kept."""

    def __init__(
        self, path: Path, fingerprint: dict[str, str], simulation: Simulation, *, keep: bool
    ) -> None:
        lrf = simulation.lrf
        light = light_shapes(simulation.world, lrf)
        self.path, self.scans = path, 0
        self.dtype: np.dtype[Any] = np.dtype(
            [
                ("number", np.int64),
                ("times", np.float64),
                ("poses", np.float64, (3,)),
                ("ranges", np.float64, (lrf.beams,)),
                ("truth", np.float64, (lrf.beams,)),
                ("walls", np.int64, (lrf.beams,)),
                *((name, np.float64, shape) for name, shape in light.items()),
                ("rng", f"S{RNG_BYTES}"),
            ]
        )
        header = json.dumps(fingerprint, sort_keys=True).encode() + b"\n"
        self._begin = len(header)
        if keep and _is_of(path, fingerprint):
            self.scans = sum(map(len, self._valid_rows()))
        else:
            path.write_bytes(header)
        self._file = path.open("r+b", buffering=BLOCK_BYTES)
        self._file.truncate(self._begin + self.scans * self.dtype.itemsize)
        self._file.seek(0, 2)
        self._row = np.zeros(1, self.dtype)
        self._light = {name: self._row[name] for name in light}
        self._flushed = monotonic()

    def add(self, step: Step, rng: np.random.Generator) -> None:
        """Append a scan, and the state of the random numbers after it."""
        row = self._row
        row["number"], row["times"], row["poses"] = self.scans + 1, step.time, step.pose
        row["ranges"], row["truth"] = step.scan.ranges, step.true_scan.ranges
        row["walls"], row["rng"] = step.true_scan.walls, _rng_state(rng)
        keep_light(self._light, 0, step.scan)
        self._file.write(row.tobytes())
        self.scans += 1
        if monotonic() - self._flushed > FLUSHED_EVERY:
            self._file.flush()
            self._flushed = monotonic()

    def blocks(self) -> Iterator[NDArray[Any]]:
        """The rows, some megabytes at a time."""
        self._file.flush()
        rows = 0
        for block in self._valid_rows():
            rows += len(block)
            yield block
        if rows != self.scans:
            raise OutputError(
                f"{self.path}: another program has changed it; run again, into another folder"
            )

    def columns(self) -> Iterator[Column]:
        """What a finished run keeps of each scan."""

        def column(name: str, kind: np.dtype[Any]) -> Column:
            blocks = (rows[name] for rows in self.blocks())
            return Column(name, (self.scans, *kind.shape), kind.base, blocks)

        kept = [name for name in self.dtype.names or () if name not in ("number", "rng")]
        return (column(name, self.dtype[name]) for name in kept)

    def kept(self) -> int:
        """The number of scans in the file."""
        return (self.path.stat().st_size - self._begin) // self.dtype.itemsize

    def close(self) -> None:
        """Close the file, with all rows in it."""
        self._file.close()

    def _valid_rows(self) -> Iterator[NDArray[Any]]:
        first, size = 1, self.dtype.itemsize
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            file.seek(self._begin)
            while len(data := file.read(max(1, BLOCK_BYTES // size) * size)) >= size:
                rows = np.frombuffer(data[: len(data) // size * size], self.dtype)
                # The end of a row may be missing where the power failed.
                right = (rows["number"] == np.arange(first, first + len(rows))) & (
                    rows["rng"] != b""
                )
                yield rows[: len(rows) if right.all() else right.argmin()]
                if not right.all():
                    return
                first += len(rows)


def _is_of(path: Path, fingerprint: dict[str, str]) -> bool:
    """Whether a file is a journal of a run; false if it is none, an error if of another run."""
    try:
        with path.open("rb") as file:
            other = dict(json.loads(file.readline(1 << 16)))
    except (FileNotFoundError, ValueError, TypeError):
        return False
    if parts := [name for name, value in fingerprint.items() if other.get(name) != value]:
        raise InputError(
            f"{path}: of another run, whose {', '.join(parts)} differ; give the same settings, or"
            " leave out --resume to begin again"
        )
    return True


def _rng_state(rng: np.random.Generator) -> bytes:
    """The state of a random generator as JSON."""
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


def _run(simulation: Simulation, journal: Journal, progress: Progress) -> dict[int, LineMap]:
    """Run a simulation to its end, from the end of its journal; returns the map snapshots."""
    schedule, maps = SnapshotSchedule(simulation.total), dict[int, LineMap]()

    def keep_map(index: int) -> None:
        if schedule.holds(index) and isinstance(line_map := simulation.map, LineMap):
            maps[index] = line_map

    rng, lrf = simulation.rng, simulation.lrf
    for rows in journal.blocks():
        for row in rows:
            ranges = row["ranges"].copy()
            # The journal holds the walls of the true scan; a beam without return has none.
            walls = np.where(np.isfinite(ranges), row["walls"], -1)
            light = [row[name].copy() for name in LIGHT if name in (rows.dtype.names or ())]
            scan = LaserScan.unchecked(lrf, Pose(*row["poses"].tolist()), ranges, walls, *light)
            simulation.take(scan.at_time(float(row["times"])))
            keep_map(simulation.done - 1)
            check()
        if len(rows):
            rng.bit_generator.state = json.loads(rows["rng"][-1])
    for step in simulation:
        journal.add(step, rng)
        keep_map(step.index)
        progress(step.index + 1, simulation.total)
        check()
    # A controller may end before all scans are done.
    last = journal.scans - 1
    if last not in maps and isinstance(line_map := simulation.map, LineMap):
        maps[last] = line_map
    return maps


def _write(
    simulation: Simulation,
    journal: Journal,
    maps: Mapping[int, LineMap],
    path: Path,
    fingerprint: Mapping[str, str],
) -> None:
    """Write the finished run, some rows of a column at a time."""
    write_npz(
        path,
        [
            *head_columns(simulation.world, simulation.lrf, simulation.film),
            *obstacle_columns(simulation.obstacles),
            *journal.columns(),
            *map_columns(maps, list(maps.values())),
            *estimate_columns(simulation.estimate),
            Column.of("origin", np.array(json.dumps(fingerprint, sort_keys=True))),
        ],
    )


def _finished(path: Path, fingerprint: Mapping[str, str]) -> bool:
    """Whether a file is the finished run."""
    if not path.exists():
        return False
    try:
        return str(read_arrays(path)["origin"]) == json.dumps(fingerprint, sort_keys=True)
    except (*DAMAGES, KeyError):
        return False
