import numpy as np
import pytest

from benchmarks.vertex_fit import fit_vertices
from lrf3d import LaserRangeFinder, LaserScan, PlanarCaster, World

CIRCLE = LaserRangeFinder(-np.pi, np.pi - 2 * np.pi / 180, beams=180, range_max=30.0)
HEXAGON = np.array([[4, 0], [3, 3], [-1, 4], [-4, 1], [-3, -3], [2, -4.0]])
ROOM = World(np.hstack([HEXAGON, np.roll(HEXAGON, -1, axis=0)]))


def noisy(scan, sigma, seed):
    ranges = scan.ranges + np.random.default_rng(seed).normal(0.0, sigma, len(scan.ranges))
    return LaserScan(scan.pose, scan.angles, ranges, range_max=scan.range_max)


def count(polylines):
    closed = [len(line) > 2 and np.allclose(line[0], line[-1]) for line in polylines]
    return sum(len(line) - ends for line, ends in zip(polylines, closed, strict=True))


@pytest.mark.parametrize(("theta", "seed"), [(-3.0, 0), (0.4, 1), (2.2, 2)])
def test_the_corners_of_a_room_are_found(theta, seed):
    scan = noisy(PlanarCaster(ROOM).cast(CIRCLE, (0.2, -0.3, theta)), 0.01, seed)
    (polyline,) = fit_vertices(scan, 6)
    assert np.allclose(polyline[0], polyline[-1]) and len(polyline) == 7
    away = np.hypot(*(polyline[:-1, None] - HEXAGON[None]).transpose(2, 0, 1)).min(axis=0)
    assert away.max() < 0.1


def test_there_are_never_more_vertices_than_asked_for():
    boxes = World(np.array([[5, -3, 5, -1], [7, 0, 6, 2], [9, -9, 9, 9], [3, 2, 4, 3.0]]))
    scan = noisy(PlanarCaster(boxes).cast(LaserRangeFinder(range_max=30.0), (0, 0, 0)), 0.02, 0)
    closed = noisy(PlanarCaster(ROOM).cast(CIRCLE, (0, 0, 0)), 0.02, 0)
    for vertices in (2, 3, 5, 10, 30):
        assert count(fit_vertices(scan, vertices, gap=1.0)) <= vertices
        assert count(fit_vertices(closed, vertices)) <= vertices


def test_a_gap_is_not_bridged():
    lrf = LaserRangeFinder(range_max=30.0)
    boxes = World(np.array([[5, -4, 5, -1], [5, 1, 5, 4.0]]))
    polylines = fit_vertices(PlanarCaster(boxes).cast(lrf, (0, 0, 0)), 4, gap=1.0)
    assert len(polylines) == 2
    assert all((np.abs(line[:, 1]) > 0.9).all() for line in polylines)
