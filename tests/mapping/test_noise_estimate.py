from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import (
    NOISE_UNIT,
    PER_DECADE,
    RESIDUAL_BINS,
    NoiseEstimate,
    count_residuals,
)  # fmt: skip

ROOM = lrf3d.World(
    [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0], [5, 3, 6, 3], [6, 3, 6, 5]]
)
ASSUMED = RangeNoise.from_sigma(0.04, 0.01, 80.0)


def learnt(noise, assumed=ASSUMED, floor=0.001, world=ROOM, every=None, count=30):
    """The noise learnt from scans from places in a world, with noise (floor, growth)."""
    rng, estimate = np.random.default_rng(0), NoiseEstimate(floor)
    lrf, caster, (low, high) = lrf3d.LaserRangeFinder(), lrf3d.PlanarCaster(world), world.bounds
    for _ in range(count):
        pose = (*rng.uniform(low + 1.0, high - 1.0), rng.uniform(-np.pi, np.pi))
        scan = caster.cast(lrf, pose)
        deviations = np.hypot(noise[0], noise[1] * np.where(scan.hits, scan.ranges, 0.0))
        ranges = np.abs(scan.ranges + rng.normal(0.0, 1.0, lrf.beams) * deviations)
        if every:
            ranges[::every] = np.inf
        known = estimate.update(replace(scan, ranges=ranges), assumed)
    return known


def deviation(noise, reach):
    return np.sqrt(noise.variance(np.array(reach)))


@pytest.mark.parametrize("factor", [0.01, 0.1, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("noise", [(0.005, 0.0), (0.03, 0.0), (0.004, 0.01), (0.002, 0.03)])
def test_the_noise_of_a_room_is_found_whatever_was_assumed(noise, factor):
    known = learnt(noise, RangeNoise(0.01 * factor, 0.0005 * factor))
    for reach in (2.0, 5.0, 8.0):
        assert deviation(known, reach) == pytest.approx(
            np.hypot(*noise * np.array([1, reach])), rel=0.25
        )


def test_neither_clutter_nor_lost_beams_hide_noise_and_the_floor_is_kept():
    rng = np.random.default_rng(3)
    posts = rng.uniform(1.0, 7.0, (40, 2))
    walls = np.hstack([posts, posts + rng.uniform(-0.4, 0.4, (40, 2))])
    cluttered = lrf3d.World(np.vstack([ROOM.segments, walls]))
    known = learnt((0.02, 0.0), world=cluttered, count=60)
    assert deviation(known, 4.0) == pytest.approx(0.02, rel=0.5)
    for every in (2, 3):
        assert deviation(learnt((0.02, 0.0), every=every), 4.0) == pytest.approx(0.02, rel=0.3)
    assert learnt((0.0, 0.0), floor=0.01).floor == 0.01


def test_scans_that_show_nothing_leave_what_was_assumed():
    angles, nothing = np.repeat(np.linspace(-1.0, 1.0, 9), 6), np.full(54, np.inf)
    known = NoiseEstimate(0.001).update(lrf3d.LaserScan((0, 0, 0), angles, nothing), ASSUMED)
    reaches = [1.0, 40.0]
    assert deviation(known, reaches) == pytest.approx(deviation(ASSUMED, reaches), rel=0.05)
    # Beams in one direction say nothing of each other.
    ranges = np.full(54, 3.0)
    ranges[2::6] = 3.001
    other = NoiseEstimate(0.001).update(lrf3d.LaserScan((0, 0, 0), angles, ranges), ASSUMED)
    assert other == known


@pytest.mark.parametrize("sigma", [0.0004, 4.0, None])
def test_a_map_is_as_good_with_a_wrong_sigma(sigma):
    scenario = lrf3d.load_scenario("paper_room")
    right = lrf3d.score_run(scenario.run(rng=0))
    score = lrf3d.score_run(scenario.run(rng=0, mapper=lrf3d.LineMapper(sigma=sigma)))
    assert score.length_f1 > right.length_f1 - 0.01
    assert score.segment_f1 > right.segment_f1 - 0.05


def test_deviations_are_standard_normal_times_the_noise_however_beams_are_spread():
    rng, sigma, counts = np.random.default_rng(0), 0.02, np.zeros((1, RESIDUAL_BINS), np.int64)
    for _ in range(40):
        # A wall at x = 5, and one at 9 m on both sides, seen by pairs of beams.
        angles = np.linspace(-0.8, 0.8, 81)
        angles[::2] += 0.012
        ranges = np.where(np.abs(angles) < 0.4, 5.0, 9.0) / np.cos(angles)
        ranges += sigma * rng.normal(size=81)
        count_residuals(angles, ranges, RangeNoise(sigma, 0.0), np.array([0.1, 8.0]), counts)
    sizes = NOISE_UNIT * 10.0 ** ((np.arange(RESIDUAL_BINS) + 0.5) / PER_DECADE)
    within = np.cumsum(counts[0]) / counts.sum()
    assert counts.sum() > 800
    assert sizes[np.searchsorted(within, 0.5)] == pytest.approx(0.6745 * sigma, rel=0.08)
    assert sizes[np.searchsorted(within, 0.95)] == pytest.approx(1.96 * sigma, rel=0.08)
