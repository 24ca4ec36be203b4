"""What error does a map have, what does it cost after every scan, and what do obstacles leave?

The city is mapped with many settings; it is driven round and round and its map read after every
scan; the corridor is driven with dynamic obstacles.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from benchmarks.report import Figure, Report, scatter
from benchmarks.timing import time_updates, timed
from lrf3d.casting import PlanarCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry.lines import Float
from lrf3d.laser import ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory, follow_route
from lrf3d.scoring import score_run
from lrf3d.scoring.matching import sample_offsets
from lrf3d.simulation.recorder import collect
from lrf3d.simulation.scenario import Scenario, load_scenario
from lrf3d.world import Material

CITY = load_scenario("city")

SETTINGS: Mapping[str, Mapping[str, dict[str, Any]]] = {
    "beams": {str(n): {"lrf": replace(CITY.lrf, beams=n)} for n in (46, 91, 181, 361)},
    "noise σ": {str(sigma): {"sigma": sigma} for sigma in (0.0, 0.01, 0.04, 0.2, 0.6)},
    "gap": {str(gap): {"mapper": {**CITY.mapper, "gap": gap}} for gap in (0.5, 1.0, 2.5, 5.0)},
}
"""What is varied, one at a time: values, and the arguments of a simulation."""

OFF_ROUTE = 0.05
"""By how much a later round is off the first one [m], so that no scan comes twice."""

PERSON, BOARD_AHEAD = 0.25, 0.4
"""Radius of an obstacle, and how far ahead of the robot a board stands [m]."""

FAR_AWAY = (1000.0, 0.0, 0.0)
"""Where an obstacle is that is not there."""

DOOR = np.array([5.0, 2.6, 6.2, 2.6])
"""The door between the corridor and the store [m]."""

DOOR_ROUTE = np.array([
    [1.2, 1.3], [4.2, 1.1], [5.3, 1.8], [5.6, 2.8], [6.0, 4.4], [7.4, 5.6], [7.4, 6.6], [6.0, 5.2],
    [5.55, 3.8], [5.6, 2.2], [6.8, 1.3], [12.8, 1.3], [20.0, 1.1], [22.0, 1.3], [21.9, 1.6],
    [20.0, 1.5], [12.8, 1.3], [6.8, 1.2], [4.0, 1.2], [1.5, 1.3],
])  # fmt: skip
"""Through it and back past it [m]."""

DOOR_CLOSES = "a door that closes after half"

RIGHT_REACH, RIGHT_ANGLE = 0.1, np.radians(5.0)
"""How near [m] and how parallel [rad] to a true wall a map is right."""


def bench(
    *,
    seeds: Annotated[int, "Seeds of the noise for each setting."] = 2,
    every: Annotated[int, "Use every n-th scan for settings."] = 8,
    scans: Annotated[int, "Scans round the city."] = 4000,
    figure: Figure = None,
) -> Report:
    """Map with many settings, for a long time, and among dynamic obstacles."""
    report = Report(__doc__.splitlines()[0])
    settings(report, seeds, every)
    for beams in (181, 721):
        rounds(report, beams, scans)
    obstacles(report, seeds, max(1, every // 4))
    savings(report, min(scans, 600))
    report.notes.append(
        "missed: 1 − segment F1. update: the median, the map read. false: segments of which less"
        " than half lies on a true wall."
    )
    if figure is not None:
        labels = "time of an update [s]", "1 − segment F1"
        scatter(figure, report.tables["settings"], "update_s", "missed", "mapper", labels, "value")
    return report


def settings(report: Report, seeds: int, every: int) -> None:
    """Error and time of the map of the city, one setting varied at a time, in both modes."""
    drive = CITY.trajectory().every(every)
    for varied, choices in SETTINGS.items():
        for value, arguments in choices.items():
            for mode in ("robust", "paper"):
                scores, spent = [], list[float]()
                for seed in range(seeds):
                    simulation = CITY.simulation(drive=drive, rng=seed, caster="planar", mode=mode,
                                                 **arguments)  # fmt: skip
                    times = time_updates(simulation.mapper)
                    scores.append(score_run(collect(simulation, snapshots=1)))
                    spent += times
                report.add(
                    "settings",
                    varied=varied,
                    value=value,
                    mapper=mode,
                    length_f1=mean(score.length_f1 for score in scores),
                    missed=1.0 - mean(score.segment_f1 for score in scores),
                    purity=mean(score.object_purity for score in scores),
                    rms_m=mean(score.perpendicular_rms for score in scores),
                    update_s=float(np.median(spent)),
                )


def mean(values: Any) -> float:
    """The mean of figures; runs without one are left out."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else float("nan")


def rounds(report: Report, beams: int, scans: int) -> None:
    """What a scan costs until its map is there, on a drive round and round the city."""
    poses, lrf = CITY.trajectory().poses, replace(CITY.lrf, beams=beams)
    caster, noise = PlanarCaster(CITY.world), ProportionalNoise(SIGMA)
    rng, mapper = np.random.default_rng(0), LineMapper()
    spent: list[float] = []
    for number in range(scans):
        pose = poses[number % len(poses)].copy()
        pose[:2] += rng.normal(0.0, OFF_ROUTE, 2) if number >= len(poses) else 0.0
        scan = noise(caster.cast(lrf, pose), rng)
        spent.append(timed(mapper.update, scan) + timed(lambda: mapper.map.segments))
    quarter = scans // 4
    report.add(
        "rounds of the city",
        beams=beams,
        scans=scans,
        update_s=float(np.median(spent)),
        slowest_s=float(np.quantile(spent, 0.99)),
        second_quarter_s=float(np.median(spent[quarter : 2 * quarter])),
        last_quarter_s=float(np.median(spent[-quarter:])),
        segments=len(mapper.map),
    )


def obstacles(report: Report, seeds: int, every: int) -> None:
    """What dynamic obstacles leave in the map of the corridor."""
    corridor = load_scenario("corridor")
    walls = corridor.world.segments[corridor.world.heights >= corridor.lrf.height]
    for name, (drive, moving) in drives_of(corridor).items():
        # What is there at the end is true.
        true = np.vstack([walls, DOOR]) if name == DOOR_CLOSES else walls
        scores, false, door = [], [], []
        for seed in range(seeds):
            run = corridor.run(rng=seed, obstacles=moving, snapshots=1, drive=drive.every(every))
            scores.append(score_run(run))
            false.append(sum(share_on(segment, true) < 0.5 for segment in run.map.segments))
            door.append(share_on(DOOR, run.map.segments))
        report.add(
            "dynamic obstacles",
            obstacles=name,
            segment_f1=mean(score.segment_f1 for score in scores),
            length_f1=mean(score.length_f1 for score in scores),
            false=float(np.mean(false)),
            door_share=float(np.mean(door)) if name == DOOR_CLOSES else None,
        )


def share_on(segment: Float, walls: Float) -> float:
    """How much of a segment (4,) lies on walls (n, 4)."""
    offsets = sample_offsets(segment[None], walls, reach=RIGHT_REACH, angle=RIGHT_ANGLE)
    return float(np.isfinite(offsets).mean())


def drives_of(corridor: Scenario) -> dict[str, tuple[Trajectory, list[DynamicObstacle]]]:
    """Drives through the corridor with obstacles, by what these do."""
    drive = corridor.trajectory()
    back = drive.poses[::-1, :2]
    back = back[np.append(True, np.hypot(*np.diff(back, axis=0).T) > 1e-6)]

    def walking(begin: float, speed: float) -> DynamicObstacle:
        """One that comes along the route from a share of it on, at a speed [m/s]."""
        places = back[int(begin * len(back)) :]
        steps = np.diff(places, axis=0)
        times = np.append(0.0, np.cumsum(np.hypot(*steps.T))) / speed
        return person(times, places, np.arctan2(*steps[np.r_[: len(steps), -1]].T[::-1]))

    headings = drive.poses[:, 2]
    ahead = drive.poses[:, :2] + 1.5 * np.column_stack([np.cos(headings), np.sin(headings)])
    x, y, theta = start = drive.poses[0]
    times = np.arange(0.0, 60.0, corridor.scan_interval)
    still = Trajectory(times, np.tile(start, (len(times), 1)))
    place = (x + BOARD_AHEAD * np.cos(theta), y + BOARD_AHEAD * np.sin(theta), theta)
    past = follow_route(DOOR_ROUTE, speed=corridor.speed, dt=corridor.scan_interval)
    x1, y1, x2, y2 = DOOR
    frame = (0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.0)
    return {
        "none": (drive, []),
        "one, coming the other way": (drive, [walking(0.0, 1.0)]),
        "three of them": (drive, [walking(0.0, 1.0), walking(0.2, 1.0), walking(0.33, 0.7)]),
        "one 1.5 m ahead all the way": (drive, [person(drive.times, ahead, headings)]),
        "five at 0.1 m/s": (drive, [walking(k / 6.0, 0.1) for k in range(5)]),
        "60 s in one place": (still, []),
        "60 s, a board for 0.3 s": (still, [shown(box(0.05, 2.0), place, 30.0, 30.3)]),
        DOOR_CLOSES: (
            past, [shown(box(x2 - x1, 0.04), frame, 0.5 * past.duration, past.duration)]
        ),
    }  # fmt: skip


def person(times: Float, places: Float, headings: Float) -> DynamicObstacle:
    """Somebody at places (n, 2) [m] at times [s]."""
    path = Trajectory(times, np.column_stack([places, headings]))
    return DynamicObstacle(round_outline(PERSON), path)


def box(length: float, width: float) -> Float:
    """The outline of a box [m]."""
    corners = [[-length, -width], [length, -width], [length, width], [-length, width]]
    return 0.5 * np.array(corners)


def shown(
    outline: Float, place: tuple[float, float, float], begin: float, end: float
) -> DynamicObstacle:
    """What is at a place from one time to another [s], and far away at all others."""
    times = [begin - 1e-3, begin, end, end + 1e-3]
    return DynamicObstacle(outline, Trajectory(times, [FAR_AWAY, place, place, FAR_AWAY]))


def savings(report: Report, scans: int) -> None:
    """Pieces of work that mapping skips, each timed with it skipped and with it done."""
    # Walls of brick, so that intensities fall with range and incidence as mappers expect.
    world = replace(CITY.world, materials=(Material.of("brick"),) * CITY.world.object_count)
    caster, noise, rng = PlanarCaster(world), ProportionalNoise(SIGMA), np.random.default_rng(0)
    lit = [noise(caster.cast(CITY.lrf, p), rng) for p in CITY.trajectory().poses[:scans]]
    seen = [replace(scan, intensities=None) for scan in lit]

    def update(given: Any, act: Callable[[LineMapper], object] = lambda mapper: None) -> float:
        mapper, spent = LineMapper(), []
        for scan in given:
            begin = time.perf_counter()
            mapper.update(scan)
            act(mapper)
            spent.append(time.perf_counter() - begin)
        return float(np.median(spent))

    bare = update(seen)
    report.save("looking for glass and mirrors in scans without intensities", bare, update(lit))
    report.save("mapping the same scan again", update([seen[-1]] * scans), bare)
    report.save("a map that is not read", bare, update(seen, lambda m: len(m.map.segments)))
