"""How often is a warning of a recording false, and how often is one missing?

Recordings that are right, as they are and with fewer scans or beams, are solved, and mapped by the
poses that were found: any warning is a false alarm. The same recordings are made wrong on purpose,
each in one way: the words that name the fault, or a repair of it, must appear.
"""

import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

import lrf3d
from benchmarks.report import Report
from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Float, usual_step
from lrf3d.geometry.pose import Pose, between, compose
from lrf3d.laser import LaserScan
from lrf3d.recordings.degrade import degrade_log
from lrf3d.recordings.log import LaserLog, WheelRecord
from lrf3d.recordings.reading import odometry_of
from lrf3d.recordings.repair.repairs import SOLVING, repair
from lrf3d.slam.checks import doubtful_mount
from lrf3d.slam.offline import solve_log
from lrf3d.slam.solution import rising

# Words of each kind of warning or repair.
KINDS = {
    "the mount of the laser": ("laser's mount", "not the laser's"),
    "poses that contradict the scans": (
        "contradict the scans",
        "poses jump",
        "stay at one place",
        "not those of its robot",
    ),
    "a laser that turns clockwise": ("clockwise", "mirrored"),
    "stamps that are late or early": ("are stamped",),
    "jumps of the odometry": ("jump",),
    "the robot itself in view": ("robot itself",),
    "walls that bend in turns": ("bend in turns", "unlike the declared", "contradict the declared"),
    "another fan of beams": ("as the scans turn",),
    "another unit": ("metres", "degrees", "expected ranges"),
    "a robot that was lifted": ("lifted",),
    "a map that contradicts itself": ("contradicts itself", "poses are wrong", "may be wrong"),
    "an uncertain position": ("is known to", "bare walls"),
}


@dataclass(frozen=True)
class Fault:
    """A way to make a recording wrong, and the kinds of which one must be reported."""

    name: str
    make: Callable[[LaserLog], LaserLog]
    kinds: tuple[str, ...]
    how: str = "slam"


def changed(log: LaserLog, change: Callable[[int, LaserScan], LaserScan]) -> LaserLog:
    """A log with changed scans."""
    return replace(log, scans=[change(number, scan) for number, scan in enumerate(log.scans)])


def driven(log: LaserLog, change: Callable[[Float], Float]) -> LaserLog:
    """A log whose robot was elsewhere: poses (k, 3) of its odometry at the scans are changed."""
    robots = np.array([scan.robot for scan in log.scans])
    if log.wheels is not None:
        robots = log.wheels.poses[np.maximum(log.wheels.places, 0)]
    poses = change(robots)
    wheels = WheelRecord(log.times, poses, np.arange(len(log)), log.odometry.laser_offset)
    return replace(changed(log, lambda k, scan: replace(scan, pose=Pose(*poses[k]))), wheels=wheels)


def turned(poses: Float) -> Float:
    """The poses of a robot whose laser is turned by 40°."""
    return compose(poses, np.array([0.0, 0.0, np.radians(40.0)]))


def leaping(poses: Float) -> Float:
    """Poses that leap by 4 m in their middle."""
    ahead = np.arange(len(poses)) >= len(poses) // 2
    return np.asarray(poses + ahead[:, None] * np.array([4.0, 0.0, 0.0]))


def of_another(poses: Float) -> Float:
    """The poses of a robot that drives the other way round, from end to begin."""
    return np.asarray(poses[::-1])


def late(log: LaserLog) -> LaserLog:
    """A log whose scans are stamped late by 0.3 s: they were taken at earlier poses."""
    line = log.odometry
    times = rising(line.times)
    before = [np.interp(log.times + 0.3, times, each) for each in np.unwrap(line.poses, axis=0).T]
    return driven(log, lambda _: np.column_stack(before))


def swept(log: LaserLog) -> LaserLog:
    """A log that says that each scan takes all the time to the next one."""
    robots = np.array([scan.robot for scan in log.scans])
    steps = between(robots[:-1], robots[1:])
    apart = usual_step(log.times)

    def declared(number: int, scan: LaserScan) -> LaserScan:
        motion = steps[min(number, len(steps) - 1)]
        increment = apart / (len(scan.ranges) - 1)
        return replace(scan, ranges=scan.ranges, motion=motion, time_increment=increment)

    return changed(log, declared)


def in_millimetres(number: int, scan: LaserScan) -> LaserScan:
    """A scan of readings in millimetres that are taken for metres."""
    return replace(scan, ranges=1000.0 * scan.ranges, range_min=0.0, range_max=np.inf)


def mirrored(number: int, scan: LaserScan) -> LaserScan:
    """A scan with its beams in the opposite order."""
    return replace(scan, ranges=scan.ranges[::-1])


def with_post(number: int, scan: LaserScan) -> LaserScan:
    """A scan of a robot that sees a post of its own."""
    ranges = scan.ranges.copy()
    first = len(ranges) // 4
    ranges[first : first + max(len(ranges) // 60, 2)] = 0.3
    return replace(scan, ranges=ranges)


def lifted(log: LaserLog) -> LaserLog:
    """A log whose robot was carried from a third to two thirds of its way, by its odometry not."""
    third = len(log) // 3
    kept = [*range(third), *range(2 * third, len(log))]

    def joined(poses: Float) -> Float:
        steps = between(poses[:-1], poses[1:])
        steps[third - 1] = 0.0
        there = [poses[0]]
        for step in steps:
            there.append(compose(there[-1], step))
        return np.array(there)

    wheels = log.wheels and replace(log.wheels, places=log.wheels.places[kept])
    return driven(replace(log, scans=[log.scans[k] for k in kept], wheels=wheels), joined)


FAULTS = [
    Fault("the laser turned by 40°", lambda log: driven(log, turned), ("the mount of the laser",)),
    Fault("beams in the opposite order", lambda log: changed(log, mirrored),
          ("a laser that turns clockwise",)),
    Fault("poses of another drive", lambda log: driven(log, of_another),
          ("poses that contradict the scans", "another unit", "a laser that turns clockwise"),
          how="map"),
    Fault("stamps late by 0.3 s", late, ("stamps that are late or early",)),
    Fault("scans that take no time as declared", swept, ("walls that bend in turns",)),
    Fault("ranges in millimetres", lambda log: changed(log, in_millimetres), ("another unit",)),
    Fault("odometry that leaps by 4 m", lambda log: driven(log, leaping),
          ("jumps of the odometry",)),
    Fault("a post of the robot", lambda log: changed(log, with_post),
          ("the robot itself in view",)),
    Fault("lifted and put down", lifted,
          ("a robot that was lifted", "a map that contradicts itself", "an uncertain position")),
]  # fmt: skip

RIGHT: dict[str, Callable[[LaserLog], LaserLog]] = {
    "as it is": lambda log: log,
    "every second scan": lambda log: degrade_log(log, every=2),
    "every second beam": lambda log: degrade_log(log, beams_every=2),
}


def bench(
    *,
    logs: Annotated[str, "Recordings that are right, by commas; else simulated drives."] = "",
    scans: Annotated[int, "Scans of each that are used, from its beginning."] = 400,
) -> Report:
    """Count false alarms and misses of each warning."""
    report = Report(__doc__.splitlines()[0])
    false, missed, tried = Counter[str](), Counter[str](), Counter[str]()
    right = 0
    for log in recordings(logs, scans):
        for name, found in alarms(log):
            right += 1
            false.update(found)
            report.notes += [f"{log.name}, {name}: false: {each}" for each in sorted(found)]
        for fault in FAULTS:
            tried[fault.name] += 1
            if not is_noticed(fault, log):
                missed[fault.name] += 1
                report.notes.append(f"{log.name}, {fault.name}: missed")
    for kind in KINDS:
        report.add("false alarms", warning=kind, recordings=right, false=false[kind])
    for name, count in tried.items():
        report.add("misses", fault=name, recordings=count, missed=missed[name])
    return report


def alarms(log: LaserLog) -> Iterator[tuple[str, set[str]]]:
    """What is said of a right recording, by how it was changed."""
    for name, change in RIGHT.items():
        yield name, kinds_of(said(change(log)))
    run = lrf3d.slam_log(log)
    scans = [
        replace(scan, time=there.time) for scan, there in zip(run.scans, log.scans, strict=False)
    ]
    yield "as mapped", kinds_of(said(LaserLog(log.name, scans), "map"))


def is_noticed(fault: Fault, log: LaserLog) -> bool:
    """Whether a fault of a recording is named or repaired."""
    wrong = fault.make(log)
    hows = ("repair", "slam") if fault.how == "slam" else (fault.how,)
    return any(kinds_of(said(wrong, how)) & {*fault.kinds} for how in hows)


def recordings(logs: str, scans: int) -> Iterator[LaserLog]:
    """The first scans of each recording, or of simulated drives."""
    for path in map(Path, filter(None, logs.split(","))):
        log = replace(lrf3d.load_log(path, poses=odometry_of(path)).of_moments(), parts=())
        wheels = log.wheels and replace(log.wheels, places=log.wheels.places[:scans])
        yield replace(log, scans=log.scans[:scans], wheels=wheels)
    for world in () if logs else ("corridor", "warehouse", "glass_office"):
        run = lrf3d.load_scenario(world).run(rng=0, scans=scans, snapshots=1)
        yield LaserLog(world, list(run.scans))


def said(log: LaserLog, how: str = "slam") -> str:
    """All that a solution of a log, its map or its repairs alone say of it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            notes = list[str]()
            if how == "map":
                lrf3d.map_log(log)
            elif how == "repair":
                [recording] = repair(log, SOLVING)
                notes.append(doubtful_mount(recording.log.scans) or "")
            else:
                solved = solve_log(log)
                recording = solved.recording
                notes += solved.warnings
            if how != "map":
                notes += [*recording.log.notes, *recording.sentences]
        except InputError as error:
            notes.append(str(error))
    return " ".join([*(str(each.message) for each in caught), *notes])


def kinds_of(text: str) -> set[str]:
    """The kinds of warnings in a text."""
    return {kind for kind, words in KINDS.items() if any(word in text for word in words)}
