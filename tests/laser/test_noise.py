import numpy as np
import pytest

import lrf3d
from lrf3d import LaserRangeFinder, LaserScan, LineMapper, PlanarCaster, World, simulate
from lrf3d.errors import InputError
from lrf3d.laser import (
    AngleNoise,
    Chain,
    ConstantNoise,
    DropOuts,
    Imperfections,
    IntensityNoise,
    Limits,
    MixedPixels,
    ProportionalNoise,
    Quantised,
)
from lrf3d.laser.imperfections import incidences, losses_by_light
from lrf3d.laser.noise import as_noise, at_sigma

LRF = LaserRangeFinder(-1.0, 1.0, 101, range_min=0.5, range_max=20.0)
WALL = PlanarCaster(World([[4.0, -50, 4.0, 50]])).cast(LRF, (0, 0, 0))
GAP = PlanarCaster(World([[5.0, -50, 5.0, 0.0], [10.0, 0.0, 10.0, 50]])).cast(LRF, (0, 0, 0))
EVERY = [
    AngleNoise(0.01),
    MixedPixels(0.05),
    DropOuts(0.1, 0.2, 0.3),
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


@pytest.mark.parametrize("noise", EVERY, ids=lambda noise: type(noise).__name__)
def test_what_did_not_return_stays_so_and_the_scan_that_enters_is_left_alone(noise):
    scan = scan_of([np.inf, -np.inf, np.inf, 3.0, np.inf])
    before = scan.ranges.copy()
    for seed in range(50):
        after = noise(scan, np.random.default_rng(seed)).ranges
        assert np.isinf(after[[0, 2, 4]]).all() and (after[[0, 2, 4]] > 0).all()
        assert after[1] == -np.inf and not np.isnan(after).any()
    assert np.array_equal(scan.ranges, before)


@pytest.mark.parametrize("noise", EVERY, ids=lambda noise: type(noise).__name__)
def test_the_same_seed_gives_the_same_scan_and_as_many_draws_whatever_is_seen(noise):
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    assert np.array_equal(noise(WALL, one).ranges, noise(WALL, np.random.default_rng(5)).ranges)
    noise(GAP, other)
    assert one.random() == other.random()


@pytest.mark.parametrize("noise", [ProportionalNoise(300.0), ConstantNoise(50.0)])
def test_what_noise_carries_below_zero_is_reported_as_zero(noise):
    measured = noise(WALL, np.random.default_rng(0)).ranges
    assert (measured == 0.0).sum() > 10 and (measured >= 0.0).all()
    for mode in ("robust", "paper"):
        world, poses = World([[4.0, -50, 4.0, 50]]), np.array([[0.0, 0, 0], [1, 0, 0]])
        run = simulate(world, poses, LRF, noise=noise, mapper=LineMapper(mode))
        assert np.isfinite(run.map.segments).all()


def test_constant_noise_is_the_same_near_and_far():
    draws = repeated(ConstantNoise(0.05), scan_of([1.0, 5.0, 19.0]))
    assert draws.std(axis=0) == pytest.approx([0.05] * 3, rel=0.05)
    assert draws.mean(axis=0) == pytest.approx([1, 5, 19], abs=0.004)
    assert ConstantNoise(0.0)(WALL, None) is WALL


def test_constant_and_proportional_noise_add_up_in_their_variances():
    both = Chain([ConstantNoise(0.03), ProportionalNoise(0.08)])
    draws = repeated(both, scan_of([1.0, 10.0, 16.0]))
    expected = np.hypot(0.03, 0.08 * np.array([0.05, 0.5, 0.8]))
    assert draws.std(axis=0) == pytest.approx(expected, rel=0.05)


def test_ranges_are_told_in_whole_steps_nearest_to_what_was_measured():
    ranges = np.linspace(0.01, 19.85, 501)
    told = Quantised(0.25)(scan_of(ranges), None).ranges
    assert np.abs(told - ranges).max() <= 0.125
    assert np.array_equal(told / 0.25, np.round(told / 0.25)) and len(np.unique(told)) == 80


def test_ranges_over_the_limits_are_told_after_rep_117():
    scan = scan_of([0.49, 0.5, 19.99, 20.01, -np.inf], range_min=0.5)
    assert Limits()(scan, None).ranges.tolist() == [-np.inf, 0.5, 19.99, np.inf, -np.inf]


def test_incidence_is_that_of_the_wall_and_unknown_for_a_lone_beam():
    assert incidences(WALL) == pytest.approx(np.abs(LRF.angles), abs=1e-12)
    assert incidences(scan_of([3.0, 4.0, 5.0], [0, 1, 2])).tolist() == [0.0, 0.0, 0.0]
    assert incidences(scan_of([3.0, 4.0, 5.0])).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("losses", "expected"),
    [
        (DropOuts(share=0.2), np.full(101, 0.2)),
        (DropOuts(far=0.6), 0.6 * (WALL.ranges / 20.0) ** 2),
        (DropOuts(grazing=0.5), 0.5 * (1.0 - np.cos(LRF.angles))),
        (DropOuts(0.1, 0.5, 0.5), None),
    ],
)
def test_beams_are_lost_as_often_as_their_probability_says(losses, expected):
    if expected is None:
        parts = [DropOuts(share=0.1), DropOuts(far=0.5), DropOuts(grazing=0.5)]
        expected = 1 - np.prod([1 - part.probabilities(WALL) for part in parts], axis=0)
    assert losses.probabilities(WALL) == pytest.approx(expected, abs=1e-9)
    lost = np.isposinf(repeated(losses, WALL)).mean(axis=0)
    # Five deviations of a share of 4000.
    assert (np.abs(lost - expected) <= 5 * np.sqrt(expected * (1 - expected) / 4000)).all()


def test_a_beam_that_is_lost_met_no_wall():
    after = DropOuts(share=0.5)(WALL, np.random.default_rng(0))
    assert (after.walls[np.isposinf(after.ranges)] == -1).all()
    assert np.array_equal(after.ranges[after.walls == 0], WALL.ranges[after.walls == 0])


def test_the_range_of_a_beam_that_looks_aside_is_that_of_the_wall_there():
    sigma, seed = 0.004, 3
    after = AngleNoise(sigma)(WALL, np.random.default_rng(seed)).ranges
    aside = LRF.angles + np.random.default_rng(seed).normal(0.0, sigma, 101)
    inside = np.abs(aside) <= 1.0
    assert after[inside] == pytest.approx(4.0 / np.cos(aside[inside]), rel=1e-12)
    assert np.abs(after - WALL.ranges).max() > 0.02


def test_beams_that_look_aside_do_so_by_sigma():
    draws = repeated(AngleNoise(0.003), WALL, 2000)
    beam = 80
    aside = np.arccos(4.0 / draws[:, beam])
    assert aside.std() == pytest.approx(0.003, rel=0.06)
    assert aside.mean() == pytest.approx(LRF.angles[beam], abs=3e-4)
    assert AngleNoise(0.0)(WALL, None) is WALL


def test_beside_an_edge_a_beam_that_looks_aside_meets_one_side_or_the_other():
    draws = repeated(AngleNoise(0.02), GAP, 500)[:, 48:53]
    nearest = np.minimum(abs(draws - 5.0), abs(draws - 10.0))
    assert nearest.max() < 0.1 and (draws > 7).any(axis=0).all() and (draws < 7).any(axis=0).all()


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
        after = MixedPixels(0.1, jump=0.5)(scan, rng)
        assert np.array_equal(after.ranges, scan.ranges)


def test_a_mixed_range_is_of_no_wall():
    after = MixedPixels(0.1)(GAP, np.random.default_rng(0))
    mixed = after.ranges != GAP.ranges
    assert 1 <= mixed.sum() <= 2 and (after.walls[mixed] == -1).all()
    assert np.array_equal(after.walls[~mixed], GAP.walls[~mixed])


def test_a_chain_works_in_its_order_and_an_empty_one_not_at_all():
    scan = scan_of([1.0, 2.0])
    assert Chain()(scan, None) is scan
    coarse_last = Chain([ConstantNoise(0.3), Quantised(0.5)])(scan, np.random.default_rng(1))
    assert np.array_equal(coarse_last.ranges * 2, np.round(coarse_last.ranges * 2))
    coarse_first = Chain([Quantised(0.5), ConstantNoise(0.3)])(scan, np.random.default_rng(1))
    assert not np.array_equal(coarse_first.ranges * 2, np.round(coarse_first.ranges * 2))


def test_what_is_off_is_not_in_the_chain():
    assert Imperfections().noise(0.04) == ProportionalNoise(0.04)
    assert Imperfections(resolution=0.01).noise(0.0) == Chain(
        [ProportionalNoise(0.0), Quantised(0.01), Limits()]
    )
    full = Imperfections(0.01, 0.1, 0.5, 0.01, 0.1, 0.1, 0.01).noise(0.04)
    kinds = [type(noise) for noise in full.noises]
    assert kinds == [type(noise) for noise in EVERY]
    told = full(WALL, np.random.default_rng(0))
    assert ((told.ranges >= 0.5) & (told.ranges <= 20.0) | np.isinf(told.ranges)).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda: ConstantNoise(-0.1),
        lambda: AngleNoise(np.nan),
        lambda: Quantised(0.0),
        lambda: DropOuts(share=1.1),
        lambda: DropOuts(grazing=-0.1),
        lambda: MixedPixels(0.0),
        lambda: MixedPixels(0.1, jump=np.inf),
    ],
)
def test_a_noise_that_makes_no_sense_is_refused(make):
    with pytest.raises(InputError, match="expected"):
        make()


def test_losses_by_range_want_a_range_max():
    with pytest.raises(InputError, match="range_max"):
        DropOuts(far=0.1)(scan_of([1.0], range_max=np.inf), np.random.default_rng(0))


def test_noise_grows_as_the_light_fades():
    angles, ranges = np.zeros(100_000), np.full(100_000, 9.0)
    for intensity in (4.0, 0.01):
        scan = lrf3d.LaserScan((0, 0, 0), angles, ranges, intensities=0.0 * ranges + intensity)
        measured = IntensityNoise(0.002)(scan, np.random.default_rng(0)).ranges
        assert np.std(measured) == pytest.approx(0.002 / np.sqrt(intensity), rel=0.01)
    with pytest.raises(InputError, match="scan without intensities"):
        IntensityNoise(0.1)(lrf3d.LaserScan((0, 0, 0), angles, ranges), np.random.default_rng(0))


def test_a_lost_beam_has_no_intensity():
    scan = lrf3d.LaserScan((0, 0, 0), [0.0], [5.0], range_max=9.0, intensities=[0.3])
    lost = DropOuts(share=1.0)(scan, np.random.default_rng(0))
    assert lost.intensities.tolist() == [0.0] and np.isinf(lost.ranges).all()


def test_a_noise_of_intensities_is_that_of_a_simulation():
    world = lrf3d.World([[5, -9, 5, 9]], materials=["dark cloth"])
    run = lrf3d.simulate(world, [(0, 0, 0), (1, 0, 0)], noise=IntensityNoise(0.001), rng=0)
    hit = np.isfinite(run.truth)
    assert (run.ranges[hit] != run.truth[hit]).all()


def test_what_takes_neither_a_scan_nor_a_scan_and_an_rng_is_no_noise():
    for wrong in (3, "0.1", lambda: None, lambda a, b, c: None):
        with pytest.raises(InputError, match="expected a function of a scan and an rng"):
            as_noise(wrong)


def test_another_sigma_goes_to_the_noise_that_grows_with_the_range():
    chain = Chain([ConstantNoise(0.01), ProportionalNoise(0.1)])
    assert repr(at_sigma(chain, 0.3)) == repr(Chain([ConstantNoise(0.01), ProportionalNoise(0.3)]))
    assert repr(at_sigma(ProportionalNoise(0.1), 0.3)) == repr(ProportionalNoise(0.3))
    for without in (ConstantNoise(0.1), Chain([ConstantNoise(0.1)])):
        with pytest.raises(InputError, match="no ProportionalNoise to give it to"):
            at_sigma(without, 0.3)


def test_losses_at_grazing_incidence_are_warned_of_where_light_decides():
    grazing, near = DropOuts(0.0, 0.0, 0.5), DropOuts(0.5)
    for noise in (grazing, Chain([near, grazing])):
        assert "noise.drop_outs_grazing has no effect" in losses_by_light(noise)
    for noise in (near, Chain([near]), ProportionalNoise(0.1)):
        assert losses_by_light(noise) is None
