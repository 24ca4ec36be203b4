"""Layers of lidars and columns of depth cameras, by rational numbers and by single rays."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import (
    DepthCamera,
    DynamicObstacle,
    EmbreeCaster,
    InputError,
    LaserRangeFinder,
    Lidar,
    PlanarCaster,
    Trajectory,
    World,
    load_world,
)
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.skyline import Conditions, Layered, StandingWalls, _columns, rays_along
from lrf3d.world.mesh import extrude
from tests.helpers.rational import cast_layer

# Numbers whose sums and quotients often meet: beams through corners, along walls, at heights.
HEIGHTS = st.sampled_from([0.25, 0.5, 0.75, 1.0, 1.25, 2.0])
SHAPES = [
    [(0, 0), (1, 0), (1, 1), (0, 1)],
    [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    [(1, 0), (2, 1), (1, 2), (0, 1)],
    [(0, 0), (2, 0), (1, 1), (2, 2), (0, 2)],
]


@st.composite
def scenes(draw: Any) -> tuple[list[Any], list[Any], World]:
    """StandingWalls and tops as `cast_layer` takes them, on a grid of cells of three metres."""
    walls: list[Any] = []
    tops: list[Any] = []
    owners: list[int] = []
    cells = draw(st.lists(st.integers(0, 8), min_size=1, max_size=5, unique=True))
    for number, cell in enumerate(cells):
        east = 3.0 * (cell % 3) + 1.0
        north = 3.0 * (cell // 3) - 4.0
        height = draw(HEIGHTS)
        corners = [(east + x, north + y) for x, y in draw(st.sampled_from(SHAPES))]
        if draw(st.booleans()):
            tops.append((corners, height))
        else:
            corners = corners[:-1]
        turned = draw(st.booleans())
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            if (len(tops) and tops[-1][0] is corners) or (bx, by) != corners[0]:
                walls.append(((bx, by, ax, ay) if turned else (ax, ay, bx, by), height))
                owners.append(number)
    for number in range(draw(st.integers(0, 2))):
        # StandingWalls that touch others, and stand on the lines between cells.
        x = draw(st.integers(0, 3)) * 3.0
        walls.append(((x, -4.0, x, draw(st.integers(-2, 5))), draw(HEIGHTS)))
        owners.append(len(cells) + number)
    segments = [ends for ends, _ in walls]
    return walls, tops, World(segments, owners, [height for _, height in walls])


def exact_ranges(scene: Any, place: Any, rays: Any, slopes: Any) -> list[list[Fraction | None]]:
    walls, tops, _ = scene
    return [
        [cast_layer(walls, tops, place, (ray["dx"], ray["dy"], slope)) for slope in slopes]
        for ray in rays
    ]


def assert_equal(found: Any, expected: Any) -> None:
    for ranges, exact in zip(found, expected, strict=True):
        for t, true in zip(ranges, exact, strict=True):
            if true is None:
                assert t == math.inf
            else:
                assert t == pytest.approx(float(true), rel=1e-14, abs=0.0)


@pytest.mark.slow
@settings(max_examples=150)
@given(scenes(), st.integers(-8, 10), st.sampled_from([0.5, 0.75, 1.0, 1.5]), st.data())
def test_columns_are_those_of_rational_numbers(scene: Any, y: int, z: float, data: Any) -> None:
    place = (0.0, 0.5 * y, z)
    ways = st.tuples(st.integers(1, 4), st.integers(-4, 4), st.just(0))
    beams = np.array(data.draw(st.lists(ways, min_size=1, max_size=6)), float)
    # Slopes that meet the tops and feet of walls on the grid at their ends.
    over = st.builds(
        lambda h, t: (h - z) / t, st.sampled_from([0.0, 0.25, 0.5, 1, 2]), st.integers(1, 9)
    )
    slopes = sorted(data.draw(st.sets(over, min_size=1, max_size=8)))
    rays = rays_along(place, beams)
    layers = Layered.of(np.array([slopes]), np.ones(len(slopes)), LaserRangeFinder(range_max=1e6))
    walls = StandingWalls(scene[2])
    found, _ = _columns(walls, walls.standing(np.array(place), z), rays, z, layers)
    assert_equal(found, exact_ranges(scene, place, rays, slopes))


@pytest.mark.slow
@settings(max_examples=60)
@given(scenes(), st.integers(-8, 10), st.sampled_from([0.5, 0.75, 1.0, 1.5]))
def test_layers_are_those_of_rational_numbers(scene: Any, y: int, z: float) -> None:
    place = (0.0, 0.5 * y, z)
    elevations = [-1.2, *np.arctan([(h - z) / t for h in (0, 0.5, 1) for t in (1, 3, 7)]), 0.0]
    lidar = Lidar(elevations, columns=8, mount=(0, 0, z), range_max=1e6)
    scan = PlanarCaster(scene[2]).cast_lidar(lidar, (*place[:2], 0.0))
    beams = np.column_stack([lidar.planar.directions((0, 0, 0)), np.zeros(8)])
    exact = exact_ranges(scene, place, rays_along(place, beams), lidar.slopes)
    assert_equal((scan.ranges / lidar.stretches[:, None]).T, exact)


@settings(max_examples=40)
@given(scenes(), st.floats(-3.0, 3.0), st.floats(0.3, 1.7), st.floats(-3.0, 3.0))
def test_rays_find_what_the_fan_finds(scene: Any, y: float, z: float, theta: float) -> None:
    lidar = Lidar(np.linspace(-1.0, 0.5, 9), columns=60, mount=(0, 0, z), range_min=0.7)
    caster = PlanarCaster(scene[2])
    still = caster.cast_lidar(lidar, (0.125, y, theta))
    barely = caster.cast_lidar(
        lidar, (0.125, y, theta), Conditions(motion=np.array([1e-300, 0, 0]))
    )
    assert np.array_equal(still.ranges, barely.ranges)
    assert np.array_equal(still.walls, barely.walls)


@pytest.mark.parametrize("caster", [PlanarCaster, EmbreeCaster])
def test_the_layer_of_elevation_0_is_the_planar_scan(caster: Any) -> None:
    world = load_world("city")
    lidar = Lidar([0.3, 0.0, -0.2], columns=700, range_min=1.0, range_max=40.0)
    lrf = LaserRangeFinder(
        -math.pi, math.pi - 2 * math.pi / 700, 700, range_min=1.0, range_max=40.0
    )
    for pose in [(50, 31, 0.3), (20, 30, -2), (80, 9, 7)]:
        scan = caster(world).cast_lidar(lidar, pose)
        planar = caster(world).cast(lrf, pose)
        assert scan.ranges[1].tobytes() == planar.ranges.tobytes()
        assert (scan.walls[1] == planar.walls).all()


def test_tilted_beams_are_those_of_embree_in_float64() -> None:
    world = load_world("warehouse")
    bare = World(world.segments, world.objects, world.heights)
    lidar = Lidar(np.linspace(0.02, 0.4, 8), columns=90, mount=(0, 0, 0.5, 0, -0.1, 0.05))
    scan = PlanarCaster(bare).cast_lidar(lidar, (5, 5, 0.3))
    layers = EmbreeCaster(bare).cast_layers(
        lidar.planar, (5, 5, 0.3), lidar.elevations, pitch=-0.1, roll=0.05
    )
    high = scan.walls >= 0
    np.testing.assert_allclose(scan.ranges[high], layers[0][high], rtol=1e-12)
    assert high.sum() > 300
    np.testing.assert_allclose(scan.points()[scan.walls[scan.hits] < 0, 2], 0.0, atol=1e-12)


def test_obstacles_stand_in_the_cloud_where_they_are_at_each_beam() -> None:
    path = Trajectory([0.0, 1.0], [(3.0, -1.0, 0.0), (3.0, 1.0, 0.0)])
    box = DynamicObstacle(np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]), path, 0.4)
    caster = PlanarCaster(World([[9, -9, 9, 9]]))
    lidar = Lidar([-0.2, -0.17, -0.1, 0.0], columns=360, mount=(0, 0, 1.0), scan_duration=1.0)
    crowd = Crowd([box])
    for motion in [None, np.array([0.0, 1e-9, 0.0])]:
        scan = caster.cast_lidar(lidar, (0, 0, 0), Conditions(0.0, motion, crowd))
        ahead = scan.points()[np.hypot(*scan.points()[:, :2].T) < 4.9]
        assert ahead[:, 2].max() == pytest.approx(0.4)
        # At the moment of the beam ahead the box is in the middle of its path.
        middle = ahead[np.abs(ahead[:, 1]) < 0.03]
        assert middle[:, 0].min() > 2.4
        assert (np.abs(ahead[:, 1]) < 0.6).all()
    image = caster.cast_depth(
        DepthCamera(9, 9, 0.8, mount=(0, 0, 0.3)), (0, 0, 0), Conditions(0.5, None, crowd)
    )
    assert image.depth[4, 4] == 2.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lidar([15.0]), "radians"),
        (lambda: Lidar([]), "at least one"),
        (lambda: Lidar([0.0], mount=(0, 0, -1)), "below the floor"),
        (lambda: Lidar([0.0, 0.1], columns=10**9), "1,000,000"),
        (lambda: Lidar(np.zeros(100), columns=10**6), "at most 10,000,000 beams"),
        (lambda: Lidar.preset("OS1-46"), "did you mean 'OS1-64'"),
        (lambda: DepthCamera(4, 4, 4.0), "at most 3.124"),
    ],
)
def test_bad_sensors_are_one_line(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_a_mesh_is_cast_as_the_walls_that_it_was_made_of() -> None:
    world = World([[3, -9, 3, 9], [2, 1, 2.5, 3]], heights=[2.0, 0.4])
    lidar = Lidar([-0.3, -0.1, 0.0, 0.2, 0.9], columns=50)
    camera = DepthCamera(12, 9, 1.0, mount=(0, 0, 0.6, 0, 0.2, 0))
    mesh = extrude(world)
    mesh.apply_translation([*world.origin, 0.0])
    for sensor, cast in [(lidar, "cast_lidar"), (camera, "cast_depth")]:
        ours = getattr(PlanarCaster(world), cast)(sensor, (0, 0.1, 0.2))
        other = getattr(EmbreeCaster(mesh), cast)(sensor, (0, 0.1, 0.2))
        assert np.array_equal(ours.hits, other.hits)
        np.testing.assert_allclose(other.points(), ours.points(), atol=1e-9)


def test_beams_go_on_behind_a_mirror() -> None:
    world = World([[2, -9, 2, 9], [-1, -9, -1, 9]], [0, 1], materials=["mirror", "plaster"])
    lidar = Lidar([-0.2, 0.0, 0.1], columns=4, mount=(0, 0, 1))
    scan = PlanarCaster(world).cast_lidar(lidar, (0, 0, 0))
    assert scan.ranges[:, 2] == pytest.approx([1 / math.sin(0.2), 5.0, 5.0 / math.cos(0.1)])
    assert scan.walls[:, 2].tolist() == [-1, 1, 1]


@pytest.mark.parametrize("height", [0.5, 3.0])
def test_no_pose_has_no_cloud(height: float) -> None:
    caster = PlanarCaster(World([[0, 0, 4, 0], [4, 0, 4, 4]], heights=[2.0, 2.0]))
    lidar = Lidar([-0.1, 0.0], columns=8, mount=(0.0, 0.0, height))
    assert list(caster.lidar_batches(lidar, np.zeros((0, 3)))) == []
