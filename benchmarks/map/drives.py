"""What does a map cost after every scan of a long drive, and what do dynamic obstacles leave in it?

The city is driven round and round, and its map is looked at after every scan; the corridor is
driven once, with obstacles in it.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.result import Result, Table
from benchmarks.timing import timed
from lrf3d.casting import EmbreeCaster
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.geometry import Float
from lrf3d.laser import ProportionalNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory
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
        "seeds": "seeds",
    },
    "The corridor with dynamic obstacles. false: segments of which less than half lies on a true"
    " wall.",
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
    for words, obstacles in obstacles_of(corridor).items():
        if kinds is not None and words not in kinds:
            continue
        scores: list[MapScore] = []
        counts: list[int] = []
        false: list[int] = []
        for seed in range(seeds):
            run = corridor.run(rng=seed, obstacles=obstacles, snapshots=1, scans=scans)
            scores.append(score_run(run))
            counts.append(len(run.map))
            false.append(sum(_is_false(segment, walls) for segment in run.map.segments))
        result.add(
            OBSTACLES,
            obstacles=words,
            segment_f1=float(np.mean([score.segment_f1 for score in scores])),
            length_f1=float(np.mean([score.length_f1 for score in scores])),
            segments=float(np.mean(counts)),
            false_segments=float(np.mean(false)),
            seeds=seeds,
        )


def _is_false(segment: Float, walls: Float) -> bool:
    """Whether less than half of a segment (4,) lies on a true wall."""
    offsets = sample_offsets(segment[None], walls, reach=RIGHT_REACH, angle=RIGHT_ANGLE)
    return bool(np.isfinite(offsets).mean() < 0.5)
