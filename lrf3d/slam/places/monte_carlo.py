"""Monte Carlo evaluation of the localisation on a known map.

A drive is followed with many seeds, each with its own start, range noise and odometry noise. The
errors and the consistency of the extended Kalman filter leave.
"""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from lrf3d.base.cores import core_count, process_pool, results
from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.geometry.lines import CONFIDENCE, Float
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

# Typical range [m] of the points that a map is fitted to.
MAPPED_RANGE = 10.0


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """What the filter is told of the drive: noise that is also simulated, and how lines are paired.

    The ranges have a noise of sigma [m] at range_max.
    """

    sigma: float
    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    strategy: str = STRATEGIES[0]


@stoppable()
def score_localisation(
    run: Run,
    settings: FilterSettings,
    *,
    known: str = "walls",
    seeds: int = 100,
    workers: int | None = 1,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Follow a simulated drive with many seeds, by odometry and scans alone.

    The start is as uncertain as one increment. The known map is the true ``walls``, or the ``map``
    of the run. The result, in JSON's types, does not depend on the number of processes: None for
    one for each core.

    Raises:
        InputError: There is no such map or strategy, or no seed.
    """
    if known not in ("walls", "map"):
        raise InputError(f"known {shown(known)}: expected one of walls, map")
    if seeds < 1:
        raise InputError(f"{seeds} seeds: expected at least 1")
    expect(progress, Callable, "progress")
    lines = KnownLines.from_world(run.world)
    if known == "map":
        deviation = settings.sigma * MAPPED_RANGE / run.lrf.range_max
        lines = KnownLines.from_map(run.map, deviation=deviation)
    # Other map snapshots are not needed, and would only be copied to the processes.
    bare = replace(run, snapshot_scans=run.snapshot_scans[-1:], maps=run.maps[-1:])
    follow = partial(follow_drive, bare, lines, settings)
    tracks: list[Track] = []
    workers = min(seeds, workers or core_count())
    with process_pool(workers) if workers > 1 else nullcontext() as pool:
        futures = [] if pool is None else [pool.submit(follow, seed) for seed in range(seeds)]
        for track in results(futures) if futures else map(follow, range(seeds)):
            tracks.append(track)
            progress(len(tracks), seeds)
            check()
    about = {"known": known, "lines": len(lines), "strategy": settings.strategy, "seeds": seeds}
    return {**about, **_scored(tracks, run.trajectory.poses)}


def _scored(tracks: list[Track], truth: Float) -> dict[str, Any]:
    """The errors and the consistency of tracks, by true poses (k, 3)."""
    from scipy.stats import chi2

    errors = np.array([track.errors(truth) for track in tracks])
    nees = np.array([track.nees(truth) for track in tracks])
    distance = np.hypot(errors[..., 0], errors[..., 1])
    averages = nees.mean(axis=0)
    # The NEES of a consistent filter has three degrees of freedom.
    # The NEES of a consistent filter, averaged over the seeds, is within its bounds so often.
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = (chi2(3 * len(tracks)).ppf([tail, 1.0 - tail]) / len(tracks)).tolist()
    return {
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


def follow_drive(run: Run, known: KnownLines, settings: FilterSettings, seed: int) -> Track:
    """The track of one seed."""
    rng = np.random.default_rng(seed)
    noise = ProportionalNoise(settings.sigma)
    odometry = settings.odometry
    poses = run.trajectory.poses
    start = PoseEstimate(Pose(*poses[0].tolist()), np.zeros((3, 3)))
    # The start has the error, and the covariance, of an odometry increment.
    start = start.moved(odometry(np.zeros((1, 3)), rng)[0], odometry.covariance)
    # Eq. 7 has no floor; with one, near walls would get too little weight.
    ranges = RangeNoise.from_sigma(settings.sigma, 0.0, run.lrf.range_max)
    localiser = Localiser(
        known, start, range_noise=ranges, odometry_noise=odometry, strategy=settings.strategy
    )
    steps = odometry(odometry_increments(poses), rng)
    scans = (
        [noise(run.true_scan(index, laser=laser), rng) for laser in range(len(run.lasers))]
        for index in range(len(run))
    )
    return localise(localiser, scans, steps)
