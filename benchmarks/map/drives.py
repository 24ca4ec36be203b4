"""What does a map cost after every scan of a long drive, and what do dynamic obstacles leave in it?

The city is driven round and round, and its map is looked at after every scan; the corridor is
driven once, with obstacles in it.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.result import Result, Table, percent
from benchmarks.timing import timed
from lrf3d.casting import EmbreeCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry import Float
from lrf3d.laser import ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory, follow_route
from lrf3d.scenario import Scenario
from lrf3d.scenario_file import load_scenario
from lrf3d.scoring import MapScore, score_run
from lrf3d.scoring.matching import sample_offsets

THOUSAND = 1000
"""Scans whose times are compared, early and late."""

OFF_ROUTE = 0.05
"""By how much a later round is off the first one [m], so that no scan comes twice."""

PERSON = 0.25
"""Radius of an obstacle [m]."""

FAR_AWAY = (1000.0, 0.0, 0.0)
"""Where an obstacle is that is not there."""

BOARD_AHEAD = 0.4
"""How far ahead of the robot the board stands [m]."""

DOOR = np.array([5.0, 2.6, 6.2, 2.6])
"""The door between the corridor and the store [m]."""

DOOR_ROUTE = np.array([
    [1.2, 1.3], [4.2, 1.1], [5.3, 1.8], [5.6, 2.8], [6.0, 4.4], [7.4, 5.6], [7.4, 6.6], [6.0, 5.2],
    [5.55, 3.8], [5.6, 2.2], [6.8, 1.3], [12.8, 1.3], [20.0, 1.1], [22.0, 1.3], [21.9, 1.6],
    [20.0, 1.5], [12.8, 1.3], [6.8, 1.2], [4.0, 1.2], [1.5, 1.3],
])  # fmt: skip
"""Through it and back past it [m]."""

DOOR_CLOSES = "a door that closes after half"
"""What the drive is called in which it does."""

RIGHT_REACH, RIGHT_ANGLE = 0.1, np.radians(5.0)
"""How near [m] and how parallel [rad] to a true wall a map is right."""

ROUNDS = Table(
    "rounds",
    {
        "beams": "beams",
        "scans": "scans",
        "median_s": "update and map",
        "slowest_s": "99 %",
        "early_s": "second thousand",
        "late_s": "last thousand",
        "memory_bytes": "memory",
        "segments": "segments",
    },
    "The city driven round, by a mapper whose map is looked at after every scan. memory: by how"
    " much\nthe process grew after the first thousand scans.",
    names=("beams",),
)
"""What a scan costs until its map is there, on a drive without end."""

OBSTACLES = Table(
    "obstacles",
    {
        "obstacles": "obstacles",
        "segment_f1": ("segment F1", "{:.3f}".format),
        "length_f1": ("length F1", "{:.3f}".format),
        "segments": ("segments", "{:.1f}".format),
        "false_segments": ("false", "{:.1f}".format),
        "door_mapped": ("door", percent),
        "seeds": "seeds",
    },
    "The corridor with dynamic obstacles. false: segments of which less than half lies on a true"
    " wall.\ndoor: how much of the door that closed is on the map.",
    names=("obstacles",),
)
"""What dynamic obstacles leave in a map."""


def measure_rounds(result: Result, beams: int, scans: int, *, seconds: float) -> None:
    """Drive round the city.

    Args:
        result: Where the row goes.
        beams: Beams of a scan.
        scans: How many scans at most.
        seconds: Time for them [s].
    """
    city = load_scenario("city")
    poses, lrf = city.trajectory().poses, replace(city.lrf, beams=beams)
    caster, noise = EmbreeCaster(city.world), ProportionalNoise(SIGMA)
    rng, mapper = np.random.default_rng(0), LineMapper()
    spent: list[float] = []
    before: int | None = None
    until = time.monotonic() + seconds
    while len(spent) < scans and time.monotonic() < until:
        pose = poses[len(spent) % len(poses)].copy()
        pose[:2] += rng.normal(0.0, OFF_ROUTE, 2) if len(spent) >= len(poses) else 0.0
        scan = noise(caster.cast(lrf, pose), rng)
        spent.append(timed(mapper.update, scan) + timed(lambda: mapper.map.segments))
        if len(spent) == THOUSAND:
            before = _resident()
    after = _resident()
    early = spent[THOUSAND : 2 * THOUSAND]
    result.add(
        ROUNDS,
        beams=beams,
        scans=len(spent),
        median_s=float(np.median(spent)),
        slowest_s=float(np.quantile(spent, 0.99)),
        early_s=float(np.median(early)) if early else None,
        late_s=float(np.median(spent[-THOUSAND:])) if early else None,
        memory_bytes=None if before is None or after is None else max(after - before, 0),
        segments=len(mapper.map),
    )


def _resident() -> int | None:
    """Memory of this process [bytes]; None where the system does not report it."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return 1024 * int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def obstacles_of(corridor: Scenario) -> dict[str, list[DynamicObstacle]]:
    """Obstacles for the drive through the corridor, by what they do."""
    drive = corridor.trajectory()
    back = drive.poses[::-1, :2]
    back = back[np.append(True, np.hypot(*np.diff(back, axis=0).T) > 1e-6)]

    def walking(begin: float, speed: float) -> DynamicObstacle:
        """One that comes along the route from a share of it on, at a speed [m/s]."""
        places = back[int(begin * len(back)) :]
        steps = np.diff(places, axis=0)
        times = np.append(0.0, np.cumsum(np.hypot(*steps.T))) / speed
        return _obstacle(times, places, np.arctan2(*steps[np.r_[: len(steps), -1]].T[::-1]))

    headings = drive.poses[:, 2]
    ahead = drive.poses[:, :2] + 1.5 * np.column_stack([np.cos(headings), np.sin(headings)])
    return {
        "none": [],
        "one, coming the other way": [walking(0.0, 1.0)],
        "three of them": [walking(0.0, 1.0), walking(0.2, 1.0), walking(0.33, 0.7)],
        "one 1.5 m ahead all the way": [_obstacle(drive.times, ahead, headings)],
        "five at 0.1 m/s": [walking(k / 6.0, 0.1) for k in range(5)],
    }


def board_of(corridor: Scenario) -> tuple[Trajectory, list[DynamicObstacle]]:
    """A robot that stands for 60 s, and a board that stands before it for 0.3 s of them."""
    start, times = corridor.trajectory().poses[0], np.arange(0.0, 60.0, corridor.scan_interval)
    x, y, theta = start
    place = (x + BOARD_AHEAD * np.cos(theta), y + BOARD_AHEAD * np.sin(theta), theta)
    board = DynamicObstacle(_box(0.05, 2.0), _shown(place, 30.0, 30.3))
    return Trajectory(times, np.tile(start, (len(times), 1))), [board]


def door_of(corridor: Scenario) -> tuple[Trajectory, list[DynamicObstacle]]:
    """A robot that has left the store, and comes back past its door, which has closed since."""
    drive = follow_route(DOOR_ROUTE, speed=corridor.speed, dt=corridor.scan_interval)
    x1, y1, x2, y2 = DOOR
    place = (0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.0)
    door = DynamicObstacle(_box(x2 - x1, 0.04), _shown(place, 0.5 * drive.duration, drive.duration))
    return drive, [door]


def _box(length: float, width: float) -> Float:
    return 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])


def _shown(place: tuple[float, float, float], begin: float, end: float) -> Trajectory:
    """The path of what is at a place from one time to another, and far away at all others."""
    moment = 1e-3
    times = [begin - moment, begin, end, end + moment]
    return Trajectory(times, [FAR_AWAY, place, place, FAR_AWAY])


def _obstacle(times: Float, places: Float, headings: Float) -> DynamicObstacle:
    path = Trajectory(times, np.column_stack([places, headings]))
    return DynamicObstacle(round_outline(PERSON), path)


def measure_obstacles(
    result: Result, kinds: Sequence[str] | None = None, *, seeds: int, scans: int | None = None
) -> None:
    """Map the corridor with dynamic obstacles.

    Args:
        result: Where the rows go.
        kinds: Which of `obstacles_of`; all if not given.
        seeds: Seeds of the noise.
        scans: Scans of the drive at most.
    """
    corridor = load_scenario("corridor")
    walls = corridor.world.segments[corridor.world.heights >= corridor.lrf.height]
    drives: dict[str, tuple[Trajectory | None, list[DynamicObstacle]]] = {
        words: (None, obstacles) for words, obstacles in obstacles_of(corridor).items()
    }
    drives |= {"60 s in one place": (board_of(corridor)[0], [])}
    drives |= {"60 s, a board for 0.3 s": board_of(corridor), DOOR_CLOSES: door_of(corridor)}
    for words, (drive, obstacles) in drives.items():
        if kinds is not None and words not in kinds:
            continue
        # What is there at the end is true.
        true = np.vstack([walls, DOOR]) if words == DOOR_CLOSES else walls
        scores: list[MapScore] = []
        counts: list[int] = []
        false: list[int] = []
        door: list[float] = []
        for seed in range(seeds):
            run = corridor.run(rng=seed, obstacles=obstacles, snapshots=1, scans=scans, drive=drive)
            scores.append(score_run(run))
            counts.append(len(run.map))
            false.append(sum(_is_false(segment, true) for segment in run.map.segments))
            on_map = sample_offsets(
                DOOR[None], run.map.segments, reach=RIGHT_REACH, angle=RIGHT_ANGLE
            )
            door.append(float(np.isfinite(on_map).mean()))
        result.add(
            OBSTACLES,
            obstacles=words,
            segment_f1=float(np.mean([score.segment_f1 for score in scores])),
            length_f1=float(np.mean([score.length_f1 for score in scores])),
            segments=float(np.mean(counts)),
            false_segments=float(np.mean(false)),
            door_mapped=float(np.mean(door)) if words == DOOR_CLOSES else None,
            seeds=seeds,
        )


def _is_false(segment: Float, walls: Float) -> bool:
    """Whether less than half of a segment (4,) lies on a true wall."""
    offsets = sample_offsets(segment[None], walls, reach=RIGHT_REACH, angle=RIGHT_ANGLE)
    return bool(np.isfinite(offsets).mean() < 0.5)
