"""What no range finder measures and no user means costs nothing, or is refused in one line."""

import numpy as np
import pytest

from lrf3d import (
    InputError,
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    ProportionalNoise,
    World,
)
from lrf3d.laser.free_space import free_cells

CORNER = World([[3, -5, 3, 5], [3, 5, -3, 5]])
LRF = LaserRangeFinder()


def scan_with(ranges, pose=(0, 0, 0), **settings):
    return LaserScan(pose, LRF.angles, ranges, **settings)


@pytest.mark.parametrize("mode", ["robust", "paper"])
@pytest.mark.parametrize("reach", [3.4028234663852886e38, 1e20, 2000.0])
def test_a_reach_beyond_what_beams_hit_means_no_return(mode, reach):
    ranges = PlanarCaster(CORNER).cast(LRF, (0, 0, 0)).ranges
    far, usual = LineMapper(mode, sigma=0.01), LineMapper(mode, sigma=0.01)
    far.update(scan_with(ranges, range_max=reach))
    usual.update(scan_with(ranges, range_max=80.0))
    assert np.allclose(far.map.segments, usual.map.segments, atol=1e-3) and len(far.map) == 2


def test_a_very_large_noise_still_makes_a_map():
    mapper, rng = LineMapper(sigma=20.0), np.random.default_rng(0)
    for k in range(12):
        scan = PlanarCaster(CORNER).cast(LRF, (0.1 * k, 0, 0))
        mapper.update(ProportionalNoise(20.0)(scan, rng))
    assert np.isfinite(mapper.map.segments).all()


@pytest.mark.parametrize(
    "settings",
    [
        {"merge_length": 1e9},
        {"sigma": "a"},
        {"min_points": 2.5},
        {"gap": 0.0},
        {"split": -1.0},
        {"merge_length": np.nan},
        {"mode": "best"},
    ],
)
def test_settings_out_of_reason_are_refused_in_one_line(settings):
    with pytest.raises(InputError, match=next(iter(settings))) as caught:
        LineMapper(**settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("mode", ["robust", "paper"])
@pytest.mark.parametrize("scan", [None, 3.0, "scan"])
def test_what_is_no_scan_is_refused_in_one_line(mode, scan):
    with pytest.raises(InputError, match="LaserScan"):
        LineMapper(mode).update(scan)


def test_poses_far_apart_make_a_map_and_free_cells():
    places = [(0.0, 0.0), *[(447_500.0 + 0.5 * k, 5_800_000.0) for k in range(3)]]
    scans, mapper = [], LineMapper()
    for x, y in places:
        world = World(CORNER.segments + np.tile([x, y], 2))
        scans.append(PlanarCaster(world).cast(LRF, (x, y, 0.0)))
        mapper.update(scans[-1])
    cells = free_cells(scans)
    assert cells.resolution == pytest.approx(0.1)
    assert cells.contain(np.array([[447_502.0, 5_800_000.0], [2.0, 0.0]])).tolist() == [True, False]
    assert (np.abs(mapper.map.segments[:, 0]) < 10.0).any()
    assert (mapper.map.segments[:, 0] > 447_000.0).any()
