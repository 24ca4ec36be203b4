import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, LaserScan, PlanarCaster, World
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.constants import END_DEVIATIONS
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.segmentation import fit_wall

LRF = LaserRangeFinder(0.1, 1.5, beams=41)


@given(st.integers(0, 10_000), st.floats(0.1, 0.5))
@settings(max_examples=40, deadline=None)
def test_a_noisy_end_is_moved_no_farther_than_its_noise_explains(seed, sigma):
    # Beams that run nearly along their wall would carry its end away.
    scan = PlanarCaster(World([[-1.0, 1.0, 40.0, 1.0]])).cast(LRF, (0, 0, 0))
    ranges = np.abs(scan.ranges + np.random.default_rng(seed).normal(0.0, sigma, LRF.beams))
    found = LikelihoodExtractor(20.0, sigma, 0.0).walls(
        LaserScan((0, 0, 0), LRF.angles, ranges), 0.0, RangeNoise(sigma, 0.0)
    )
    ends = found.ends.reshape(-1, 2)
    units = np.column_stack([np.cos(LRF.angles), np.sin(LRF.angles)])
    off = np.hypot(*(ends[:, None] - ranges[:, None] * units).transpose(2, 0, 1)).min(axis=1)
    assert (off <= END_DEVIATIONS * sigma).all()


def test_beams_in_one_direction_fit_the_wall_across_them():
    beams, ranges = np.tile([0.6, 0.8], (3, 1)), np.array([4.0, 5.0, 6.0])
    x, y = fit_wall(beams, ranges, 0.1 * ranges**2)
    assert (x, y) == pytest.approx((0.6 * np.mean(1 / ranges), 0.8 * np.mean(1 / ranges)))
    one = fit_wall(beams[:1], ranges[:1], np.array([0.1]))
    assert one == pytest.approx((0.6 / 4, 0.8 / 4))
