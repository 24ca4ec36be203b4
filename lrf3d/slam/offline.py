"""Recorded drives as runs: `map_log` uses the logged poses; `slam_log` estimates them.

A log, or the path of one, enters; a `Run` leaves, whose world is the map of the drive.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, expect
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.geometry.lines import as_rows
from lrf3d.geometry.pose import between, compose
from lrf3d.laser import doubtful_ranges
from lrf3d.mapping import LineMapper
from lrf3d.recordings import LaserLog, load_log, load_run
from lrf3d.recordings.reading import odometry_of
from lrf3d.recordings.repair.jumps import with_more_jumps
from lrf3d.recordings.repair.lag import fitted_again
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.repairs import SOLVING, repair, repaired_log
from lrf3d.simulation.run import Run
from lrf3d.slam import Slam
from lrf3d.slam.checks import doubtful_mount, doubtful_poses
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.motion import Wheels
from lrf3d.slam.places.joining import joined
from lrf3d.slam.slam import Tracker
from lrf3d.slam.solution import LiftedParts, SolvedLog, maps_of, nothing_in_common, run_of

# Scans at the beginning of a log that give the first estimate of its wheels' errors. With it a loop
# of 460 m, driven with wheels 15 % off, closes with a tenth of the error.
CALIBRATED = 400

# Largest change of the scale of distances during a pass. After a larger one the beginning was
# placed by a wrong scale, and the drive is solved again: around blocks of 400 to 640 m of corridor
# that removes half to three quarters of the error.
DISTANCE_CHANGE = 0.012

# The same of the scale of turns. Scans show turns, but hardly the distance along a corridor, so
# that only a large change matters here.
TURN_CHANGE = 0.15

# Number of times that a drive is solved, at most.
MOST_PASSES = 3

# Largest share of the scans that may match nothing where there is no odometry. Of scans a metre
# apart a quarter or more match nothing; of scans that are near enough, hardly one in a thousand.
MOST_LOST = 0.1


@stoppable()
def map_log(
    log: LaserLog | str | Path,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    without_repairs: Sequence[str] = (),
    progress: Progress = silent,
) -> Run:
    """Build a map from the even scans of a log, counted from 0: the odd ones are left to test it.

    Args:
        log: The log, or its path; its poses are taken as they are.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead.
        without_repairs: Names of the `REPAIRS` of logs that are left out. ``no_return`` is made as
            a log is read: for a log that is already read, leave it out in `load_log`.
        progress: Called with the number of finished scans, and of all.

    Returns:
        The mapped scans as a run, whose world is the map.

    Raises:
        InputError: There is no such mode, the noise is invalid, the poses are not known, or the
            scans show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres, or the scans contradict the poses or the
            mount of the laser.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.scoring import score_log
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> mapped = lrf3d.map_log("drive.log")
        >>> odd = lrf3d.load_log("drive.log").scans[1::2]
        >>> len(mapped), score_log(mapped.map, odd).explained > 0.9
        (5, True)
    """
    expect(progress, Callable, "progress")
    log = repaired_log(read(log, "auto", without_repairs), without_repairs)
    return map_scans(log, mode=mode, sigma=sigma, all_scans=all_scans, progress=progress)


@stoppable()
def map_scans(
    log: LaserLog, *, mode: str, sigma: float | None, all_scans: bool, progress: Progress
) -> Run:
    """Build a map from a log whose poses are known; arguments are those of `map_log`."""
    chosen = np.flatnonzero(~log.is_odd | all_scans)
    mapper = LineMapper(mode, sigma=sigma)
    scans = [log.scans[k] for k in chosen]
    poses = log.poses[chosen]
    maps = maps_of(scans, poses, range(len(scans)), mapper, snapshots=1, progress=progress)
    # The run keeps the scans of several lasers at one moment apart, each with its laser.
    joint = replace(log, scans=scans, wheels=None).of_moments()
    moments = joint.parts or [(scan,) for scan in scans]
    poses = joint.poses if joint.parts else poses
    last = {len(moments) - 1: list(maps.values())[-1]}
    run = run_of(log.name, moments, poses, last, path=log.path)
    mount = doubtful_mount(log.scans)
    for doubt in (doubtful_ranges(log.scans), mount or doubtful_poses(log.scans)):
        if doubt:
            warnings.warn(f"map: {log.name}: {doubt}", Lrf3dWarning, stacklevel=2)
    return run


@stoppable()
def slam_log(
    log: LaserLog | str | Path,
    *,
    key_distance: float = KEY_DISTANCE,
    on: Run | str | Path | None = None,
    close: Sequence[tuple[int, int]] = (),
    apart: Sequence[tuple[int, int]] = (),
    without_repairs: Sequence[str] = (),
) -> Run:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Args:
        log: The log, or its path.
        key_distance: Distance driven from one key scan to the next [m].
        on: The run of an earlier drive, or its path. The new drive is located on its map without
            an initial guess, and closes loops with it.
        close: Pairs of scans, by number, of which it is known that they show the same place.
        apart: Pairs of scans of which it is known that they do not.
        without_repairs: Names of the `REPAIRS` of logs that are left out, as for `map_log`.

    Returns:
        The drive as a run, whose world is the map; after an earlier drive, both as one run.

    Raises:
        InputError: SLAM cannot solve the log, or cannot locate it on the map of the earlier drive;
            the message says why.

    Warns:
        Lrf3dWarning: Scans contradict each other, so that the map or a part of it is wrong.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> lrf3d.slam_log("drive.log").trajectory.poses[-1, :2].round(1).tolist()
        [1.9, 1.0]
    """
    solved = solve_log(
        log, key_distance=key_distance, on=on, close=close, apart=apart,
        without_repairs=without_repairs,
    )  # fmt: skip
    for sentence in solved.warnings:
        warnings.warn(f"slam: {solved.log.name}: {sentence}", Lrf3dWarning, stacklevel=2)
    return solved.run


def solve_log(
    log: LaserLog | str | Path,
    *,
    key_distance: float = KEY_DISTANCE,
    on: Run | str | Path | None = None,
    close: Sequence[tuple[int, int]] = (),
    apart: Sequence[tuple[int, int]] = (),
    without_repairs: Sequence[str] = (),
    progress: Progress = silent,
) -> SolvedLog:
    """Find the poses of a recorded drive; arguments are those of `slam_log`.

    Progress is called with the number of finished scans, and of all.
    """
    expect(progress, Callable, "progress")
    known = on if on is None or isinstance(on, Run) else load_run(on)
    log = read(log, "odometry", without_repairs)
    [recording] = repair(log, SOLVING, without_repairs)
    offset = recording.log.odometry.laser_offset
    for name, pairs in (("close", close), ("apart", apart)):
        _check_pairs(name, pairs, recording)
    start = recording.path.at(recording.poses_before[:1])[0]

    new_slam = partial(Slam, start=start, laser_offset=offset, key_distance=key_distance)

    def slam_of(first: int, end: int) -> Callable[..., Slam]:
        near, far = (_within(pairs, first, end) for pairs in (close, apart))
        return partial(new_slam, close=near, apart=far)

    solved = _solution(recording, known, slam_of(0, len(recording.scans)), progress)
    parts = pairwise([0, *solved.lifted, len(recording.scans)])
    own = [pair for part in parts for pair in _within([*close, *apart], *part)]
    # A pair of scans before and after a lift ties its parts together.
    if not solved.lifted or len(own) < len(close) + len(apart):
        return solved
    return _in_parts(solved, recording, known, slam_of, progress)


def _solution(
    recording: Recording, known: Run | None, new_slam: Callable[..., Slam], progress: Progress
) -> SolvedLog:
    """Solve a drive, and join it with the run of an earlier one if that is known."""
    slam, passes = _solved(recording, new_slam, _calibrated(recording), progress)
    slam.finish()
    poses = slam.refined(recording.scans)
    # The lag is fitted again: now the turns between all scans are known, not just between some.
    recording = fitted_again(recording, np.diff(poses[:, 2]))
    doubted = [number for number, scan in enumerate(slam.tracked) if scan.jumped]
    recording = with_more_jumps(recording, poses, doubted)
    both = None
    if known is not None:
        surfaces = map(slam.converter.surface, recording.scans)
        both = joined(known, slam, surfaces, poses, recording.log.name)
    return SolvedLog(recording, slam, poses if both is None else both.poses, passes, both)


def _in_parts(
    whole: SolvedLog,
    recording: Recording,
    known: Run | None,
    slam_of: Callable[[int, int], Callable[..., Slam]],
    progress: Progress,
) -> SolvedLog:
    """Solve each part of a drive whose robot was lifted, and place it on the map of the others.

    The first part is the map on which the others are located, unless it is far shorter.
    """
    bounds = list(pairwise([0, *whole.lifted, len(whole.scans)]))
    enough = 0.5 * max(end - first for first, end in bounds)
    bounds.sort(key=lambda each: each[1] - each[0] < enough)
    words = list(map(nothing_in_common, whole.lifted))
    try:
        part = recording.part(range(*bounds[0]))
        solved = _solution(part, known, slam_of(*bounds[0]), progress)
    except InputError:
        # The whole drive is on the earlier map, or can be solved, but not its first part.
        return whole
    slams = [solved.slam]
    chosen = [*range(*bounds[0])]
    for first, end in bounds[1:]:
        part = recording.part(range(first, end))
        scans = f"scans {first} to {end - 1}"
        try:
            solved = _solution(part, solved.run, slam_of(first, end), progress)
        except InputError:
            words.append(f"{scans} are left out: they are nowhere on the map of the others")
            continue
        assert solved.joined is not None
        odds = f"probability {solved.joined.probability:.4f}"
        words.append(f"{scans} were placed on the map of the others, {odds}")
        slams.append(solved.slam)
        chosen += range(first, end)
    poses = solved.run.trajectory.poses[-len(chosen) :]
    robots = compose(poses, between(np.array(solved.mount), np.zeros(3)))
    rows = np.argsort(chosen)
    # An odometry line belongs to the scan that follows it.
    scans_after = np.searchsorted(recording.poses_before, recording.rows)
    placed = np.isin(np.minimum(scans_after, len(whole.scans) - 1), chosen)
    recording = whole.recording.part(sorted(chosen))
    return replace(solved, parts=LiftedParts(recording, robots[rows], words, placed, slams))


def read(log: LaserLog | str | Path, poses: str, without_repairs: Sequence[str]) -> LaserLog:
    """Return a log as it is; load one by path, with the best poses (``auto``) or ``odometry``."""
    if isinstance(log, LaserLog):
        return log
    source = odometry_of(log) if poses == "odometry" else poses
    return load_log(log, poses=source, without_repairs=without_repairs)


def _within(pairs: Sequence[tuple[int, int]], first: int, end: int) -> list[tuple[int, int]]:
    """The pairs of scans within a part of a drive, counted from its first scan."""
    return [(a - first, b - first) for a, b in pairs if first <= a and b < end]


def _check_pairs(name: str, pairs: Any, recording: Recording) -> None:
    """Check the pairs of scans, by number, that the user declares to be close or apart."""
    none = isinstance(pairs, tuple | list) and not pairs
    last = len(recording.scans) - 1
    for one, other in [] if none else as_rows(pairs, f"slam: {name}", 2).tolist():
        if not 0 <= one < other <= last:
            raise InputError(
                f"{recording.log.name}: {name} {one:g}:{other:g}: expected scans from 0 to {last},"
                " the earlier one first"
            )


def _calibrated(recording: Recording) -> Wheels:
    """The errors of the wheels, from tracking the beginning once before the drive is solved."""
    tracker = Tracker(laser_offset=recording.log.odometry.laser_offset)
    # Without odometry there are no wheels to calibrate.
    first = recording.scans[: CALIBRATED * recording.log.placed]
    for scan, increment in zip(first, recording.increments, strict=False):
        tracker.track(scan, increment)
    return tracker.front.wheels


def _solved(
    recording: Recording, new_slam: Callable[..., Slam], wheels: Wheels, progress: Progress
) -> tuple[Slam, int]:
    """Track a drive, again as long as its wheels' errors differ from those that a pass began with.

    Returns:
        The `Slam` of the last pass, and the number of passes.
    """
    scans = recording.scans
    passes = 0
    learned = True
    while learned and passes < MOST_PASSES:
        passes += 1
        slam = new_slam(wheels=wheels)
        for number, scan in enumerate(zip(scans, recording.increments, strict=True), 1):
            slam.update(*scan)
            progress(number, len(scans))
            check()
        turn, _, distance = np.abs((1.0 + slam.wheels.biases) / (1.0 + wheels.biases) - 1.0)
        learned = bool(turn > TURN_CHANGE or distance > DISTANCE_CHANGE)
        wheels = slam.wheels
    lost = sum(not scan.matched for scan in slam.tracked[1:])
    if not recording.log.placed and lost > MOST_LOST * len(scans):
        raise InputError(
            f"{recording.log.name}: {lost} of {len(scans)} scans match nothing before them, too far"
            " apart to be followed without odometry; expected scans every 0.3 m and 20°, or"
            " odometry"
        )
    return slam, passes
