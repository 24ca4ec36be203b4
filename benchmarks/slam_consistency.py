"""Are the covariances of SLAM right, and does it ever close a false loop?

Drives with wheels that slip and drift are simulated in four worlds, with many seeds, and mapped
online. At some scans of each drive the error of the pose is compared with its covariance: the NEES
of three numbers, whose mean over the seeds is 3 for a covariance that is right. Run with::

    python -m benchmarks.slam_consistency --seeds 50
"""

from argparse import ArgumentParser
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

import lrf3d
from lrf3d.apps.cli.console import json_text
from lrf3d.base.cores import core_count, process_pool
from lrf3d.geometry.lines import Float, wrap_angle
from lrf3d.geometry.pose import between
from lrf3d.simulation.scenario import Scenario
from lrf3d.world import World
from lrf3d.world.generators import generate

LASER = lrf3d.LaserRangeFinder(beams=181, range_max=15.0)
"""The range finder of all drives."""

RANGE_SIGMA = 0.02
"""Noise of a range at the farthest one [m]."""

WHEEL_POSITION, WHEEL_HEADING, WHEEL_BIAS = 0.01, 0.004, 0.03
"""Noise of an increment [m], [rad], and the turn that the wheels add [rad/m]."""

MARKS = 12
"""Scans of each drive at which the covariance is compared with the error."""

FALSE_PLACE, FALSE_TURN = 0.5, 0.2
"""A closure that is off by more than this [m], [rad] is false."""

LEAST_INFORMATION = 1.0
"""Information [1/m²] of a direction that a closure fixes: a deviation of a metre at most."""


class _NoMap:
    """The map of the simulation itself is not looked at."""

    def update(self, scan: lrf3d.LaserScan) -> None:
        """Nothing."""


class Drive(NamedTuple):
    """Errors (m, 3) of the poses of a drive at the marks and their covariances (m, 3, 3).

    Weak is the share of the marks at which a direction is reported that the walls do not fix;
    closures are counted, and those of them that are false.
    """

    errors: Float
    covariances: Float
    weak: float
    closures: int
    false: int

    def squares(self, numbers: int = 3) -> Float:
        """NEES (m,) of the poses, or of the first numbers of them."""
        errors, covariances = self.errors[:, :numbers], self.covariances[:, :numbers, :numbers]
        solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
        return np.asarray((errors * solved).sum(axis=1))


def identical_rooms(count: int = 20) -> tuple[World, Float]:
    """A corridor with identical rooms of 5 m, and a route through all of them and back."""
    walls: list[list[float]] = [[0, 0, 5 * count, 0], [0, 0, 0, 2.4], [5 * count, 0, 5 * count, 6]]
    route = [(1.0, 1.2)]
    for x in range(0, 5 * count, 5):
        walls += [[x, 2.4, x + 2, 2.4], [x + 3, 2.4, x + 5, 2.4], [x, 2.4, x, 6], [x, 6, x + 5, 6]]
        walls += [[x + 1, 5, x + 2, 5], [x + 1, 5, x + 1, 6], [x + 2, 5, x + 2, 6]]
        route += [(x + 2.5, 1.2), (x + 2.5, 4.2), (x + 3.5, 4.4), (x + 2.5, 3.8), (x + 2.5, 1.2)]
    return World(walls), np.array([*route, (5.0 * count - 1.5, 1.2), (1.0, 1.0)])


def drive_of(world: str) -> tuple[World, Any]:
    """A world and the true drive through it, by its name."""
    if world == "identical rooms":
        rooms, route = identical_rooms()
        return rooms, lrf3d.follow_route(route, speed=0.8, dt=0.25)
    if world == "endless corridor":
        corridor = World([[-100.0, 0.0, 300.0, 0.0], [-100.0, 2.4, 300.0, 2.4]])
        return corridor, lrf3d.follow_route(np.array([(0, 1.2), (60, 1.2)]), speed=1.0, dt=0.25)
    plan = generate(world, seed=2)
    return plan, Scenario(world=plan).with_route(where="inside").trajectory()


WORLDS = ("identical rooms", "endless corridor", "office", "maze")
"""The worlds."""


def simulated(world: str, seed: int) -> Drive:
    """Map one drive, and compare it with the truth."""
    walls, path = drive_of(world)
    noise = lrf3d.ProportionalNoise(RANGE_SIGMA)
    run = lrf3d.simulate(walls, path, LASER, noise=noise, rng=seed, mapper=_NoMap())
    true = run.trajectory.poses
    increments = lrf3d.odometry_increments(true)
    wheels = lrf3d.OdometryNoise(WHEEL_POSITION, WHEEL_HEADING)
    measured = wheels(increments, np.random.default_rng(seed))
    measured[:, 2] += WHEEL_BIAS * increments[:, 0]
    slam = lrf3d.Slam(LASER, start=true[0])
    marks = set(np.linspace(len(true) // MARKS, len(true) - 1, MARKS).astype(int).tolist())
    errors, covariances, weak = [], [], []
    for number, scan in enumerate(run.scans):
        slam.update(scan, measured[number - 1] if number else np.zeros(3))
        if number in marks:
            error = np.array(slam.pose) - true[number]
            error[2] = wrap_angle(error[2])
            errors.append(error)
            covariances.append(slam.covariance())
            weak.append(slam.tracked[-1].weak)
    keys = true[slam.key_scans]
    false = 0
    for closure in slam.closures:
        # Like the information, along the axes of the old key scan.
        off = between(keys[closure.old], keys[closure.new]) - closure.relative
        off[2] = wrap_angle(off[2])
        off = fixed_part(off, closure.information)
        false += bool(np.hypot(off[0], off[1]) > FALSE_PLACE or abs(off[2]) > FALSE_TURN)
    marked = np.array(errors), np.array(covariances), float(np.mean(weak))
    return Drive(*marked, len(slam.closures), false)


def fixed_part(off: Float, information: Float) -> Float:
    """The part of an error (3,) in the directions that a closure fixes.

    Along a corridor it may say nothing, and so cannot be false there: see `LEAST_INFORMATION`.
    """
    values, vectors = np.linalg.eigh(information)
    vectors = vectors[:, values > LEAST_INFORMATION]
    return np.asarray(vectors @ (vectors.T @ off), dtype=np.float64)


def consistency(drives: list[Drive]) -> dict[str, float]:
    """The figures of all drives through one world."""
    squares = np.array([drive.squares() for drive in drives])
    errors = np.array([drive.errors for drive in drives])
    mean, freedom = squares.mean(axis=0), 3 * len(drives)
    low, high = (chi2.ppf(share, freedom) / len(drives) for share in (0.025, 0.975))
    return {
        "drives": len(drives),
        "nees_over_3": float(mean.mean() / 3.0),
        "scans_within_bounds": float(((mean >= low) & (mean <= high)).mean()),
        "scans_too_confident": float((mean > high).mean()),
        "places_within_95_percent_ellipse": float(
            np.mean([drive.squares(2) < chi2.ppf(0.95, 2) for drive in drives])
        ),
        "weak_direction_reported": float(np.mean([drive.weak for drive in drives])),
        "poses_beyond_99_percent": float((squares > chi2.ppf(0.99, 3)).mean()),
        "largest_error_m": float(np.hypot(errors[..., 0], errors[..., 1]).max()),
        "closures": sum(drive.closures for drive in drives),
        "false_closures": sum(drive.false for drive in drives),
    }


def main() -> None:
    """Measure how consistent SLAM is, and print it as JSON."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50, help="Drives through each world.")
    seeds = parser.parse_args().seeds
    found = {}
    with process_pool(core_count()) as pool:
        for world in WORLDS:
            found[world] = consistency(list(pool.map(partial(simulated, world), range(seeds))))
    print(json_text(found))


if __name__ == "__main__":
    main()
