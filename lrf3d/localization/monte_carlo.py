"""Monte Carlo evaluation of the localisation on a known map.

A drive is followed with many seeds, each with its own start, range noise and odometry noise; the
output is the errors of the extended Kalman filter and its consistency.
"""

import os
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lrf3d.cores import process_pool
from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int
from lrf3d.interrupts import check, stoppable
from lrf3d.laser import ProportionalNoise, RangeNoise
from lrf3d.localization import (
    Localiser,
    OdometryNoise,
    PoseEstimate,
    Track,
    localise,
    odometry_increments,
)
from lrf3d.localization.lines import KnownLines
from lrf3d.pose import Pose
from lrf3d.progress import Progress, silent
from lrf3d.run import Run

MAPS = ("walls", "map")
"""The known map: the true walls, or the map that the run built."""

MAPPED_RANGE = 10.0
"""Typical range [m] of the points that a map is fitted to."""

NEES_CONFIDENCE = 0.95
"""Share of the averages over seeds that lie within the bounds for a consistent filter."""

FREEDOMS = 3
"""Numbers in a pose."""


@dataclass(frozen=True, eq=False)
class LocalisationTask:
    """A simulated drive, to be followed by odometry and scans alone.

    Args:
        run: The drive, with the true ranges.
        sigma: Noise of the ranges [m] at range_max.
        odometry: Noise of each increment; the start is as uncertain as one increment.
        known: ``walls`` for the true walls, ``map`` for the map of the run.
        strategy: Which lines are compared: ``seen-objects-first`` or ``all``.

    Raises:
        InputError: ``known`` is neither of the two.
    """

    run: Run
    sigma: float
    odometry: OdometryNoise = field(default_factory=OdometryNoise)
    known: str = "walls"
    strategy: str = "seen-objects-first"

    def __post_init__(self) -> None:
        if self.known not in MAPS:
            raise InputError(f"known {self.known!r}: expected one of {', '.join(MAPS)}")

    def known_lines(self) -> KnownLines:
        """The map that the robot is localised on."""
        if self.known == "walls":
            return KnownLines.from_world(self.run.world)
        deviation = self.sigma * MAPPED_RANGE / self.run.lrf.range_max
        return KnownLines.from_map(self.run.map, deviation=deviation)

    def follow(self, seed: int) -> Track:
        """The track of one seed."""
        rng = np.random.default_rng(seed)
        run, noise = self.run, ProportionalNoise(self.sigma)
        poses = run.trajectory.poses
        start = PoseEstimate(Pose(*poses[0].tolist()), np.zeros((3, 3)))
        covariance = self.odometry.covariance
        # The start has the error, and the covariance, of an odometry increment.
        start = start.moved(self.odometry(np.zeros((1, 3)), rng)[0], covariance)
        # Eq. 7 has no floor; with one, near walls would get too little weight.
        localiser = Localiser(
            self.known_lines(),
            start,
            range_noise=RangeNoise.from_sigma(self.sigma, 0.0, run.lrf.range_max),
            odometry_noise=self.odometry,
            strategy=self.strategy,
        )
        steps = self.odometry(odometry_increments(poses), rng)
        scans = (noise(run.true_scan(index), rng) for index in range(len(run)))
        return localise(localiser, scans, steps)


@dataclass(frozen=True, eq=False)
class LocalisationScore:
    """Errors over seeds (s) and scans (k), and the consistency of the filter.

    Args:
        errors: (s, k, 3) estimated less true pose: x, y [m], theta [rad].
        nees: (s, k) squared errors in units of the covariance.
        lines: (s, k) numbers of pairs of lines used.
        comparisons: (s, k) numbers of comparisons of lines.
    """

    errors: Float
    nees: Float
    lines: Int
    comparisons: Int

    @property
    def bounds(self) -> tuple[float, float]:
        """The 95 % interval of a consistent filter's NEES, averaged over the seeds."""
        from scipy.stats import chi2

        seeds = len(self.nees)
        tail = 0.5 * (1.0 - NEES_CONFIDENCE)
        averages = chi2(FREEDOMS * seeds)
        return float(averages.ppf(tail)) / seeds, float(averages.ppf(1.0 - tail)) / seeds

    def as_dict(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        distance = np.hypot(self.errors[..., 0], self.errors[..., 1])
        averages = self.nees.mean(axis=0)
        low, high = self.bounds
        return {
            "seeds": len(self.nees),
            "scans": self.nees.shape[1],
            "mean_position_error_m": float(distance.mean()),
            "rms_position_error_m": float(np.sqrt((distance**2).mean())),
            "share_of_errors_above_5_cm": float((distance > 0.05).mean()),
            "largest_position_error_m": float(distance.max()),
            "mean_heading_error_deg": float(np.degrees(np.abs(self.errors[..., 2]).mean())),
            "nees": {
                "mean": float(self.nees.mean()),
                "bounds_of_average_over_seeds": [low, high],
                "scans_within_bounds": float(((averages >= low) & (averages <= high)).mean()),
                "scans_above": float((averages > high).mean()),
                "scans_below": float((averages < low).mean()),
            },
            "lines_a_scan": float(self.lines.mean()),
            "comparisons_a_scan": float(self.comparisons.mean()),
        }


@stoppable()
def score_localisation(
    task: LocalisationTask,
    *,
    seeds: int = 100,
    workers: int | None = 1,
    progress: Progress = silent,
) -> LocalisationScore:
    """Follow a drive with many seeds.

    Args:
        task: The drive.
        seeds: Number of seeds, from 0.
        workers: Number of processes; None for one for each core, 1 for this process alone. The
            result does not depend on it.
        progress: Called with the number of finished seeds, and of all.

    Raises:
        InputError: The number of seeds is below 1.
    """
    if seeds < 1:
        raise InputError(f"{seeds} seeds: expected at least 1")
    # Other map snapshots are not needed, and would only be copied to the processes.
    run = task.run
    task = replace(
        task, run=replace(run, snapshot_scans=run.snapshot_scans[-1:], maps=run.maps[-1:])
    )
    tracks: dict[int, Track] = {}
    workers = min(seeds, os.cpu_count() or 1 if workers is None else workers)
    if workers == 1:
        for seed in range(seeds):
            tracks[seed] = task.follow(seed)
            progress(len(tracks), seeds)
            check()
    else:
        with process_pool(workers) as pool:
            futures = {pool.submit(task.follow, seed): seed for seed in range(seeds)}
            missing = set(futures)
            while missing:
                # A signal does not end this wait, so it ends now and then by itself.
                finished, missing = wait(missing, 0.1, FIRST_COMPLETED)
                for done in finished:
                    tracks[futures[done]] = done.result()
                progress(len(tracks), seeds)
                check()
    truth, ordered = run.trajectory.poses, [tracks[seed] for seed in range(seeds)]
    return LocalisationScore(
        np.array([track.errors(truth) for track in ordered]),
        np.array([track.nees(truth) for track in ordered]),
        np.array([track.lines for track in ordered]),
        np.array([track.comparisons for track in ordered]),
    )
