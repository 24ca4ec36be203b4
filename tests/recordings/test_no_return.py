import numpy as np
import pytest

from lrf3d import LaserScan, load_log
from lrf3d.recordings.repair.no_return import NO_RETURN

ANGLES = np.linspace(-1.0, 1.0, 21)


def scans_of(rng, ranges):
    return [LaserScan((0, 0, 0), ANGLES, ranges(rng)) for _ in range(100)]


def open_ahead(rng, farthest=6.0, open_space=8.0):
    ranges = rng.uniform(1.0, farthest, 21)
    ranges[8:12] = open_space
    return ranges


@pytest.mark.parametrize(
    "ranges",
    [
        lambda rng: rng.uniform(1.0, 6.0, 21),
        lambda rng: np.linspace(1.0, 8.0, 21),
        lambda rng: np.full(21, np.inf),
        # A corner that a robot at rest reads with one beam in each scan.
        lambda rng: np.append(rng.uniform(1.0, 6.0, 20), 8.0),
        # A wall seen at a right angle, at the range of its other beams.
        lambda rng: 5.0 / np.cos(np.clip(ANGLES, -0.6, 0.6)) + rng.normal(0, 0.01, 21),
    ],
)
def test_ranges_of_walls_are_kept(ranges):
    scans = scans_of(np.random.default_rng(0), ranges)
    assert NO_RETURN.find(scans) is None


def test_open_space_stands_out_though_many_walls_are_nearly_as_far():
    scans = scans_of(np.random.default_rng(0), lambda rng: open_ahead(rng, 8.0))
    assert NO_RETURN.find(scans).far > 7.98


@pytest.mark.parametrize(
    "declared, far, other, spread",
    [
        (8.0, 7.8, 6.0, lambda rng: 8.0 - 0.15 * rng.random(6)),
        (np.inf, None, 6.0, lambda rng: 8.0 - 0.15 * rng.random(6)),
        # A wall near the limit of a laser that marks no return.
        (8.0, None, np.inf, lambda rng: 8.0 - 0.15 * rng.random(6)),
        # Readings that spread as a bell does.
        (8.0, 7.8, 6.0, lambda rng: np.minimum(rng.normal(7.9, 0.03, 6), 7.999)),
    ],
)
def test_no_return_may_spread_over_a_band_below_the_declared_range(declared, far, other, spread):
    rng = np.random.default_rng(0)
    ranges = rng.uniform(1.0, 6.0, (100, 21))
    ranges[:, -1] = other
    for row in ranges:
        row[(first := rng.integers(0, 15)) : first + 6] = spread(rng)
    scans = [LaserScan((0, 0, 0), ANGLES, row, range_max=declared) for row in ranges]
    limits = NO_RETURN.find(scans)
    assert limits is None if far is None else far < limits.far < 7.86


def test_a_smallest_reading_that_many_adjacent_beams_have_is_no_return():
    scans = scans_of(np.random.default_rng(0), lambda rng: open_ahead(rng, open_space=0.12))
    limits = NO_RETURN.find(scans)
    scans = NO_RETURN.apply(scans, limits)
    assert NO_RETURN.sentence(limits) == "readings up to 0.12 m mean no return"
    assert all((scan.ranges == -np.inf).nonzero()[0].tolist() == [8, 9, 10, 11] for scan in scans)


def test_a_log_that_writes_8_metres_for_beams_that_met_nothing(tmp_path):
    path, rng = tmp_path / "short.log", np.random.default_rng(0)
    with path.open("w") as file:
        for number in range(100):
            ranges = " ".join(f"{r:.2f}" for r in open_ahead(rng))
            file.write(f"FLASER 21 {ranges} 0 0 0 0 0 0 {number} host {number}\n")
    assert np.isinf([scan.ranges[8:12] for scan in load_log(path).scans]).all()
    for options in ({"largest_range": 80.0}, {"without_repairs": ["no_return"]}):
        kept = load_log(path, **options)
        assert (np.array([scan.ranges[8:12] for scan in kept.scans]) == 8.0).all()
