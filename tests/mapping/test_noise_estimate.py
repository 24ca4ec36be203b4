import numpy as np
import pytest

import lrf3d
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import NoiseEstimate

ROOM = lrf3d.World(
    [[0, 0, 12, 0], [12, 0, 12, 8], [12, 8, 0, 8], [0, 8, 0, 0], [5, 3, 6, 3], [6, 3, 6, 5]]
)
ASSUMED = RangeNoise.from_sigma(0.04, 0.01, 80.0)


def scans_of(world, noise, count=30, seed=0, lrf=None):
    """Scans of a world from places in it, with noise (floor, growth)."""
    rng = np.random.default_rng(seed)
    lrf = lrf3d.LaserRangeFinder() if lrf is None else lrf
    caster = lrf3d.PlanarCaster(world)
    low, high = world.bounds
    for _ in range(count):
        pose = (*rng.uniform(low + 1.0, high - 1.0), rng.uniform(-np.pi, np.pi))
        scan = caster.cast(lrf, pose)
        deviations = np.hypot(noise[0], noise[1] * np.where(scan.hits, scan.ranges, 0.0))
        yield lrf3d.LaserScan(
            pose, scan.angles, np.abs(scan.ranges + rng.normal(0.0, 1.0, lrf.beams) * deviations)
        )


def learnt(scans, assumed=ASSUMED, floor=0.001):
    estimate = NoiseEstimate(floor)
    for scan in scans:
        estimate.update(scan, assumed)
    return estimate


@pytest.mark.parametrize("factor", [0.01, 0.1, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("noise", [(0.005, 0.0), (0.03, 0.0), (0.004, 0.01), (0.002, 0.03)])
def test_the_noise_of_a_room_is_found_whatever_was_assumed(noise, factor):
    assumed = RangeNoise(0.01 * factor, 0.0005 * factor)
    known = learnt(scans_of(ROOM, noise), assumed).known
    for reach in (2.0, 5.0, 8.0):
        expected = np.hypot(noise[0], noise[1] * reach)
        assert np.sqrt(known.variance(np.array(reach))) == pytest.approx(expected, rel=0.25)


def test_what_stands_about_changes_it_little():
    rng = np.random.default_rng(3)
    posts = rng.uniform(1.0, 7.0, (40, 2))
    walls = np.hstack([posts, posts + rng.uniform(-0.4, 0.4, (40, 2))])
    cluttered = lrf3d.World(np.vstack([ROOM.segments, walls]))
    known = learnt(scans_of(cluttered, (0.02, 0.0), count=60)).known
    assert np.sqrt(known.variance(np.array(4.0))) == pytest.approx(0.02, rel=0.5)


@pytest.mark.parametrize("every", [2, 3])
def test_lost_beams_hide_no_noise(every):
    def thinned():
        for scan in scans_of(ROOM, (0.02, 0.0)):
            ranges = scan.ranges.copy()
            ranges[::every] = np.inf
            yield lrf3d.LaserScan(scan.pose, scan.angles, ranges)

    known = learnt(thinned()).known
    assert np.sqrt(known.variance(np.array(4.0))) == pytest.approx(0.02, rel=0.3)


def test_scans_that_show_nothing_leave_what_was_assumed():
    angles = np.linspace(-1.0, 1.0, 9)
    estimate = NoiseEstimate(0.001)
    known = estimate.update(lrf3d.LaserScan((0, 0, 0), angles, np.full(9, np.inf)), ASSUMED)
    assert np.sqrt(known.variance(np.array([1.0, 40.0]))) == pytest.approx(
        np.sqrt(ASSUMED.variance(np.array([1.0, 40.0]))), rel=0.05
    )


def test_beams_in_one_direction_say_nothing_of_each_other():
    angles = np.repeat(np.linspace(-1.0, 1.0, 9), 6)
    ranges = np.full(54, 3.0)
    ranges[2::6] = 3.001
    estimate = NoiseEstimate(0.001)
    estimate.update(lrf3d.LaserScan((0, 0, 0), angles, ranges), ASSUMED)
    assert estimate.known == NoiseEstimate(0.001).update(
        lrf3d.LaserScan((0, 0, 0), angles, np.full(54, np.inf)), ASSUMED
    )


def test_the_floor_is_kept():
    assert learnt(scans_of(ROOM, (0.0, 0.0)), floor=0.01).known.floor == 0.01


@pytest.mark.parametrize("sigma", [0.0004, 0.4, 4.0, None])
def test_a_map_is_as_good_with_a_wrong_sigma(sigma):
    scenario = lrf3d.load_scenario("paper_room")
    right = lrf3d.score_run(scenario.run(rng=0))
    score = lrf3d.score_run(scenario.run(rng=0, mapper=lrf3d.LineMapper(sigma=sigma)))
    assert score.length_f1 > right.length_f1 - 0.01
    assert score.segment_f1 > right.segment_f1 - 0.05
