"""Recorded drives as runs: `map_log` believes the poses of a log, `slam_log` finds them.

A log, or the path of one, enters; a `Run` leaves, whose world is the map of the drive.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning, expect
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float, as_rows, usual_step
from lrf3d.geometry.pose import Pose, compose
from lrf3d.laser import doubtful_ranges
from lrf3d.mapping import LineMapper
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.recordings import LaserLog, load_log, load_run
from lrf3d.recordings.reading import odometry_of
from lrf3d.recordings.repair.odometry import (
    SURE_OF_POSES,
    Recording,
    Repairs,
    WheelPath,
    fitted_lag,
    in_order,
    line_poses,
    turns_between,
)
from lrf3d.recordings.repair.sweep import swept
from lrf3d.recordings.repair.turning import agreeing
from lrf3d.simulation.run import Run
from lrf3d.slam import Slam
from lrf3d.slam.checks import doubtful_mount, doubtful_poses
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.places.joining import joined
from lrf3d.slam.solution import SolvedLog, maps_of, run_of

# Scans at the beginning of a log that give the first estimate of its wheels' errors. With it a loop
# of 460 m, driven with wheels 15 % off, closes with a tenth of the error.
CALIBRATED = 400


@stoppable()
def map_log(
    log: LaserLog | str | Path,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    progress: Progress = silent,
) -> Run:
    """Build a map from the even scans of a log, counted from 0: the odd ones are left to test it.

    Args:
        log: The log, or its path; its poses are taken as they are.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead.
        progress: Called with the number of finished scans, and of all.

    Returns:
        The mapped scans as a run, in the walls that they show.

    Raises:
        InputError: There is no such mode, the noise is invalid, the poses are not known, or the
            scans show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres, or the laser is mounted otherwise.

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
    log = punctual(log if isinstance(log, LaserLog) else load_log(log))
    return map_scans(log, mode=mode, sigma=sigma, all_scans=all_scans, progress=progress)


def punctual(log: LaserLog) -> LaserLog:
    """A log whose scans have the poses of when they were taken, if they are stamped late.

    Their turns show that, and a note says it.
    """
    log = readable(log)
    if not log.placed:
        bad = (
            f"; {counted(log.bad_count, 'bad message')}, {log.bad_lines[0]}"
            if log.bad_lines
            else ""
        )
        raise InputError(f"{log.name}: no poses in it ({log.source}{bad}); lrf3d slam finds them")
    scans = list(log.scans)
    notes = list(log.notes)
    for laser in log.lasers:
        numbers = [number for number, scan in enumerate(scans) if scan.laser == laser]
        own = [scans[number] for number in numbers]
        places = np.arange(len(numbers))
        interval = usual_step(np.array([scan.time for scan in own]))
        path = WheelPath(np.array([scan.robot for scan in own]), interval)
        own, turns, mirrored, fan = agreeing(log, own, ScanConverter(), path, places)
        lags = fitted_lag(turns, path, places, SURE_OF_POSES)
        late = Repairs(late=path.late(lags)).sentences()
        notes += [*fan, *Repairs(mirrored=mirrored).sentences(), *late]
        for number, scan, robot in zip(numbers, own, path.at(places - lags), strict=True):
            pose = compose(robot, np.array(scan.mount))
            scans[number] = replace(scan, pose=Pose(*pose.tolist())) if late else scan
    return replace(log, scans=scans, notes=tuple(notes))


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
    # Scans of several lasers at one moment stay those of their lasers.
    joint = replace(log, scans=scans, wheels=None).of_moments()
    moments = joint.parts or [(scan,) for scan in scans]
    poses = joint.poses if joint.parts else poses
    run = run_of(log.name, moments, poses, {len(moments) - 1: list(maps.values())[-1]})
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
) -> Run:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Args:
        log: The log, or its path.
        key_distance: Distance driven from one key scan to the next [m].
        on: The run of an earlier drive, or its path, that this one continues: it is found on its
            map without a guess, and closes loops with it.
        close: Pairs of scans, by number, of which it is known that they show the same place.
        apart: Pairs of scans of which it is known that they do not.

    Returns:
        The drive as a run, in the walls that it mapped, after the one that it continues.

    Raises:
        InputError: The log is no drive that SLAM can solve, or it is not found on the map of the
            earlier one; the line says why.

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
    solved = solve_log(log, key_distance=key_distance, on=on, close=close, apart=apart)
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
    progress: Progress = silent,
) -> SolvedLog:
    """Find the poses of a recorded drive; arguments are those of `slam_log`.

    Progress is called with the number of finished scans, and of all.
    """
    expect(progress, Callable, "progress")
    known = on if on is None or isinstance(on, Run) else load_run(on)
    log, recording = followed(log)
    offset = log.odometry.laser_offset
    path = recording.path
    if path.stands:
        # Odometry that never moves counts as missing.
        log = replace(log, placed=False)
    places = recording.places
    converter = ScanConverter(offset)
    scans, turns, mirrored, fan = agreeing(log, recording.scans, converter, path, places)
    log = replace(log, notes=(*log.notes, *fan))
    for name, pairs in (("close", close), ("apart", apart)):
        none = isinstance(pairs, tuple | list) and not pairs
        for one, other in [] if none else as_rows(pairs, f"slam: {name}", 2).tolist():
            if not 0 <= one < other < len(scans):
                raise InputError(
                    f"{log.name}: {name} {one:g}:{other:g}: expected scans from 0 to"
                    f" {len(scans) - 1}, the earlier one first"
                )
    increments: Sequence[Float | None] = [None] * len(scans)
    sweep = 0.0
    if log.placed:
        lags = fitted_lag(turns, path, places)
        if not log.parts and (rolled := swept(converter, scans, path, places - lags)):
            scans = rolled
            sweep = max(scan.duration for scan in rolled)
            lags = fitted_lag(turns_between(converter, scans, path, places), path, places)
        increments = list(path.increments(places - lags))
    start = path.at(places[:1].astype(np.float64))[0]
    # The beginning is followed twice: at first the errors of the wheels are not known.
    slam = Slam(laser_offset=offset)
    first = scans[: CALIBRATED * log.placed]
    for scan, increment in zip(first, increments, strict=False):
        slam.update(scan, increment)
    passes = 0
    learned = True
    most_passes = 3  # Times that a drive is solved, at most.
    # Where the scale of distances or of turns moves by more than this share from its first
    # estimate, the beginning is misplaced: the drive is solved again. Around blocks of 400 to 640 m
    # of corridor that takes half to three quarters of the error away. Scans show turns, but hardly
    # the distance along a corridor, so that only large errors of turns matter.
    scale_change = 0.012
    turn_change = 0.15
    while learned and passes < most_passes:
        passes += 1
        wheels = slam.wheels
        slam = Slam(start=start, laser_offset=offset, key_distance=key_distance, wheels=wheels,
                    close=close, apart=apart)  # fmt: skip
        for number, (scan, increment) in enumerate(zip(scans, increments, strict=True), 1):
            slam.update(scan, increment)
            progress(number, len(scans))
            check()
        change = np.abs((1.0 + slam.wheels.biases) / (1.0 + wheels.biases) - 1.0)
        learned = change[2] > scale_change or change[0] > turn_change
    lost = sum(not scan.matched for scan in slam.tracked[1:])
    # Share of the scans that may match nothing where there is no odometry. Of those a metre apart a
    # quarter or more do, of those to be followed hardly one in a thousand.
    most_lost = 0.1
    if not log.placed and lost > most_lost * len(scans):
        raise InputError(
            f"{log.name}: {lost} of {len(scans)} scans match nothing before them, too far apart to"
            " be followed without odometry; expected scans every 0.3 m and 20°, or odometry"
        )
    slam.finish()
    poses = slam.refined(scans)
    # Now that the poses of all scans are known, all of them show the lag.
    lags = fitted_lag(np.diff(poses[:, 2]), path, places)
    both = None
    if known is not None:
        both = joined(known, slam, map(slam.converter.surface, scans), poses, log.name)
        poses = both.poses
    lines = line_poses(path, places, lags, poses)[recording.rows]
    lines[:, 2] = np.unwrap(lines[:, 2])
    jumps = recording.repairs.odometry_jumps + sum(scan.jumped for scan in slam.tracked)
    repairs = replace(
        recording.repairs, late=path.late(lags), odometry_jumps=jumps, mirrored=mirrored,
        sweep=sweep,
    )  # fmt: skip
    check_ = slam.self_check() if both is None else both.check
    lag = float(lags.mean())
    return SolvedLog(log, slam, scans, poses, lines, lag, repairs, check_, passes, both)


def readable(log: LaserLog) -> LaserLog:
    """A log whose scans share the angles where they hardly differ, refused if it is useless."""
    if not log.scans:
        raise InputError(f"{log.name}: a log without scans; expected at least one")
    stamps = np.concatenate([log.odometry.times, log.times])
    # Largest stamp [s]: larger ones are nanoseconds, of which a float cannot tell two apart.
    latest_stamp = 1e12
    if (latest := np.abs(stamps).max()) > latest_stamp:
        raise InputError(f"{log.name}: a stamp of {latest:g} s; expected seconds")
    first = log.scans[0].angles
    scans = []
    # Angles of the beams may differ by this from scan to scan [rad]: some drivers round them.
    jitter = 1e-4
    for scan in log.scans:
        own = scan.angles
        same = own.shape == first.shape and np.abs(own - first).max() <= jitter
        scans.append(replace(scan, angles=first) if same and own is not first else scan)
    return replace(log, scans=scans)


def followed(log: LaserLog | str | Path) -> tuple[LaserLog, Recording]:
    """A log, or that of a path, with one scan a moment, and these in order, to be followed."""
    if not isinstance(log, LaserLog):
        log = load_log(log, poses=odometry_of(log))
    log = readable(log)
    log = log.of_moments()
    try:
        return log, _checked(log)
    except InputError as error:
        raise InputError(f"{log.name}: {error}") from None


def _checked(log: LaserLog) -> Recording:
    """A log in order, which is refused where no SLAM can solve it."""
    scans = log.scans
    wheels = log.odometry.poses
    times = log.odometry.times
    if len(scans) < 2 or not len(wheels):
        count = f"{counted(len(scans), 'scan')} and {counted(len(wheels), 'odometry line')}"
        raise InputError(f"{count}; expected at least two scans and one line")
    first = scans[0].angles
    least_beams = 3  # Beams that a scan must have to show a wall.
    if len(first) < least_beams:
        raise InputError(f"scans of {len(first)} beams; expected at least {least_beams}")
    # With room for the rounding of drivers.
    if np.abs(first).max() > 2.1 * np.pi:
        angle = first[np.abs(first).argmax()]
        raise InputError(f"a beam at {angle:g} rad; expected angles of at most a turn")
    finite = np.isfinite(wheels).all(axis=1) & np.isfinite(times)
    if not finite.all():
        line = int(np.flatnonzero(~finite)[0])
        pose = f"odometry line {line} at {times[line]} s has the pose {wheels[line].tolist()}"
        raise InputError(f"{pose}; expected finite numbers")
    if doubt := doubtful_ranges(scans):
        raise InputError(doubt)
    recording = in_order(scans, wheels, times, np.maximum(log.odometry.places, 0))
    if len(recording.scans) < 2:
        raise InputError(f"one scan, {len(scans)} times; expected at least two")
    return recording
