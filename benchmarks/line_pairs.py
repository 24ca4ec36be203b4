"""Is it faster to look for line pairs among the unions seen before, as the paper says?

On a drive, both strategies pair the same lines of the same scans with the same known map, from the
same predicted poses.
"""

import time

import numpy as np

from benchmarks.report import Row
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserRangeFinder, ProportionalNoise, RangeNoise
from lrf3d.laser.noise import SIGMA
from lrf3d.slam.places import OdometryNoise
from lrf3d.slam.places.pairing import STRATEGIES, KnownLines, LocalLines, Pairs, pair_lines
from lrf3d.world import World


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
    seen: dict[str, Int] = dict.fromkeys(STRATEGIES, np.empty(0, np.int64))
    for pose in poses:
        scan = noise(caster.cast(lrf, pose), rng)
        local = LocalLines.from_scan(scan, range_noise)
        # A step errs as much ahead as to the side, so it does so along the world's axes too.
        predicted = Pose(*(pose + odometry(np.zeros((1, 3)), rng)[0]).tolist())
        for k in rng.permutation(len(STRATEGIES)):
            strategy = STRATEGIES[k]
            start = time.perf_counter()
            pairs = pair_lines(local, known, predicted, odometry.covariance, seen[strategy])
            spent[strategy].append(time.perf_counter() - start)
            found[strategy].append(pairs)
            if strategy == "seen-objects-first":
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
