"""Is it faster to look for line pairs among the unions seen before, as the paper says?

On a drive, both strategies pair the same lines of the same scans with the same known map, from the
same predicted poses.
"""

import time

import numpy as np

from benchmarks.report import Report, Row
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, ProportionalNoise, RangeNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.localization import OdometryNoise
from lrf3d.localization.lines import KnownLines, LocalLines
from lrf3d.localization.pairing import STRATEGIES, Pairs, pair_lines
from lrf3d.pose import Pose
from lrf3d.scenario import load_scenario
from lrf3d.world import World
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, generate_city

STRIDE, SCANS = 0.8, 300
"""From one scan to the next on a drive through a town [m], as in the city, and its scans."""


def bench() -> Report:
    """Pair the lines of scans with known maps of three sizes by both strategies."""
    report = Report(__doc__.splitlines()[0])
    city = load_scenario("city")
    places = [("city", city.world, city.trajectory().poses, city.lrf)]
    for walls in (1_000, 10_000):
        columns, rows = city_blocks(walls)
        scans = min(SCANS, int(BLOCK_SIDE * (columns - 1) / STRIDE))
        x = 0.5 * BLOCK_SIDE * (columns - 1) + STRIDE * (np.arange(scans) - 0.5 * scans)
        y = np.full(scans, BLOCK_SIDE * (rows // 2 - 0.5))
        poses = np.column_stack([x, y, np.zeros(scans)])
        places.append(("town", generate_city(walls), poses, LaserRangeFinder()))
    for place, world, poses, lrf in places:
        for strategy, row in pair_drive(world, poses, lrf).items():
            report.add("line pairs", place=place, lines=len(world.segments), strategy=strategy,
                       **row)  # fmt: skip
    return report


def pair_drive(
    world: World, poses: Float, lrf: LaserRangeFinder, *, seed: int = 0
) -> dict[str, Row]:
    """Pairs, comparisons and time a scan of each strategy, with the true walls as known lines.

    ``same_share`` is the share of the scans in which the pairs are just those of ``all``.
    """
    rng = np.random.default_rng(seed)
    known, caster = KnownLines.from_world(world), PlanarCaster(world)
    noise, odometry = ProportionalNoise(SIGMA), OdometryNoise()
    range_noise = RangeNoise.from_sigma(SIGMA, 0.0, lrf.range_max)
    found: dict[str, list[Pairs]] = {strategy: [] for strategy in STRATEGIES}
    spent: dict[str, list[float]] = {strategy: [] for strategy in STRATEGIES}
    seen: dict[str, Int | None] = dict.fromkeys(STRATEGIES)
    for pose in poses:
        scan = noise(caster.cast(lrf, pose), rng)
        local = LocalLines.from_scan(scan, range_noise)
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
    return {
        strategy: {
            "pairs": float(np.mean([len(pairs) for pairs in mine])),
            "comparisons": float(np.mean([pairs.comparisons for pairs in mine])),
            "pairing_s": float(np.median(spent[strategy])),
            "same_share": float(np.mean(list(map(_same, mine, found["all"])))),
        }
        for strategy, mine in found.items()
    }


def _same(first: Pairs, second: Pairs) -> bool:
    return np.array_equal(first.local, second.local) and np.array_equal(first.known, second.known)
