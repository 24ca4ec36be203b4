from dataclasses import replace

import numpy as np
import pytest
import shapely
from drives import Holds, NoMap

from lrf3d import (
    CollisionError,
    DynamicObstacle,
    InputError,
    LaserRangeFinder,
    Pose,
    Scenario,
    Simulation,
    Trajectory,
    World,
    WorldError,
    load_scenario,
    simulate_fleet,
)
from lrf3d.casting.collision import Body, CollisionChecker
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.robot.kinematics import hold

BOX = [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)]
WALL = World([[2.0, -5.0, 2.0, 5.0]])


def held(walls, body, pose, twist, seconds=1.0, obstacles=()):
    checker = CollisionChecker(World(walls), obstacles)
    return checker.held(body, Pose(*pose), twist, 0.0, seconds)


def placed(body, pose):
    """The body at a pose, as a shape of shapely; a disc is its centre."""
    if body.outline is None:
        return shapely.Point(pose.x, pose.y)
    return shapely.Polygon(pose.apply(body.outline))


def random_body(rng):
    if rng.random() < 0.4:
        return Body(rng.uniform(0.05, 0.6))
    angles = np.arange(5) * 1.2566 + rng.uniform(-0.5, 0.5, 5)
    reach = rng.uniform(0.1, 0.7, 5)
    return Body(outline=np.column_stack([reach * np.cos(angles), reach * np.sin(angles)]))


@pytest.mark.parametrize("seed", range(3))
def test_a_body_on_an_arc_touches_a_wall_where_bisection_finds_it(seed):
    rng, met = np.random.default_rng(seed), 0
    for case in range(80):
        walls = rng.uniform(-3, 3, (5, 4))
        lines = shapely.MultiLineString([wall.reshape(2, 2).tolist() for wall in walls])
        body, pose = random_body(rng), Pose(*rng.uniform(-3, 3, 3))
        twist = (rng.uniform(-2, 3), case % 3 * 0.3, (case % 4) * rng.uniform(-2, 2))

        def gap(time, body=body, pose=pose, twist=twist, lines=lines):
            apart = placed(body, hold(pose, twist, time)).distance(lines)
            return apart - body.radius * (body.outline is None)

        hit = held(walls, body, pose, twist, seconds=1.5)
        times = np.linspace(0.0, 1.5, 60)
        met_at = np.flatnonzero([gap(time) <= 0.0 for time in times])
        if not len(met_at):
            # A cut so short that no sample shows it is one all the same.
            assert hit is None or abs(gap(hit.time)) < 1e-12
            continue
        low, high = times[max(met_at[0] - 1, 0)], times[met_at[0]]
        for _ in range(60 * (met_at[0] > 0)):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
        if hit.time < high - 1e-9:
            assert abs(gap(hit.time)) < 1e-12
        else:
            assert hit.time == pytest.approx(high, abs=1e-9)
            assert (hit.x, hit.y) == pytest.approx(hold(pose, twist, high)[:2], abs=1e-9)
        met += 1
    assert met > 10


@pytest.mark.parametrize(
    ("walls", "body", "twist", "wanted"),
    [
        # A corner of a wall that is just as far from the way as the disc is wide.
        ([[1.0, 0.5, 3.0, 4.0]], Body(0.5), (2.0, 0, 0), None),
        ([[1.0, 0.5 - 1e-6, 3.0, 4.0]], Body(0.5), (2.0, 0, 0), 0.499),
        # Along a wall, with the whole side of an outline at it.
        ([[-3.0, 0.2, 3.0, 0.2]], Body(outline=BOX), (2.0, 0, 0), None),
        ([[1.0, 0.2, 1.0, 4.0]], Body(outline=BOX), (2.0, 0, 0), None),
        ([[1.0, 0.2 - 1e-6, 1.0, 4.0]], Body(outline=BOX), (2.0, 0, 0), 0.35),
        # The end of a wall straight ahead of a corner, and a wall in the notch of a fork.
        ([[1.0, 0.0, 3.0, 0.0]], Body(outline=[(0.4, 0), (0, 0.4), (-0.4, 0), (0, -0.4)]),
         (2.0, 0, 0), 0.3),
        ([[1.0, 0.0, 3.0, 0.0]],
         Body(outline=[(-0.3, -0.3), (0.5, -0.3), (0.1, 0.0), (0.5, 0.3), (-0.3, 0.3)]),
         (2.0, 0, 0), 0.45),
        # A circle that ends where it began, all around and in a tenth of it.
        ([[-0.5, 1.0, -0.4, 1.0]], Body(0.1), (2 * np.pi, 0, 2 * np.pi), None),
        ([[-2.0, 1.0, -0.95, 1.0]], Body(0.1), (20 * np.pi, 0, 20 * np.pi), 0.0732),
        # At rest, next to a wall and in it.
        ([[0.5, -1.0, 0.5, 1.0]], Body(0.5), (0.0, 0, 0), None),
        ([[0.49, -1.0, 0.49, 1.0]], Body(0.5), (0.0, 0, 0), 0.0),
        ([[0.1, -0.1, 0.1, 0.1]], Body(outline=BOX), (0.0, 0, 0), 0.0),
        ([[0.1, -1.0, 0.1, 1.0]], Body(outline=BOX), (0.0, 0, 0), 0.0),
    ],
)  # fmt: skip
def test_a_body_touches_a_wall_that_it_cuts_but_not_one_that_it_grazes(walls, body, twist, wanted):
    hit = held(walls, body, (0.0, 0.0, 0.0), twist)
    assert (hit is None) == (wanted is None)
    assert hit is None or hit.time == pytest.approx(wanted, abs=1e-3)
    # The outline may be given clockwise, and the robot drive backwards.
    if body.outline is not None:
        same = held(walls, Body(outline=body.outline[::-1]), (0.0, 0.0, 0.0), twist)
        assert same == hit


@pytest.mark.parametrize("radius", [0.1, None])
def test_a_body_that_goes_round_the_end_of_a_wall_touches_it_from_behind(radius):
    body = Body(outline=[(-0.1, -0.1), (0.1, -0.1), (0.0, 0.1)]) if radius is None else Body(radius)
    wall, pose, twist = [[0.5, 1.0, 5.0, 1.0]], Pose(0.0, 0.85, 0.7), (2.0, 0.0, -1.0)
    hit, lines = held(wall, body, pose, twist, 1.45), shapely.LineString([(0.5, 1), (5, 1)])
    gaps = [
        placed(body, hold(pose, twist, time)).distance(lines) - (radius or 0.0)
        for time in np.linspace(0.0, hit.time, 200)
    ]
    assert min(gaps[:-1]) > 1e-3 and abs(gaps[-1]) < 1e-12 and hit.time > 1.0


def test_a_body_in_contact_may_slide_and_leave_but_not_press_on():
    for body, x in ((Body(0.5), 1.5), (Body(outline=BOX), 1.7)):
        for twist, touches in (
            ((0.0, 1.0, 0.0), False), ((-1.0, 0.0, 0.0), False), ((1.0, 0.0, 0.0), True),
            ((1e-10, 1.0, 0.0), False),
        ):  # fmt: skip
            hit = held(WALL.segments, body, (x, 0.0, 0.0), twist)
            assert (hit is not None) == touches
            assert hit is None or hit.time == pytest.approx(0.0, abs=1e-15)


def test_moving_obstacles_touch_robots_that_rest_drive_or_turn():
    walk = Trajectory([0.0, 4.0], [(4.0, 0, 0), (0.0, 0, 0)])
    person = DynamicObstacle(round_outline(0.3), walk)
    cases = (
        (Body(0.5), (0.0, 0, 0), 4.0 - 0.8), (Body(0.5), (1.0, 0, 0), (4.0 - 0.8) / 2),
        (Body(outline=BOX), (1.0, 0, 0), (4.0 - 0.6) / 2), (Body(0.5), (-1.0, 0, 0), None),
    )  # fmt: skip
    for body, twist, wanted in cases:
        hit = held(np.empty((0, 4)), body, (0.0, 0, 0), twist, 4.0, [person])
        assert (hit is None) == (wanted is None)
        if hit is not None:
            assert hit.time == pytest.approx(wanted, abs=1e-9) and hit.obstacle == 0
    # A bar that turns about its end hits what stands beside it.
    bar = [(0.0, -0.05), (2.0, -0.05), (2.0, 0.05), (0.0, 0.05)]
    turns = DynamicObstacle(bar, Trajectory([0.0, 2.0], [(0, 0, 0), (0, 0, 2.0)]))
    hit = held(np.empty((0, 4)), Body(0.1), (0.0, 1.0, 0), (0.0, 0, 0), 2.0, [turns])
    assert hit.time == pytest.approx(np.pi / 2 - np.arcsin(0.15), abs=1e-9)


def test_a_controller_rests_where_it_touches_something_or_it_is_an_error():
    def drive(obstacles=(), controller=None, **body):
        return Simulation(
            WALL, controller or Holds(1.0, 0.0), LaserRangeFinder(beams=3), mapper=NoMap(),
            obstacles=obstacles, scan_interval=0.5, scans=8, **body,
        )  # fmt: skip

    with pytest.raises(CollisionError, match=r"wall 0 at t = 1\.50 s near \(1\.50, 0\.00\)"):
        list(drive(radius=0.5))
    stopped = drive(radius=0.5, on_collision="stop")
    assert [step.pose.x for step in stopped] == pytest.approx([0, 0.5, 1, 1.5, 1.5, 1.5, 1.5, 1.5])
    assert stopped.drive.driven.collision.wall == 0
    back = [step.pose.x for step in drive(outline=BOX, on_collision="stop")]
    assert back[-1] == pytest.approx(1.7) and max(back) <= 1.7 + 1e-9
    cart = DynamicObstacle(
        BOX, Trajectory([0.0, 1.0], [(1.0, 2.0, -np.pi / 2), (1, 0, -np.pi / 2)])
    )
    with pytest.raises(CollisionError, match="runs into dynamic obstacle 0 at t = "):
        list(drive([cart], radius=0.3))
    assert [step.pose.x for step in drive([cart], radius=None)][-1] == 3.5


def test_a_trajectory_with_a_body_is_checked_or_ends_at_the_wall():
    walk = Trajectory([0.0, 1.0, 2.0], [(0, 0, 0), (1, 0, 0), (3, 0, 0)])
    lrf = LaserRangeFinder(beams=3)
    with pytest.raises(CollisionError, match=r"wall 0 at t = 1\.35"):
        Simulation(WALL, walk, lrf, outline=BOX)
    halted = Simulation(WALL, walk, lrf, outline=BOX, on_collision="stop", mapper=NoMap())
    assert [step.pose.x for step in halted] == pytest.approx([0, 1, 1.7])
    beside = DynamicObstacle(round_outline(0.3), Trajectory([0.0], [(0.5, 0.4, 0)]))
    scenario = Scenario(World([[9.0, 0, 9, 1]]), route=np.array([[0.0, 0], [2, 0]]), speed=1.0)
    assert len(scenario.trajectory()) > 5
    met, notes = scenario.changed(obstacles=[beside]), []
    # The file's route takes no notice of obstacles, which is said; a body that is checked does.
    met.trajectory(say=notes.append)
    assert len(notes) == 1 and "runs into dynamic obstacle 0 at t = " in notes[0]
    with pytest.raises(CollisionError, match="runs into dynamic obstacle 0"):
        met.simulation(on_collision="raise")
    assert met.simulation(on_collision="stop").drive.poses[-1, 0] < 0.3
    narrow = scenario.changed(obstacles=[beside], outline=[(-0.1, -0.05), (0.1, -0.05), (0, 0.05)])
    assert narrow.radius == pytest.approx(np.hypot(0.1, 0.05))
    assert narrow.simulation(on_collision="raise")


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ([(1, 0), (2, 0), (2, 1)], r"contain the robot's centre \(0, 0\)"),
        ([(-1, -1), (1, 1), (1, -1), (-1, 1)], "be free of crossings"),
        ([(0, 0), (1, 0)], "n ≥ 3"),
        ([(-1, -1), (1, np.nan), (0, 1)], "(corner|row) 1"),
    ],
)
def test_an_outline_that_is_no_body_is_refused(outline, message):
    for make in (lambda: Body(outline=outline), lambda: Scenario(WALL, outline=outline)):
        with pytest.raises(InputError, match=message):
            make()
    with pytest.raises(InputError, match="on_collision"):
        Simulation(WALL, Holds(1.0, 0.0), on_collision="bounce")


def test_an_outline_in_a_world_file_is_the_body_or_an_error_that_names_the_file(written):
    wall = "[[object]]\npoints = [[9, 0], [9, 1]]\n[robot]\noutline = "
    path = written("yard.toml", wall + "[[-0.3, -0.2], [0.4, -0.2], [0.0, 0.3]]")
    assert load_scenario(path).radius == pytest.approx(np.hypot(0.4, 0.2))
    path.write_text(wall + "[[1, 1], [2, 1], [2, 2]]")
    with pytest.raises(WorldError, match=r"yard.toml: robot.*outline: expected to contain"):
        load_scenario(path)


def fleet(drives, starts=None, **settings):
    lrf = LaserRangeFinder(-np.pi, np.pi, 73)
    usual = {"mapper": NoMap, "caster": "planar", "radius": 0.5}
    if "scans" in settings:
        usual["scan_interval"] = 0.5
    return simulate_fleet(World([[90.0, 0, 90, 1]]), drives, lrf, starts=starts, **usual | settings)


def test_controllers_of_a_fleet_see_and_touch_each_other_where_they_meet():
    starts, drives = [(0.0, 0, 0), (4.0, 0, np.pi)], [Holds(1.0, 0.0), Holds(0.5, 0.0)]
    with pytest.raises(CollisionError, match=r"robot 0: the robot runs into robot 1 at t = 2\.00"):
        fleet(drives, starts, scans=9)
    one, other = fleet(drives, starts, scans=9, on_collision="stop")
    assert one.trajectory.poses[:, 0] == pytest.approx([0, 0.5, 1, 1.5, 2, 2, 2, 2, 2], abs=1e-9)
    assert other.trajectory.poses[-1] == pytest.approx([3, 0, np.pi], abs=1e-9)
    # What one sees ahead is where the other is, at each scan.
    gaps = other.trajectory.poses[:, 0] - one.trajectory.poses[:, 0] - 0.5
    assert one.truth[:, 36] == pytest.approx(gaps, abs=1e-9)
    assert one.obstacles[0].path is other.trajectory
    # One that drives on as fast is not touched, though it stands where the other will be.
    away = fleet([Holds(1.0, 0.0), Holds(1.0, 0.0)], [(0.0, 0, 0), (1.0, 0, 0)], scans=6)
    assert away[0].trajectory.poses[-1, 0] == 2.5


def test_controllers_trajectories_and_obstacles_of_a_fleet_touch_each_other():
    walk = Trajectory([0.0, 4.0], [(3.0, -2.0, 1.57), (3.0, 2.0, 1.57)])
    post = DynamicObstacle(round_outline(0.2), Trajectory([0.0], [(6.0, 0, 0)]))
    given = [Trajectory(0.5 * np.arange(9), np.tile([(3.0, 9.0, 0)], (9, 1))), Holds(1.0, 0.0)]
    with pytest.raises(CollisionError, match=r"robot 1: .* dynamic obstacle 1 at t = 5\.30"):
        met = [replace(post, path=walk), post]
        fleet(given, [(3, 9, 0), (0.0, 0, 0)], obstacles=met, scans=20)
    with pytest.raises(InputError, match=r"robot 1: a controller without a pose"):
        fleet(given)
    with pytest.raises(InputError, match="1 starts of 2 robots"):
        fleet(given, [(0, 0, 0)])


def test_a_fleet_of_given_drives_is_that_of_each_among_the_others():
    rng = np.random.default_rng(3)
    drives = [Trajectory(0.3 * np.arange(5), rng.uniform(-3, 3, (5, 3))) for _ in range(4)]
    runs = fleet(drives)
    for k, run in enumerate(runs):
        others = [
            DynamicObstacle(round_outline(0.5), each, 1.0)
            for each in drives
            if each is not drives[k]
        ]
        alone = Simulation(
            run.world, drives[k], run.lrf, caster="planar", mapper=NoMap(), obstacles=others
        )
        assert np.array_equal([step.true_scan.ranges for step in alone], run.truth)
        assert run.walls.max() < 0 < np.isfinite(run.truth).sum()


@pytest.mark.parametrize("moments", [1, 2])
def test_a_robot_that_rests_touches_the_wall_that_it_stands_in(moments):
    rests = Trajectory(range(moments), [(1.9, 0.0, 0.0)] * moments)
    assert CollisionChecker(World([[2, -1, 2, 1]])).first(rests, Body(0.35)).wall == 0
