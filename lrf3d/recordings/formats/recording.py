"""Recording: a simulation is written to a run.npz scan by scan, and can be resumed.

Until ``run.npz`` is complete, ``run.journal`` stands next to it: a line of JSON, the fingerprint of
the run, and a row for each scan, with its number from 1, what the run keeps of it, and the state of
the random numbers after it. Rows are appended, and flushed every few seconds; the file is valid up
to the first row that is truncated, does not have the number of its place, or has a pose that is no
number. To resume, the mapper is given the scans again, a millisecond each; the result is the same,
byte for byte, as without the interruption. Rows are mapped from the file, not held in memory.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.digest import digest, name_of
from lrf3d.base.errors import InputError, OutputError, expect
from lrf3d.base.files import as_path, check_ordinary, locked, opened, opened_own, writing
from lrf3d.base.interrupts import Progress, noting, silent, stoppable
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.laser.scan import LIGHT
from lrf3d.recordings.formats.npz import DAMAGES, read_arrays, write_npz
from lrf3d.recordings.formats.run_file import load_run, run_arrays
from lrf3d.robot import Trajectory
from lrf3d.simulation.loop import Simulation, Step
from lrf3d.simulation.recorder import Snapshots, fill_row, measured_in, row_type
from lrf3d.simulation.run import Run

# Ending of the auxiliary file that stands next to a run until it is complete.
JOURNAL = ".journal"

# Time between two flushes [s]: what a killed process loses at most.
FLUSHED_EVERY = 2.0

# Room for the state of NumPy's default generator as JSON, which takes some 150 bytes.
RNG_BYTES = 256


@stoppable()
def record(
    simulation: Simulation,
    path: str | Path,
    *,
    resume: bool = False,
    progress: Progress = silent,
) -> Run:
    """Run a simulation into a file, in constant memory and safe from crashes.

    Args:
        simulation: The simulation, at its beginning.
        path: The file; its ending is ``.npz``.
        resume: Continue an interrupted run of the same simulation into this file, if there is one;
            otherwise it is discarded.
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
    expect(simulation, Simulation, "simulation")
    expect(progress, Callable, "progress")
    path = as_path(path)
    if path.suffix != ".npz":
        raise InputError(f"{path}: expected a name that ends in .npz")
    total = simulation.total
    journal_path = path.with_suffix(JOURNAL)
    fingerprint = fingerprint_of(simulation)
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
        finished = False
        if resume and path.exists():
            with suppress(*DAMAGES, KeyError):
                finished = str(read_arrays(path)["origin"]) == fingerprint
        if not finished:
            with writing(journal_path, "make room or choose another place"):
                journal = Journal(journal_path, fingerprint, simulation, keep=resume)
                try:
                    arrays = _arrays_of(simulation, journal, progress)
                    # Columns are copied from the rows some megabytes at a time.
                    write_npz(path, arrays | {"origin": np.array(fingerprint)})
                finally:
                    journal.close()
        # A program that was stopped may have left it even beside a finished run.
        journal_path.unlink(missing_ok=True)
        return load_run(path)


def _arrays_of(
    simulation: Simulation, journal: "Journal", progress: Progress
) -> dict[str, NDArray[Any]]:
    """Simulate to the end, from the last scan of a journal on; return the arrays of the run."""
    recorded = journal.recorded(simulation)
    snapshots = Snapshots(simulation)
    for scans, pose in recorded:
        simulation.take(scans, pose)
        snapshots.keep()
    for step in simulation:
        journal.add(step)
        snapshots.keep()
        progress(simulation.done, simulation.total)
    imu = snapshots.end()
    return run_arrays(simulation, journal.rows(), snapshots.maps, imu)


def fingerprint_of(simulation: Simulation) -> str:
    """Digests of the parts of a simulation, as JSON: a run is resumed if they match."""
    world = simulation.world
    drive = simulation.drive
    path: list[Any]
    if isinstance(drive, Trajectory):
        path = [drive.times, drive.poses]
    else:
        body = drive.body and [drive.body.radius, drive.body.outline]
        path = [name_of(drive.controller), drive.start, drive.interval, body]
    bodies = [[each.outline, each.height, each.poses] for each in simulation.obstacles]
    walls = [world.segments, world.objects, world.heights, world.colours, world.name]
    parts: dict[str, Any] = {
        "world": [*walls, world.materials],
        "range finder": simulation.lasers,
        "drive": path,
        "dynamic obstacles": bodies,
        "seed": _rng_state(simulation.rng).decode(),
        "scans": simulation.scans,
        "caster": type(simulation.sensors[0].caster).__name__,
        "noise": [name_of(sensor.noise) for sensor in simulation.sensors],
        "mapper": name_of(simulation.mapper),
        "odometry and IMU": [each and name_of(each) for each in simulation.motion_sensors],
    }
    if simulation.attitude is not None:
        parts["attitude"] = simulation.attitude
    if [*simulation.clouds.sensors]:
        parts["lidars and depth cameras"] = simulation.clouds.sensors.as_dict()
    return json.dumps({name: digest(part)[:16] for name, part in parts.items()}, sort_keys=True)


class Journal:
    """A journal, open for appending; the rows of one of the same run may be kept."""

    def __init__(self, path: Path, fingerprint: str, simulation: Simulation, *, keep: bool) -> None:
        fields = row_type(simulation.world, simulation.lasers, simulation.motion_shapes)
        self.path = path
        self._rng = simulation.rng
        self.dtype: np.dtype[Any] = np.dtype(
            [("number", np.int64), *fields.descr, ("rng", f"S{RNG_BYTES}")]
        )
        header = fingerprint.encode() + b"\n"
        self._begin = len(header)
        kept = keep and _is_of(path, fingerprint)
        if not kept:
            # Closed at once, also where the disk is full.
            with opened_own(path, fresh=True) as file:
                file.write(header)
        # Size of the rows that are kept in memory until they are written [bytes].
        buffer_bytes = 1 << 22
        self._file = opened_own(path, buffering=buffer_bytes)
        self.scans = len(self._valid_rows())
        self._file.truncate(self._begin + self.scans * self.dtype.itemsize)
        self._file.seek(0, 2)
        self._row = np.zeros(1, self.dtype)
        self._fields = {name: self._row[name] for name in fields.names or ()}
        self._flushed = monotonic()

    def add(self, step: Step) -> None:
        """Append a scan, and the state of the random numbers after it."""
        fill_row(self._fields, 0, *measured_in(step))
        self._row["number"], self._row["rng"] = self.scans + 1, _rng_state(self._rng)
        self._file.write(self._row.tobytes())
        self.scans += 1
        if monotonic() - self._flushed > FLUSHED_EVERY:
            self._file.flush()
            self._flushed = monotonic()

    def rows(self) -> dict[str, NDArray[Any]]:
        """What the run keeps of all scans, mapped from the file."""
        self._file.flush()
        rows = self._valid_rows()
        if len(rows) != self.scans:
            raise OutputError(
                f"{self.path}: another program has changed it; run again, into another folder"
            )
        return {name: rows[name] for name in self._fields}

    def recorded(self, simulation: Simulation) -> Iterator[tuple[tuple[LaserScan, ...], Float]]:
        """The scans of an interrupted run; the random numbers go on after the last of them."""
        rows = self._valid_rows()
        if not len(rows):
            return
        try:
            self._rng.bit_generator.state = json.loads(rows["rng"][-1])
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            raise InputError(
                f"{self.path}: the state of the random numbers after scan {len(rows)} is"
                " damaged; leave out --resume to begin again"
            ) from None
        for row in rows:
            yield tuple(self._scans(simulation.lasers, row)), row["poses"]

    def _scans(self, lasers: Sequence[LaserRangeFinder], row: Any) -> Iterator[LaserScan]:
        begin = 0
        pose = row["poses"]
        for number, lrf in enumerate(lasers):
            beams = slice(begin, begin := begin + lrf.beams)
            ranges = row["ranges"][beams].copy()
            # The journal holds the walls of the true scan; a beam without return has none.
            walls = np.where(np.isfinite(ranges), row["walls"][beams], -1)
            light = [row[name][beams].copy() for name in LIGHT if name in self._fields]
            place = Pose(*lrf.placed(pose).tolist())
            motion = row["motions"][number].copy() if lrf.scan_duration else None
            time = float(row["times"])
            yield LaserScan.unchecked(lrf, place, ranges, walls, *light, time=time, motion=motion)

    def kept(self) -> int:
        """The number of scans in the file."""
        with suppress(OSError, ValueError):  # It may be closed.
            self._file.flush()
        return (self.path.stat().st_size - self._begin) // self.dtype.itemsize

    def close(self) -> None:
        """Close the file, with all rows in it."""
        # An error of closing would replace the one that ended the run.
        with suppress(OSError):
            self._file.close()

    def _valid_rows(self) -> NDArray[Any]:
        if not (count := self.kept()):
            return np.empty(0, self.dtype)
        rows = np.asarray(np.memmap(self.path, self.dtype, "r", self._begin, count))
        # The end of a row may be missing where the power failed.
        right = (rows["number"] == np.arange(1, count + 1)) & (rows["rng"] != b"")
        right &= np.isfinite(rows["times"]) & np.isfinite(rows["poses"]).all(axis=1)
        return rows[: count if right.all() else right.argmin()]


def _is_of(path: Path, fingerprint: str) -> bool:
    """Whether a file is a journal of a run; false if it is not, an error if of another run."""
    try:
        with opened(path) as file:
            other = dict(json.loads(file.readline(1 << 16)))
    except (ValueError, TypeError, RecursionError):
        return False
    parts = json.loads(fingerprint).items()
    if differing := [name for name, value in parts if other.get(name) != value]:
        raise InputError(
            f"{path}: of another run, whose {', '.join(differing)} differ; give the same settings,"
            " or leave out --resume to begin again"
        )
    return True


def _rng_state(rng: np.random.Generator) -> bytes:
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
