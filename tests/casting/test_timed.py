import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from rational import ExactWorld

import lrf3d
from lrf3d import (
    DynamicObstacle,
    EmbreeCaster,
    InputError,
    LaserRangeFinder,
    PlanarCaster,
    Trajectory,
    World,
    load_world,
)
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.casting.kernels.beams import RAY
from lrf3d.robot.following import Patrol
from lrf3d.simulation.sensor import Sensor

CITY = load_world("city")
CASTERS = pytest.mark.parametrize("make", [PlanarCaster, EmbreeCaster])
TURNING = LaserRangeFinder(beams=45, scan_duration=0.2)
DRIVE = Trajectory([0.0, 0.5, 1.0], [(50, 31, 0.1), (51.5, 31.2, 0.4), (53, 32.5, 3.5)])
SQUARE = [(-0.4, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.4, 0.3)]


def timed(caster, lrf, path, obstacles=()):
    """The function of a pose and a time that casts the scans along a path, among obstacles."""
    sensor = Sensor(
        caster.world, lrf, caster=caster, noise=lrf3d.ProportionalNoise(0.0), obstacles=obstacles,
        path=path,
    )  # fmt: skip
    return sensor.cast


def among(caster, lrf, *obstacles):
    """The caster for scans at one moment, among obstacles."""
    return timed(caster, lrf, None, obstacles)


def test_a_scan_may_take_as_long_as_the_interval_whatever_rounding_and_the_last_gap():
    times = np.append(0.2 * np.arange(1000), 199.85)
    assert np.diff(times)[:-1].min() < 0.2
    path = Trajectory(times, np.tile([50.0, 31.0, 0.1], (len(times), 1)))
    assert timed(PlanarCaster(CITY), TURNING, path)(path.poses[0], 0.0).time == 0.0
    with pytest.raises(InputError, match="longer than"):
        timed(PlanarCaster(CITY), LaserRangeFinder(scan_duration=0.2001), path)
    more = SimpleNamespace(at=lambda times: np.zeros((len(times) + 2, 3)))
    with pytest.raises(InputError, match="path: 47 poses at 45 times"):
        timed(PlanarCaster(CITY), TURNING, more)((0, 0, 0), 0.0)


@CASTERS
def test_obstacles_are_cast_as_exactly_as_walls(make):
    obstacles = (
        DynamicObstacle(SQUARE, DRIVE),
        DynamicObstacle(round_outline(0.5), Trajectory([0.0], [(50, 36, 0)])),
    )
    # So many that they are tested in groups.
    rng = np.random.default_rng(0)
    places = np.column_stack([rng.uniform(20, 80, (40, 2)), np.zeros(40)])
    obstacles += tuple(DynamicObstacle(SQUARE, Trajectory([0.0], [place])) for place in places)
    lrf, pose = LaserRangeFinder(-np.pi, np.pi, 361), np.array([49.0, 32.0, 0.2])
    scan = among(make(CITY), lrf, *obstacles)(pose, 0.75)
    sides = np.concatenate([obstacle.walls(0.75) for obstacle in obstacles])
    together = PlanarCaster(World(np.concatenate([CITY.segments, sides]))).cast(lrf, pose)
    assert np.array_equal(scan.ranges, together.ranges)
    moving = together.walls >= len(CITY.segments)
    assert np.array_equal(scan.walls, np.where(moving, -1, together.walls))
    assert 10 < moving.sum() < 361


def test_what_is_too_near_is_told_so_whoever_it_is():
    lrf = LaserRangeFinder(0.0, 0.0, 1, range_min=2.0, range_max=20.0)
    world = World([[10.0, -5, 10, 5], [-1.0, -5, -1, 5]])
    near = DynamicObstacle(SQUARE, Trajectory([0.0], [(1.0, 0, 0)]))
    caster = among(PlanarCaster(world), lrf, near)
    assert caster(np.array([0.0, 0, 0]), 0.0).ranges[0] == -np.inf
    assert caster(np.array([0.0, 0, np.pi]), 0.0).ranges[0] == -np.inf
    far = DynamicObstacle(SQUARE, Trajectory([0.0], [(5.0, 0, 0)]))
    scan = among(PlanarCaster(world), lrf, far)(np.array([0.0, 0, 0]), 0.0)
    assert scan.ranges[0] == 4.6 and scan.walls[0] == -1


@pytest.mark.parametrize("count", [4, 0])
@CASTERS
def test_beams_of_a_sweep_among_moving_obstacles_are_exact(make, count):
    rng = np.random.default_rng(0)
    lrf = LaserRangeFinder(-3.0, 3.0, 61, range_max=20.0, scan_duration=0.4)

    def wandering(count):
        steps = np.cumsum(rng.uniform(-1.5, 1.5, (count, 3)), axis=0)
        return Trajectory(np.cumsum(rng.uniform(0.1, 0.4, count)), np.array([40, 32, 0]) + steps)

    robot = Trajectory([0.0, 0.5, 1.0], [(40, 32, 0.1), (40.5, 32.2, 2.4), (41, 32.5, 5.5)])
    paths = [wandering(5), wandering(2), Patrol([(38, 30), (42, 34)], 3.0), wandering(1)]
    obstacles = [
        DynamicObstacle(rng.uniform(-0.6, 0.6, (k + 3, 2)), p) for k, p in enumerate(paths[:count])
    ]
    scan = timed(make(CITY), lrf, robot, obstacles)(robot.poses[0], 0.0)
    assert scan.pose == tuple(robot.poses[0])
    times = lrf.time_increment * np.arange(61)
    poses, met = robot.at(times), 0
    for beam, (pose, time) in enumerate(zip(poses, times, strict=True)):
        sides = [one.walls(time) for one in obstacles]
        exact = ExactWorld(np.concatenate([CITY.segments, *sides]), pose[None, :2])
        wall, t = exact.cast(0, lrf.directions(pose)[beam])
        near = t is not None and t <= 20
        assert scan.ranges[beam] == (float(t) if near else np.inf)
        assert scan.walls[beam] == (wall if near and wall < len(CITY.segments) else -1)
        met += near and wall >= len(CITY.segments)
    assert met > 5 or not count


@pytest.mark.parametrize("offset", [(0.0, 0.0), (500_000.3, 5_300_000.7)])
def test_beams_past_corners_of_what_moves_are_right_wherever_the_world_lies(offset):
    rng = np.random.default_rng(1)
    start, end = np.add([[-2.0, 7.0, 0.3], [3.0, 8.0, 1.9]], (*offset, 0.0))
    crowd = Crowd([DynamicObstacle(SQUARE, Trajectory([0.0, 1.0], [start, end]))])
    times = np.sort(rng.random(200))
    rays = np.zeros(200, RAY)
    rays["time"] = times
    rays["x"], rays["y"] = np.array(offset)[:, None] + rng.uniform(-3, 3, (2, 200))
    aside, tangents = [], []
    for ray in rays:
        share = Fraction(float(ray["time"]))
        x, y = [
            Fraction(p) + share * (Fraction(q) - Fraction(p))
            for p, q in zip(start, end, strict=True)
        ][:2]
        theta = start[2] + ray["time"] * (end[2] - start[2])
        cos, sin = Fraction(math.cos(theta)), Fraction(math.sin(theta))
        ox, oy = Fraction(float(ray["x"])), Fraction(float(ray["y"]))
        corners = [
            (x - ox + Fraction(a) * cos - Fraction(b) * sin,
             y - oy + Fraction(a) * sin + Fraction(b) * cos)
            for a, b in SQUARE
        ]  # fmt: skip
        tip = corners[rng.integers(4)]
        away = math.atan2(*map(float, tip[::-1])) + rng.choice([-1, 1]) * 10 ** rng.uniform(-13, -9)
        ray["dx"], ray["dy"] = math.cos(away), math.sin(away)
        dx, dy = Fraction(float(ray["dx"])), Fraction(float(ray["dy"]))
        across = [float(dx * b - dy * a) for a, b in corners]
        tangents.append(min(map(abs, across)))
        aside.append(min(across) > 0.0 or max(across) < 0.0)
    ranges = np.full(200, np.inf)
    crowd.stop_rays(LaserRangeFinder(), rays, ranges, np.zeros(200, np.int64))
    assert 50 < np.sum(aside) < 150
    wrong = np.isinf(ranges) != aside
    assert np.max(np.array(tangents)[wrong], initial=0.0) < 1e-14


def test_a_patrol_goes_there_and_back_at_its_speed():
    path = Patrol([(0, 0), (4, 0), (4, 0), (4, 2)], speed=2.0).until(20.0)
    assert path.at(np.array([1.0]))[0] == pytest.approx([2, 0, 0])
    assert path.at(np.array([2.5]))[0] == pytest.approx([4, 0, np.pi / 2])
    assert path.at(np.array([3.5]))[0] == pytest.approx([4, 2, np.pi / 2])
    assert path.at(np.array([4.5]))[0] == pytest.approx([4, 1, -np.pi / 2])
    assert path.at(np.array([7.5 + 1.0]))[0] == pytest.approx([2, 0, 0], abs=2.1)
    assert path.times[-1] >= 20.0
    late = Patrol([(0, 0), (4, 0), (4, 2)], speed=2.0).until(20.0, since=15.0)
    assert np.array_equal(late.at(np.array([15.0, 19.0])), path.at(np.array([15.0, 19.0])))
    assert late.times[0] > 7.0
    steps = np.hypot(*np.diff(path.poses[:, :2], axis=0).T) / np.diff(path.times)
    assert set(np.round(steps, 9)) == {0.0, 2.0}
    with pytest.raises(InputError, match="two different"):
        Patrol([(1, 1), (1, 1)], speed=1.0)
    body = DynamicObstacle(SQUARE, Patrol([(0.0, 0.0), (4.0, 0.0)], 1.0))
    with pytest.raises(InputError, match=r"patrol without an end; call its until\(time\)"):
        body.poses  # noqa: B018
    assert body.until(2.0).poses.times[-1] >= 2.0


# The second fan goes round many times.
@pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dWarning")
@pytest.mark.parametrize("fan", [(-0.7, 1.1, 61), (-60.0, 60.0, 181)])
@pytest.mark.parametrize("seed", range(3))
def test_no_obstacle_that_a_beam_meets_is_passed_over(seed, fan):
    rng = np.random.default_rng(seed)
    lrf, world = LaserRangeFinder(*fan, range_max=12.0), World([[90.0, 90, 91, 90]])
    alone = PlanarCaster(world)
    seen = 0
    for _ in range(150):
        place = Trajectory([0.0], [(*rng.uniform(-15, 15, 2), rng.uniform(-9, 9))])
        obstacle, pose = (
            DynamicObstacle(SQUARE, place),
            np.array([*rng.uniform(-2, 2, 2), rng.uniform(-9, 9)]),
        )
        met = PlanarCaster(World(obstacle.walls(0.0))).cast(lrf, pose).ranges
        scan = among(alone, lrf, obstacle)(pose, 0.0)
        assert np.array_equal(scan.ranges, met)
        seen += bool(np.isfinite(met).any())
    assert seen > 10


@pytest.mark.parametrize("seed", range(4))
def test_light_among_moving_obstacles_is_that_of_the_moment_of_each_beam(seed):
    rng = np.random.default_rng(seed)
    walls, kinds = rng.uniform(-9, 9, (9, 4)), ["mirror", "glass", "brick", "metal"]
    made_of = rng.choice(kinds, 9).tolist()
    world = lrf3d.World(walls, np.arange(9), materials=made_of)
    lrf = lrf3d.LaserRangeFinder(-3.0, 3.0, 61, range_max=40.0, scan_duration=0.4, echoes=2)
    turning = Trajectory([0.0, 0.5, 1.0], [(0, 0, 0.1), (0.5, 0.2, 1.4), (1, 0.5, 2.5)])
    ways = [Trajectory([0.0, 1.0], rng.uniform(-5, 5, (2, 3))) for _ in range(3)]
    obstacles = [DynamicObstacle(SQUARE, way) for way in ways]
    for path in (turning, None):
        scan = timed(PlanarCaster(world), lrf, path, obstacles)(turning.poses[0], 0.0)
        times = lrf.time_increment * np.arange(61) * (path is not None)
        for beam, (pose, time) in enumerate(zip(turning.at(times), times, strict=True)):
            sides = np.concatenate([one.walls(time) for one in obstacles])
            together = lrf3d.World(
                np.vstack([walls, sides]), np.append(np.arange(9), np.full(len(sides), 9)),
                materials=[*made_of, "dark cloth"],
            )  # fmt: skip
            alone = PlanarCaster(together).cast(lrf, pose)
            wall = alone.walls[beam] if alone.walls[beam] < 9 else -1
            assert (scan.ranges[beam], scan.walls[beam]) == (alone.ranges[beam], wall)
            assert np.array_equal(scan.echoes[beam], alone.echoes[beam])
            assert scan.intensities[beam] == pytest.approx(alone.intensities[beam], rel=1e-12)


@pytest.mark.parametrize(
    ("outline", "height", "message"),
    [
        (SQUARE[:2], 1.0, "outline of shape .*n ≥ 3"),
        ([*SQUARE[:3], (np.nan, 0.0)], 1.0, r"corner 3 is \[nan, 0.0\], expected finite"),
        (SQUARE, 0.0, "height 0.0: expected .* metres, above 0"),
        (SQUARE, np.inf, "height inf"),
    ],
)
def test_outlines_and_heights_that_are_no_body_are_refused(outline, height, message):
    with pytest.raises(InputError, match=message):
        DynamicObstacle(np.array(outline), DRIVE, height)
    with pytest.raises(InputError, match=r"radius .*: expected a finite number of metres, above 0"):
        round_outline(-height if np.isfinite(height) else height)
