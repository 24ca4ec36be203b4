"""Is it faster to look for line pairs among the unions seen before, as the paper says?

On a drive, every strategy pairs the same lines of the same scans with the same known map, from
the same predicted poses. Comparisons, time, and whether both find the same pairs leave.
"""

import time

import numpy as np

from benchmarks.result import Result, Table, percent
from benchmarks.timing import Timing
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, ProportionalNoise, RangeNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.localization import OdometryNoise
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.localization.pairing import STRATEGIES, Pairs, pair_lines
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.world import World
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, generate_city

ROBOT = Pose(0.0, 0.0, 0.0)
"""The robot's pose in its own frame."""

TOWNS = (1_000, 10_000)
"""Walls of the generated towns that are driven through beside the city."""

STRIDE = 0.8
"""From one scan to the next on a drive through a town [m], as in the built-in city."""

LONGEST = 300
"""Scans of a drive through a town at most: the medians are steady long before."""


PAIRS = Table(
    "line_pairs",
    {
        "place": "line pairs",
        "known_lines": "lines",
        "strategy": "strategy",
        "pairs_a_scan": ("pairs", "{:.1f}".format),
        "comparisons_a_scan": ("comparisons", "{:,.0f}".format),
        "pairing": "time",
        "scans_with_the_pairs_of_all": ("same pairs", percent),
    },
    names=("place", "known_lines", "strategy"),
    time="pairing",
    error="other_pairs_share",
)
"""Each strategy in each place: pairs and comparisons a scan, the time in which the lines of a scan
are paired, and the share of scans in which the pairs are just those of ``all``."""


def measure_pairs(
    result: Result,
    place: str,
    world: World,
    poses: Float,
    lrf: LaserRangeFinder,
    *,
    seed: int = 0,
) -> None:
    """Pair the lines of a drive with the true walls by every strategy.

    Args:
        result: Where the rows go.
        place: What the place is called.
        world: The walls.
        poses: (k, 3) true poses of the scans; predicted ones are off as a step of odometry is.
        lrf: The range finder.
        seed: Seed of the noise of ranges and odometry.
    """
    rng = np.random.default_rng(seed)
    known, caster, extract = KnownLines.from_world(world), PlanarCaster(world), LineMapper()
    noise, odometry = ProportionalNoise(SIGMA), OdometryNoise()
    range_noise = RangeNoise.from_sigma(SIGMA, 0.0, lrf.range_max)
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
    for strategy in reversed(STRATEGIES):
        mine = found[strategy]
        same = float(np.mean(list(map(_same, mine, found["all"]))))
        result.add(
            PAIRS,
            place=place,
            known_lines=len(known),
            strategy=strategy,
            scans=len(poses),
            pairs_a_scan=float(np.mean([len(pairs) for pairs in mine])),
            comparisons_a_scan=float(np.mean([pairs.comparisons for pairs in mine])),
            pairing=Timing.of(spent[strategy]),
            scans_with_the_pairs_of_all=same,
            other_pairs_share=1.0 - same,
        )


def measure_town(result: Result, walls: int, *, scans: int | None = None) -> None:
    """Pair the lines of a drive along a street through the middle of a generated town.

    Args:
        result: Where the rows go.
        walls: Walls of the town.
        scans: How many scans at most.
    """
    columns, rows = city_blocks(walls)
    longest = LONGEST if scans is None else min(scans, LONGEST)
    scans = min(longest, int(BLOCK_SIDE * (columns - 1) / STRIDE))
    x = 0.5 * BLOCK_SIDE * (columns - 1) + STRIDE * (np.arange(scans) - 0.5 * scans)
    y = BLOCK_SIDE * (rows // 2 - 0.5)
    poses = np.column_stack([x, np.full(scans, y), np.zeros(scans)])
    measure_pairs(result, "town", generate_city(walls), poses, LaserRangeFinder())


def _same(first: Pairs, second: Pairs) -> bool:
    return np.array_equal(first.local, second.local) and np.array_equal(first.known, second.known)
