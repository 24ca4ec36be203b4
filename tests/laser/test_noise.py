import dataclasses

import numpy as np
import pytest

import lrf3d
from lrf3d import InputError, LaserRangeFinder, LaserScan, LineMapper, PlanarCaster, World, simulate
from lrf3d.laser import (
    AngleNoise,
    Chain,
    ConstantNoise,
    DropOuts,
    Limits,
    MixedPixels,
    ProportionalNoise,
    Quantised,
    imperfect,
    with_ranges,
)
from lrf3d.laser.noise import at_sigma
from lrf3d.laser.scan import ScanBatch

LRF = LaserRangeFinder(-1.0, 1.0, 101, range_min=0.5, range_max=20.0)
WALL = PlanarCaster(World([[4.0, -50, 4.0, 50]])).cast(LRF, (0, 0, 0))
BATCH = ScanBatch(np.zeros(2), np.ones((2, 2)), np.zeros((2, 2), np.int32), 0.0, 9.0)
GAP_WORLD = World([[5.0, -50, 5.0, 0.0], [10.0, 0.0, 10.0, 50]])
GAP = PlanarCaster(GAP_WORLD).cast(LRF, (0, 0, 0))
EVERY = [
    AngleNoise(0.01),
    MixedPixels(0.05),
    DropOuts(0.1, 0.2),
    ConstantNoise(0.1),
    ProportionalNoise(0.1),
    Quantised(0.1),
    Limits(),
]


def scan_of(ranges, walls=None, **limits):
    angles = np.linspace(-1, 1, len(ranges))
    return LaserScan((0, 0, 0), angles, ranges, walls, **{"range_max": 20.0, **limits})


def repeated(noise, scan, times=4000, seed=0):
    rng = np.random.default_rng(seed)
    return np.array([noise(scan, rng).ranges for _ in range(times)])


@pytest.mark.parametrize("noise", [ProportionalNoise(300.0), ConstantNoise(50.0)])
def test_what_noise_carries_below_zero_is_reported_as_zero(noise):
    measured = noise(WALL, np.random.default_rng(0)).ranges
    assert (measured == 0.0).sum() > 10 and (measured >= 0.0).all()
    for mode in ("robust", "paper"):
        world, poses = World([[4.0, -50, 4.0, 50]]), np.array([[0.0, 0, 0], [1, 0, 0]])
        run = simulate(world, poses, LRF, noise=noise, mapper=LineMapper(mode))
        assert np.isfinite(run.map.segments).all()


def test_constant_and_proportional_noise_add_up_in_their_variances():
    both = Chain([ConstantNoise(0.03), ProportionalNoise(0.08)])
    draws = repeated(both, scan_of([1.0, 10.0, 16.0, np.inf, -np.inf]))
    expected = np.hypot(0.03, 0.08 * np.array([0.05, 0.5, 0.8]))
    assert draws[:, :3].std(axis=0) == pytest.approx(expected, rel=0.05)
    assert draws[:, :3].mean(axis=0) == pytest.approx([1, 10, 16], abs=0.005)
    assert (draws[:, 3:] == [np.inf, -np.inf]).all()


def test_ranges_are_told_in_whole_steps_nearest_to_what_was_measured():
    ranges = np.linspace(0.01, 19.85, 501)
    told = Quantised(0.25)(scan_of(ranges), None).ranges
    assert np.abs(told - ranges).max() <= 0.125
    assert np.array_equal(told / 0.25, np.round(told / 0.25)) and len(np.unique(told)) == 80


def test_ranges_over_the_limits_are_told_after_rep_117():
    scan = scan_of([0.49, 0.5, 19.99, 20.01, -np.inf], range_min=0.5)
    assert scan.hits.sum() == 3 and Limits()(scan, None).hits.sum() == 2
    assert Limits()(scan, None).ranges.tolist() == [-np.inf, 0.5, 19.99, np.inf, -np.inf]


@pytest.mark.parametrize(
    ("losses", "expected"),
    [
        (DropOuts(share=0.2), np.full(101, 0.2)),
        (DropOuts(far=0.6), 0.6 * (WALL.ranges / 20.0) ** 2),
        (DropOuts(0.1, 0.5), 1.0 - 0.9 * (1.0 - 0.5 * (WALL.ranges / 20.0) ** 2)),
    ],
)
def test_beams_are_lost_as_often_as_their_probability_says(losses, expected):
    lost = np.isposinf(repeated(losses, WALL)).mean(axis=0)
    # Five deviations of a share of 4000.
    assert (np.abs(lost - expected) <= 5 * np.sqrt(expected * (1 - expected) / 4000)).all()


@pytest.mark.parametrize("sigma", [0.004, 0.1], ids=["between neighbours", "past other beams"])
def test_the_range_of_a_beam_that_looks_aside_is_that_of_the_wall_there(sigma):
    seed = 3
    after = AngleNoise(sigma)(WALL, np.random.default_rng(seed)).ranges
    aside = LRF.angles + np.random.default_rng(seed).normal(0.0, sigma, 101)
    inside = np.abs(aside) <= 1.0
    assert after[inside] == pytest.approx(4.0 / np.cos(aside[inside]), rel=1e-12)
    assert np.abs(after - WALL.ranges).max() > 0.02


def test_ranges_at_an_edge_are_mixed_as_wide_as_the_beam():
    step = LRF.angles[1] - LRF.angles[0]
    draws = repeated(MixedPixels(0.5 * step), GAP)
    near, far = np.searchsorted(GAP.ranges > 7, True) - 1, np.searchsorted(GAP.ranges > 7, True)
    others = np.delete(np.arange(101), [near, far])
    assert np.array_equal(draws[0][others], GAP.ranges[others])
    a, b = GAP.ranges[[near, far]]
    # The edge lies within a quarter of a step of the beam in a quarter of all cases.
    for beam, own, other in ((near, a, b), (far, b, a)):
        share = (draws[:, beam] - own) / (other - own)
        assert share.min() == 0.0 and 0.45 < share.max() <= 0.5
        assert (share > 0).mean() == pytest.approx(0.25, abs=0.03)
        assert share[share > 0].mean() == pytest.approx(0.25, abs=0.02)
    assert not ((draws[:, near] > a) & (draws[:, far] < b)).any()


def test_nothing_is_mixed_where_there_is_no_edge():
    rng = np.random.default_rng(0)
    corner = PlanarCaster(World([[4.0, -50, 4, 1], [4, 1, -50, 1]])).cast(LRF, (0, 0, 0))
    for scan in (WALL, corner, scan_of([1.0, np.inf, 5.0, -np.inf, 2.0])):
        assert np.array_equal(MixedPixels(0.1, jump=0.5)(scan, rng).ranges, scan.ranges)


def test_a_chain_works_in_its_order_and_an_empty_one_not_at_all():
    scan = scan_of([1.0, 2.0])
    assert Chain()(scan, None) is scan
    coarse_last = Chain([ConstantNoise(0.3), Quantised(0.5)])(scan, np.random.default_rng(1))
    assert np.array_equal(coarse_last.ranges * 2, np.round(coarse_last.ranges * 2))
    coarse_first = Chain([Quantised(0.5), ConstantNoise(0.3)])(scan, np.random.default_rng(1))
    assert not np.array_equal(coarse_first.ranges * 2, np.round(coarse_first.ranges * 2))


def test_a_chain_for_many_scans_at_once_has_the_distribution_of_one_after_the_other():
    chain, count = Chain(EVERY), 1500
    rows = (np.tile(values, (count, 1)) for values in (GAP.ranges, GAP.walls))
    together = chain(ScanBatch(GAP.angles, *rows, GAP.range_min, GAP.range_max), 1).ranges
    alone = repeated(chain, GAP, count)
    lost = [np.isinf(ranges).mean(axis=0) for ranges in (together, alone)]
    assert np.abs(lost[0] - lost[1]).max() < 5.0 * np.sqrt(2.0 * 0.3 * 0.7 / count)
    returned = [np.where(np.isinf(ranges), np.nan, ranges) for ranges in (together, alone)]
    spreads = [np.nanstd(ranges, axis=0) for ranges in returned]
    # At the edge a few beams that look past it decide on the spread.
    away = np.abs(np.arange(101) - 50) > 4
    assert spreads[0][away] == pytest.approx(spreads[1][away], rel=0.15)
    off = np.nanmean(returned[0], axis=0) - np.nanmean(returned[1], axis=0)
    assert (np.abs(off) < 5.0 * np.maximum(*spreads) * np.sqrt(2.0 / (0.7 * count))).all()


def test_another_sigma_goes_to_the_noise_that_grows_with_the_range():
    chain = Chain([ConstantNoise(0.01), ProportionalNoise(0.1)])
    assert repr(at_sigma(chain, 0.3)) == repr(Chain([ConstantNoise(0.01), ProportionalNoise(0.3)]))
    assert repr(at_sigma(ProportionalNoise(0.1), 0.3)) == repr(ProportionalNoise(0.3))
    for without in (ConstantNoise(0.1), Chain([ConstantNoise(0.1)])):
        with pytest.raises(InputError, match="no ProportionalNoise to give it to"):
            at_sigma(without, 0.3)


def test_what_is_off_is_not_in_the_chain():
    assert imperfect(0.04) == ProportionalNoise(0.04)
    full = imperfect(
        0.04, constant=0.01, angle_deg=0.1, beam_deg=0.5, drop_outs=0.01, resolution=0.01
    )
    assert [type(noise) for noise in full.noises] == [type(noise) for noise in EVERY]
    told = full(WALL, np.random.default_rng(0))
    assert ((told.ranges >= 0.5) & (told.ranges <= 20.0) | np.isinf(told.ranges)).all()


@pytest.mark.parametrize("part", [DropOuts(far=0.1), ProportionalNoise(0.1)])
def test_what_grows_up_to_range_max_needs_one(part):
    with pytest.raises(InputError, match="range_max"):
        part(scan_of([1.0], range_max=np.inf), np.random.default_rng(0))


@pytest.mark.parametrize("off", [ProportionalNoise(0.0), ConstantNoise(0.0), AngleNoise(0.0)])
def test_no_noise_gives_the_scan_itself_and_draws_nothing(off):
    rng = np.random.default_rng(1)
    assert off(WALL, rng) is WALL
    assert rng.normal() == np.random.default_rng(1).normal()


@pytest.mark.parametrize(
    "change", [with_ranges, lambda scan, ranges: dataclasses.replace(scan, ranges=ranges)]
)
def test_own_noise_below_the_nearest_range_is_too_near_as_with_any_laser(change):
    near = World([[0.7, -5, 0.7, 5], [4.0, -5, 4.0, 5]])

    def own(scan, rng):
        return change(scan, scan.ranges + np.linspace(-2.0, 0.0, 101))

    run = simulate(near, [(0, 0, 0)], LRF, noise=own, mapper=LineMapper())
    moved = run.truth[0] + np.linspace(-2.0, 0.0, 101)
    assert np.array_equal(run.ranges[0], np.where(moved < 0.5, -np.inf, moved))
    assert (moved < 0.0).any() and (run.ranges[0] > 0.0).any()


WRONG = {
    "sigma -0.1": lambda: ConstantNoise(-0.1),
    "sigma nan": lambda: AngleNoise(np.nan),
    "resolution 0.0": lambda: Quantised(0.0),
    "share 1.1": lambda: DropOuts(share=1.1),
    "divergence 0.0": lambda: MixedPixels(0.0),
    "jump inf": lambda: MixedPixels(0.1, jump=np.inf),
    "threshold 'a'": lambda: MixedPixels(0.1, threshold="a"),
    "echo: there is no 'middle'": lambda: MixedPixels(0.1, echo="middle"),
    "ranges .2": lambda: with_ranges(WALL, [1.0, 2.0]),
    "ranges .3": lambda: with_ranges(BATCH, [1.0, 2.0, 3.0]),
    "resolution -1": lambda: imperfect(0.1, resolution=-1),
    "share 2.0": lambda: imperfect(0.1, drop_outs=2.0),
    "chain of 3": lambda: Chain(3),
    "rng 'a'": lambda: ConstantNoise(0.1)(WALL, "a"),
    "rng 1.5": lambda: lrf3d.simulate_fleet(GAP_WORLD, [], rng=1.5),
    "scans 'a'": lambda: simulate(lrf3d.load_scenario("paper_room"), scans="a"),
    "snapshots 'a'": lambda: simulate(GAP_WORLD, [(0, 0, 0)], snapshots="a"),
    "obstacle 'a'": lambda: simulate(GAP_WORLD, [(0, 0, 0)], obstacles="a"),
    "noise 3": lambda: Chain([3]),
    "noise <function": lambda: simulate(GAP_WORLD, [(0, 0, 0)], noise=lambda scan: scan),
    "range finder 'a'": lambda: PlanarCaster(GAP_WORLD).cast("a", (0, 0, 0)),
    "range finder None": lambda: lrf3d.EmbreeCaster(GAP_WORLD).cast_batch(None, [(0, 0, 0)]),
    "elevations": lambda: lrf3d.EmbreeCaster(GAP_WORLD).cast_layers(LRF, (0, 0, 0), "a"),
    "pitch 'a'": lambda: lrf3d.EmbreeCaster(GAP_WORLD).cast_layers(LRF, (0, 0, 0), pitch="a"),
    "evenly": LaserScan((0, 0, 0), [0.0, 0.1, 0.3], [1, 1, 1]).as_ros,
    "mapper.*update": lambda: simulate(GAP_WORLD, [(0, 0, 0)], mapper=object()),
    "world 'a'": lambda: lrf3d.crosscheck("a", LRF, [(0, 0, 0)]),
    "map 'a'": lambda: lrf3d.KnownLines.from_map("a"),
    "run 'a'": lambda: lrf3d.score_run("a"),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_makes_no_sense_is_refused_in_one_line(said):
    with pytest.raises(InputError, match=said) as raised:
        WRONG[said]()
    assert "\n" not in str(raised.value)
