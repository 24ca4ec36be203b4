"""EmbreeCaster: the bits of planar casting, whatever float32 makes of the walls."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World
from lrf3d.base.errors import InputError, Lrf3dWarning, MissingLibraryError
from lrf3d.casting.triangle_rays import TriangleRays, embreex_installed, require_embreex
from stress import aimed, blocks

FANS = [
    LaserRangeFinder(),
    LaserRangeFinder(-np.pi, np.pi, 361, range_min=0.5, range_max=25.0),
    LaserRangeFinder(-0.01, 0.01, 201, range_max=300.0),
    LaserRangeFinder(0.0, 0.0, 1),
]
"""Wide and narrow fans, of many beams and of one."""


def assert_same_bits(world, lrf, poses, caster=None):
    ranges, walls = PlanarCaster(world).scan_batch(lrf, poses)
    found, hits = (caster or EmbreeCaster(world)).scan_batch(lrf, poses)
    assert np.array_equal(ranges.view(np.int64), found.view(np.int64))
    assert np.array_equal(walls, hits)


def test_ranges_and_walls_have_the_bits_of_planar_casting():
    for seed in range(60):
        walls, lrf, poses = aimed(np.random.default_rng(seed), poses=30)
        for fan in (lrf, FANS[seed % len(FANS)]):
            assert_same_bits(World(walls), fan, poses)


@pytest.mark.parametrize("length", [2.3e-16, 1e-14, 1e-13, 1e-9])
@pytest.mark.parametrize("far", [-300.0, -1e7])
def test_a_wall_shorter_than_an_ulp_of_its_distance_from_the_middle_is_hit(length, far):
    # Seen from the middle of the world both of its ends round to one point.
    for short in ([1, 0, 1 + length, 0], [1, 0, 1, 1e-15]):
        world = World([short, [far, 5, far + 1, 5], [20, -1, 20, 1]])
        scan = EmbreeCaster(world).cast(FANS[-1], (0.0, 0.0, 0.0))
        assert scan.ranges == [1.0] and scan.walls == [0]


def test_an_empty_world_has_no_returns():
    for caster in (EmbreeCaster, PlanarCaster):
        empty = caster(World(np.empty((0, 4))))
        ranges, walls = empty.scan_batch(FANS[0], np.zeros((20, 3)))
        assert (ranges == np.inf).all() and (walls == -1).all()
        assert (empty.cast(FANS[0], (0, 0, 0)).ranges == np.inf).all()


def test_a_laser_far_outside_the_world_sees_what_planar_casting_sees():
    world = World(blocks(np.random.default_rng(3)))
    lrf = LaserRangeFinder(-0.1, 0.1, 61, range_max=1e5)
    assert_same_bits(world, lrf, np.array([[-300.0, 1, 0], [9e4, 0, np.pi], [1e9, 0, np.pi]]))


def test_many_threads_may_cast_in_one_scene():
    walls, _, poses = aimed(np.random.default_rng(4), poses=40)
    caster = EmbreeCaster(World(walls))
    expected = PlanarCaster(caster.world).scan_batch(FANS[1], poses)
    with ThreadPoolExecutor(8) as pool:
        for found in pool.map(lambda _: caster.scan_batch(FANS[1], poses), range(24)):
            assert all(map(np.array_equal, found, expected))


@pytest.fixture
def without_embreex(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    embreex_installed.cache_clear()
    yield
    embreex_installed.cache_clear()


def test_without_embreex_the_same_ranges_are_cast_and_a_warning_says_so(without_embreex):
    walls, lrf, poses = aimed(np.random.default_rng(5))
    with pytest.warns(Lrf3dWarning, match="embreex is not installed"):
        assert not embreex_installed()
    assert_same_bits(World(walls), lrf, poses)
    with pytest.raises(MissingLibraryError, match="a cross-check needs Embree: pip install"):
        require_embreex("a cross-check")


def test_triangles_are_met_first_with_and_without_embreex(request):
    corners = np.array([[[x, -1, -1], [x, 1, -1], [x, 0, 9]] for x in (4, 1)], np.float32)
    rays = np.zeros((3, 3), np.float32), np.eye(3, dtype=np.float32) * [[1], [1], [-1]]
    assert TriangleRays(corners).first(*map(np.float32, rays)).tolist() == [1, -1, -1]
    request.getfixturevalue("without_embreex")
    with pytest.warns(Lrf3dWarning):
        assert TriangleRays(corners).first(*map(np.float32, rays)).tolist() == [1, -1, -1]
    assert TriangleRays(corners[:0]).first(*map(np.float32, rays)).tolist() == [-1, -1, -1]


def test_what_is_no_world_and_no_mesh_is_refused():
    for wrong in ("city", None, [[0, 0, 1, 0]]):
        for caster in (EmbreeCaster, PlanarCaster):
            with pytest.raises(InputError, match="expected a World"):
                caster(wrong)
