import numpy as np

from lrf3d import LaserScan
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.extraction import END_DEVIATIONS, LikelihoodExtractor


def test_a_noisy_end_is_moved_no_farther_than_its_noise_explains():
    # As near as this, noise makes beams run along the wall that is fitted, or away from it.
    angles, sigma, unmoved = np.linspace(0.5, 1.57, 41), 0.2, 0
    units = np.column_stack([np.cos(angles), np.sin(angles)])
    extract = LikelihoodExtractor(20.0, sigma, 0.0)
    for seed in range(300):
        noise = np.random.default_rng(seed).normal(0.0, sigma, 41)
        ranges = np.abs(0.1 / units[:, 1] + noise)
        found = extract.walls(LaserScan((0, 0, 0), angles, ranges), 0.0, RangeNoise(sigma, 0.0))
        apart = found.ends.reshape(-1, 2)[:, None] - ranges[:, None] * units
        off = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)
        assert (off <= END_DEVIATIONS * sigma).all()
        unmoved += np.count_nonzero(off < 1e-12)
    assert unmoved
