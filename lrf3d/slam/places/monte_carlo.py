"""Monte Carlo evaluation of the localisation on a known map.

A drive is followed with many seeds, each with its own start, range noise and odometry noise; the
errors of the extended Kalman filter and its consistency leave.
"""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from lrf3d.base.cores import core_count, process_pool, results
from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.geometry.pose import Pose
from lrf3d.laser import ProportionalNoise, RangeNoise
from lrf3d.simulation.run import Run
from lrf3d.slam.places.localiser import (
    Localiser,
    OdometryNoise,
    PoseEstimate,
    Track,
    localise,
    odometry_increments,
)
from lrf3d.slam.places.pairing import STRATEGIES, KnownLines


@stoppable()
def score_localisation(
    run: Run,
    sigma: float,
    odometry: OdometryNoise | None = None,
    *,
    known: str = "walls",
    strategy: str = STRATEGIES[0],
    seeds: int = 100,
    workers: int | None = 1,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Follow a simulated drive with many seeds, by odometry and scans alone.

    The ranges have a noise of sigma [m] at range_max; the start is as uncertain as one increment.
    The known map is the true ``walls``, or the ``map`` of the run. The result, in JSON's types,
    does not depend on the number of processes: None for one for each core.

    Raises:
        InputError: There is no such map or strategy, or no seed.
    """
    from scipy.stats import chi2

    if known not in ("walls", "map"):
        raise InputError(f"known {shown(known)}: expected one of walls, map")
    if seeds < 1:
        raise InputError(f"{seeds} seeds: expected at least 1")
    expect(progress, Callable, "progress")
    lines = KnownLines.from_world(run.world)
    mapped_range = 10.0  # Typical range [m] of the points that a map is fitted to.
    if known == "map":
        deviation = sigma * mapped_range / run.lrf.range_max
        lines = KnownLines.from_map(run.map, deviation=deviation)
    # Other map snapshots are not needed, and would only be copied to the processes.
    bare = replace(run, snapshot_scans=run.snapshot_scans[-1:], maps=run.maps[-1:])
    odometry = OdometryNoise() if odometry is None else odometry
    follow = partial(follow_drive, bare, lines, sigma, odometry, strategy)
    tracks: list[Track] = []
    workers = min(seeds, workers or core_count())
    with process_pool(workers) if workers > 1 else nullcontext() as pool:
        futures = [] if pool is None else [pool.submit(follow, seed) for seed in range(seeds)]
        for track in results(futures) if futures else map(follow, range(seeds)):
            tracks.append(track)
            progress(len(tracks), seeds)
            check()
    truth = run.trajectory.poses
    errors = np.array([track.errors(truth) for track in tracks])
    nees = np.array([track.nees(truth) for track in tracks])
    distance = np.hypot(errors[..., 0], errors[..., 1])
    averages = nees.mean(axis=0)
    # Share of the averages over seeds that lie within the bounds for a consistent filter.
    nees_confidence = 0.95
    # The interval of a consistent filter's NEES, of three numbers, averaged over the seeds.
    tail = 0.5 * (1.0 - nees_confidence)
    low, high = (chi2(3 * seeds).ppf([tail, 1.0 - tail]) / seeds).tolist()
    return {
        "known": known,
        "lines": len(lines),
        "strategy": strategy,
        "seeds": seeds,
        "scans": len(truth),
        "mean_position_error_m": float(distance.mean()),
        "rms_position_error_m": float(np.sqrt((distance**2).mean())),
        "largest_position_error_m": float(distance.max()),
        "mean_heading_error_deg": float(np.degrees(np.abs(errors[..., 2]).mean())),
        "nees": {
            "mean": float(nees.mean()),
            "bounds_of_average_over_seeds": [low, high],
            "scans_within_bounds": float(((averages >= low) & (averages <= high)).mean()),
        },
        "lines_a_scan": float(np.mean([track.lines for track in tracks])),
        "comparisons_a_scan": float(np.mean([track.comparisons for track in tracks])),
    }


def follow_drive(
    run: Run, known: KnownLines, sigma: float, odometry: OdometryNoise, strategy: str, seed: int
) -> Track:
    """The track of one seed."""
    rng = np.random.default_rng(seed)
    noise = ProportionalNoise(sigma)
    poses = run.trajectory.poses
    start = PoseEstimate(Pose(*poses[0].tolist()), np.zeros((3, 3)))
    # The start has the error, and the covariance, of an odometry increment.
    start = start.moved(odometry(np.zeros((1, 3)), rng)[0], odometry.covariance)
    # Eq. 7 has no floor; with one, near walls would get too little weight.
    ranges = RangeNoise.from_sigma(sigma, 0.0, run.lrf.range_max)
    localiser = Localiser(
        known, start, range_noise=ranges, odometry_noise=odometry, strategy=strategy
    )
    steps = odometry(odometry_increments(poses), rng)
    lasers = range(len(run.lasers))
    scans = (
        [noise(run.true_scan(index, laser=laser), rng) for laser in lasers]
        for index in range(len(run))
    )
    return localise(localiser, scans, steps)
