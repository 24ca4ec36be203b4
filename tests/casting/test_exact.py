from fractions import Fraction

import numpy as np
import pytest
from rational import ExactWorld, cast_exact

from lrf3d import EmbreeCaster, InputError, LaserRangeFinder, PlanarCaster, World

AHEAD = (1.0, 0.0)


HERE, NO = (0, 0), (-1, None)
CASES = [
    # x + 3y = 3 meets y = x / 2 at x = 6/5: t = 6/5 along (1, 1/2).
    ([[3, -1, 3, 2]], HERE, AHEAD, (0, 3)),
    ([[0, 1, 3, 0]], HERE, (1.0, 0.5), (0, Fraction(6, 5))),
    # Float64 is taken as it is, and not as the decimal that it prints.
    ([[0.1, -1, 0.1, 1]], HERE, AHEAD, (0, Fraction(0.1))),
    # Through a shared corner the lowest index wins.
    ([[2, 0, 2, 1], [2, 0, 3, -1]], HERE, AHEAD, (0, 2)),
    ([[2, 0, 3, -1], [2, 0, 2, 1]], HERE, AHEAD, (0, 2)),
    # An end belongs to its wall, and a hair beside it does not.
    ([[2, 1, 2, 0]], HERE, AHEAD, (0, 2)),
    ([[2, 5e-324, 2, 1]], HERE, AHEAD, NO),
    ([[2, -1, 2, -5e-324]], HERE, AHEAD, NO),
    ([[3, 1e-300, 7, 1e-300]], HERE, AHEAD, NO),
    # Along a wall the range ends at its nearest point, in lengths of the direction.
    *[
        ([wall], (x, 0), AHEAD, NO if t is None else (0, t))
        for wall in ([3, 0, 7, 0], [7, 0, 3, 0])
        for x, t in ((0, 3), (4, 0), (3, 0), (7, 0), (8, None))
    ],
    ([[2, 4, 6, 12]], HERE, (0.5, 1.0), (0, 4)),
    ([[2, 4, 6, 12]], HERE, (0.0, 1.0), NO),
    ([[0, 9, 0, 6]], (0, 2), (0.0, 1.0), (0, 4)),
    # From a point on a wall every beam has t = 0; what lies behind is missed.
    *[([[9, 9, 9, 8], [-1, 1, 1, -1]], HERE, way, (1, 0)) for way in (AHEAD, (0.3, 0.7))],
    ([[-3, -1, -3, 1], [5, -1, 5, 1]], HERE, AHEAD, (1, 5)),
    ([[-7, 0, -3, 0]], HERE, AHEAD, NO),
]


@pytest.mark.parametrize(("walls", "origin", "direction", "found"), CASES)
def test_a_beam_meets_a_wall_where_the_fractions_say(walls, origin, direction, found):
    assert cast_exact(np.array(walls, dtype=np.float64), origin, direction) == found


@pytest.mark.parametrize(("walls", "origin", "direction", "found"), CASES)
def test_a_single_ray_meets_a_wall_where_the_fractions_say(walls, origin, direction, found):
    # Ends of walls below 1e-44 are not kept apart from 0, as for poses.
    if 0.0 < np.abs(walls)[np.abs(walls) > 0.0].min() < 1e-44:
        return
    ranges, hit = PlanarCaster(World(walls)).cast_rays([origin], [direction])
    assert (hit[0], ranges[0]) == (found[0], np.inf if found[1] is None else float(found[1]))


def test_single_rays_are_exact_at_corners_along_walls_and_from_walls():
    rng = np.random.default_rng(2)
    walls = rng.integers(-6, 7, (60, 4)).astype(np.float64)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    origins = rng.integers(-7, 8, (800, 2)).astype(np.float64)
    # Half of them are aimed at ends of walls; some run along an axis or along walls.
    aims = np.where(
        np.arange(800)[:, None] % 2,
        rng.integers(-7, 8, (800, 2)),
        walls[:, 2:][rng.integers(len(walls), size=800)],
    )
    ways = aims - origins
    kept = (ways != 0).any(axis=1)
    origins, ways = origins[kept], ways[kept]
    exact = ExactWorld(walls, origins)
    wanted = [exact.cast(k, way) for k, way in enumerate(ways)]
    for caster in (PlanarCaster(World(walls)), EmbreeCaster(World(walls))):
        ranges, found = caster.cast_rays(origins, ways)
        assert found.tolist() == [wall for wall, _ in wanted]
        assert ranges.tolist() == [np.inf if t is None else float(t) for _, t in wanted]
    assert 0 < sum(t == 0 for _, t in wanted) < sum(t is not None for _, t in wanted) < len(ways)


@pytest.mark.parametrize("beams", [1, 2, 20, 21])
@pytest.mark.parametrize("kind", ["plaster", "mirror", "glass"])
def test_ranges_alone_a_scan_and_a_batch_are_the_same_for_few_and_many_beams(beams, kind):
    rng = np.random.default_rng(beams)
    walls = rng.uniform(-6, 6, (40, 4))
    world = World(walls, np.zeros(40, int), materials=[kind] * (kind != "plaster"))
    lrf, poses = LaserRangeFinder(beams=beams, range_max=30.0), rng.uniform(-5, 5, (20, 3))
    for caster in (PlanarCaster(world), EmbreeCaster(world)):
        batch, hits = caster.scan_batch(lrf, poses)
        assert np.array_equal(caster.cast_batch(lrf, poses), batch)
        for pose, wanted, walls in zip(poses, batch, hits, strict=True):
            assert caster.ranges(lrf, pose).tolist() == wanted.tolist()
            assert caster.cast(lrf, pose).ranges.tolist() == wanted.tolist()
            assert caster.cast(lrf, pose).walls.tolist() == walls.tolist()


def test_single_rays_follow_the_limits_and_the_height_of_a_laser():
    caster = PlanarCaster(World([[2, -1, 2, 1], [5, -1, 5, 1]], heights=[0.4, 2.0]))
    lrf, ahead = LaserRangeFinder(range_min=1.0, range_max=4.5, height=0.3), [(1.0, 0.0)]
    for x, low, high in ((0.0, 2.0, np.inf), (1.5, -np.inf, 3.5)):
        assert caster.cast_rays([(x, 0)], ahead, lrf)[0] == low
        tall = LaserRangeFinder(range_max=4.5, height=1.0)
        assert caster.cast_rays([(x, 0)], ahead, tall)[0] == high
    assert [len(part) for part in caster.cast_rays(np.empty((0, 2)), np.empty((0, 2)))] == [0, 0]
    for origins, ways, message in (
        ([(0, 0)], [(0, 0)], "ray 0 .*with a length"),
        ([(0, 0)], [(1, 0), (0, 1)], "1 origins, 2 directions"),
        ([(0, 0), (0, np.nan)], [(1, 0), (0, 1)], "ray 1 .*finite"),
    ):
        with pytest.raises(InputError, match=message):
            caster.cast_rays(origins, ways)


@pytest.mark.parametrize("caster", [PlanarCaster, EmbreeCaster])
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_a_beam_that_is_exactly_upright_ends_at_the_nearest_point_of_upright_walls(caster, up):
    # Turned from this heading by this angle, a beam has the direction (0, 1) to the last bit.
    lrf, theta = LaserRangeFinder(up * 1.001, up * 1.001, 1), up * 0.5697963267948968
    assert lrf.directions((0, 0, theta)).tolist() == [[0.0, up]]
    rng = np.random.default_rng(0)
    for _ in range(40):
        ends = rng.uniform(-9.0, 9.0, (4, 2))
        walls = np.column_stack([np.full(4, 0.3), ends[:, 0], np.full(4, 0.3), ends[:, 1]])
        walls = np.vstack([walls[: rng.integers(1, 5)], rng.uniform(-5.0, 5.0, (2, 4))])
        y = float(rng.uniform(-9.0, 9.0))
        wall, t = cast_exact(walls, (0.3, y), (0.0, up))
        scan = caster(World(walls)).cast(lrf, (0.3, y, theta))
        assert scan.walls.tolist() == [wall]
        assert scan.ranges.tolist() == [np.inf if t is None else float(t)]
