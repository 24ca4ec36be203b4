"""Is it faster to look for line pairs among the unions seen before, as the paper says?

On a drive, every strategy pairs the same lines of the same scans with the same known map, from
the same predicted poses. Comparisons, time, and whether both find the same pairs leave.
"""

import time
from dataclasses import dataclass

import numpy as np

from benchmarks.timing import Timing
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.localization import OdometryNoise
from lrf3d.localization.lines import KnownLines, LocalLines, RangeNoise
from lrf3d.localization.pairing import STRATEGIES, Pairs, pair_lines
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.scenario import SIGMA
from lrf3d.world import World
from lrf3d.world.generate import BLOCK, city_blocks, generate_city

ROBOT = Pose(0.0, 0.0, 0.0)
"""The robot's pose in its own frame."""

TOWNS = (1_000, 10_000)
"""Walls of the generated towns that are driven through beside the city."""

STRIDE = 0.8
"""From one scan to the next on a drive through a town [m], as in the built-in city."""

LONGEST = 300
"""Scans of a drive through a town at most: the medians are steady long before."""


@dataclass(frozen=True, slots=True)
class PairEntry:
    """A strategy on a drive.

    Args:
        place: What was driven through.
        known_lines: Lines of the known map.
        strategy: Which lines were compared.
        scans: How many scans.
        pairs_a_scan: Pairs found, a scan.
        comparisons_a_scan: Comparisons, a scan.
        pairing: The time in which a scan's lines were paired.
        scans_with_the_pairs_of_all: Share of scans in which the pairs are just those of ``all``.
    """

    place: str
    known_lines: int
    strategy: str
    scans: int
    pairs_a_scan: float
    comparisons_a_scan: float
    pairing: Timing
    scans_with_the_pairs_of_all: float


def measure_pairs(
    place: str, world: World, poses: Float, lrf: LaserRangeFinder, *, seed: int = 0
) -> list[PairEntry]:
    """Pair the lines of a drive with the true walls by every strategy.

    Args:
        place: What the place is called.
        world: The walls.
        poses: (k, 3) true poses of the scans; predicted ones are off as a step of odometry is.
        lrf: The range finder.
        seed: Seed of the noise of ranges and odometry.
    """
    rng = np.random.default_rng(seed)
    known, caster, extract = KnownLines.from_world(world), PlanarCaster(world), LineMapper()
    noise, odometry = ProportionalNoise(SIGMA), OdometryNoise()
    range_noise = RangeNoise(SIGMA, 0.0, lrf.range_max)
    spacing = (lrf.angle_max - lrf.angle_min) / (lrf.beams - 1)
    found: dict[str, list[Pairs]] = {strategy: [] for strategy in STRATEGIES}
    spent: dict[str, list[float]] = {strategy: [] for strategy in STRATEGIES}
    seen: dict[str, Int | None] = dict.fromkeys(STRATEGIES)
    for pose in poses:
        scan = noise(caster.cast(lrf, pose), rng)
        in_robot_frame = type(scan)(ROBOT, scan.angles, scan.ranges, range_max=lrf.range_max)
        local = LocalLines.from_map(extract.local_map(in_robot_frame), range_noise, spacing=spacing)
        # A step errs as much ahead as to the side, so it does so along the world's axes too.
        predicted = Pose(*(pose + odometry(np.zeros((1, 3)), rng)[0]).tolist())
        for k in rng.permutation(len(STRATEGIES)):
            strategy = STRATEGIES[k]
            start = time.perf_counter()
            pairs = pair_lines(
                *(local, known, predicted, odometry.covariance),
                strategy=strategy,
                seen=seen[strategy],
            )
            spent[strategy].append(time.perf_counter() - start)
            found[strategy].append(pairs)
            seen[strategy] = pairs.objects
    return [
        PairEntry(
            place,
            len(known),
            strategy,
            len(poses),
            float(np.mean([len(pairs) for pairs in found[strategy]])),
            float(np.mean([pairs.comparisons for pairs in found[strategy]])),
            Timing.of(spent[strategy]),
            float(np.mean(list(map(_same, found[strategy], found["all"])))),
        )
        for strategy in reversed(STRATEGIES)
    ]


def measure_town(walls: int, *, scans: int | None = None) -> list[PairEntry]:
    """Pair the lines of a drive along a street through the middle of a generated town.

    Args:
        walls: Walls of the town.
        scans: How many scans at most.
    """
    columns, rows = city_blocks(walls)
    longest = LONGEST if scans is None else min(scans, LONGEST)
    scans = min(longest, int(BLOCK * (columns - 1) / STRIDE))
    x = 0.5 * BLOCK * (columns - 1) + STRIDE * (np.arange(scans) - 0.5 * scans)
    y = BLOCK * (rows // 2 - 0.5)
    poses = np.column_stack([x, np.full(scans, y), np.zeros(scans)])
    return measure_pairs("town", generate_city(walls), poses, LaserRangeFinder())


def _same(first: Pairs, second: Pairs) -> bool:
    return np.array_equal(first.local, second.local) and np.array_equal(first.known, second.known)
