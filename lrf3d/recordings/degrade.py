"""A recorded log that is made worse on purpose, to find out how much a mapper or SLAM tolerates."""

from dataclasses import replace

import numpy as np

from lrf3d.geometry.lines import generator, whole_number
from lrf3d.laser import Chain, ConstantNoise, DropOuts, LaserScan
from lrf3d.recordings import LaserLog


def degrade_log(
    log: LaserLog,
    *,
    drop: float = 0.0,
    noise: float = 0.0,
    every: int = 1,
    beams_every: int = 1,
    rng: np.random.Generator | int | None = 0,
) -> LaserLog:
    """Return a log with fewer scans, beams and returns, and with noise; the odometry stays.

    Args:
        log: The log.
        drop: Share of the returns that are lost, at random.
        noise: Standard deviation [m] of the noise that is added to each range.
        every: Keep every n-th scan of each laser.
        beams_every: Keep every n-th beam.
        rng: A generator, or a seed.

    Raises:
        InputError: A share is over 1, a deviation negative, or a number below 1.
    """
    keep = whole_number(every, "every")
    beams = whole_number(beams_every, "beams_every")
    worse = Chain([DropOuts(drop), ConstantNoise(noise)])
    draws = generator(rng)
    rows = [k for name in log.lasers for k in np.flatnonzero(log.is_of(name))[::keep].tolist()]
    scans = [worse(_thinned(log.scans[k], beams), draws) for k in sorted(rows)]
    wheels = log.wheels and replace(log.wheels, places=log.wheels.places[sorted(rows)])
    return replace(log, scans=scans, wheels=wheels)


def _thinned(scan: LaserScan, every: int) -> LaserScan:
    """Every n-th beam of a scan, without the light, which a text log does not hold."""
    part = slice(None, None, every)
    return LaserScan(
        scan.pose, scan.angles[part], scan.ranges[part], scan.walls[part],
        range_min=scan.range_min, range_max=scan.range_max, time=scan.time,
        mount=scan.mount, laser=scan.laser,
    )  # fmt: skip
