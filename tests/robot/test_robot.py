import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import (
    CollisionError,
    InputError,
    Scenario,
    Trajectory,
    Unicycle,
    World,
    drive,
    follow_route,
    load_scenario,
)
from lrf3d.casting.collision import check_drive, find_collision
from lrf3d.robot.following import Patrol

speeds = st.floats(-3.0, 3.0)
turns = st.floats(-2.0, 2.0)
ROOM = World(np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]))


@given(speeds, turns, st.floats(0.01, 10.0))
@settings(max_examples=30)
def test_arcs_agree_with_integration(v, omega, duration):
    exact = drive((1.0, 2.0, 0.3), v, omega, duration=duration, dt=duration / 3)
    integrated = drive(
        (1.0, 2.0, 0.3), lambda t: v, lambda t: omega, duration=duration, dt=duration / 3
    )
    assert exact.times == pytest.approx(integrated.times)
    assert exact.poses == pytest.approx(integrated.poses, abs=1e-6)


@given(speeds, st.floats(-1e-9, 1e-9))
def test_small_turns_go_over_into_a_straight_line(v, omega):
    end = Unicycle().move((0.0, 0.0, 0.0), v, omega, 2.0)
    assert end == pytest.approx((2.0 * v, v * omega * 2.0, 2.0 * omega), abs=1e-12)


def test_pieces_are_chained():
    whole = drive((0, 0, 0), [1.0, 0.0, 2.0], [0.0, np.pi / 2, 0.0], duration=[3.0, 1.0, 1.0])
    assert whole.poses[-1] == pytest.approx([3.0, 2.0, np.pi / 2])
    assert whole.times[-1] == 5.0


def test_a_trajectory_interpolates_over_the_seam_the_short_way():
    trajectory = Trajectory([0.0, 1.0], [[0, 0, 3.0], [2, 0, -3.0]])
    x, _, theta = trajectory.at(np.array([0.5]))[0]
    assert x == 1.0 and abs(theta) == pytest.approx(np.pi)
    assert trajectory.at(np.array([-5.0]))[0] == pytest.approx([0, 0, 3.0])
    assert trajectory.length == 2.0 and trajectory.duration == 1.0


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=2, max_size=6))
@settings(max_examples=25)
def test_pursuit_arrives_and_stays_near_the_route(corners):
    route = np.array([c for i, c in enumerate(corners) if i == 0 or c != corners[i - 1]], float)
    if len(route) < 2:
        return
    drive = follow_route(4.0 * route, speed=1.5, lookahead=1.0)
    assert drive.poses[-1, :2] == pytest.approx(4.0 * route[-1], abs=1e-2)
    from shapely import LineString, MultiPoint

    path = LineString(4.0 * route)
    away = [path.distance(point) for point in MultiPoint(drive.poses[:, :2]).geoms]
    assert max(away) < 0.6


def test_a_robot_that_starts_facing_away_turns_before_it_swings_out():
    drive = follow_route([[0, 0], [0, 3]], start=(0.0, 0.0, -1.5), speed=1.0)
    assert np.abs(drive.poses[:, 0]).max() < 0.1 and drive.poses[-1, 1] > 2.99


def test_a_drive_into_a_wall_names_time_place_and_wall():
    trajectory = Trajectory([0.0, 1.0, 2.0], [[5, 4, 0], [9, 4, 0], [11, 4, 0]])
    with pytest.raises(CollisionError, match=r"wall 1 at t = 1\.32 s near \(9\.65, 4\.00\)"):
        check_drive(trajectory, ROOM, 0.35)


@pytest.mark.parametrize("settings", [["robot.scan_interval=1e-8"], ["robot.speed=1e-6"]])
def test_a_drive_costs_what_is_asked_of_it(settings):
    scenario = load_scenario("city", settings)
    assert len(scenario.trajectory(scans=3)) == 3
    with pytest.raises(InputError, match="more than 2,000,000 steps"):
        scenario.trajectory()
    with pytest.raises(InputError, match=r"scans 10+: .* to 10,000,000"):
        scenario.trajectory(scans=10**12)


def test_few_scans_are_the_first_of_many():
    scenario = load_scenario("city")
    many = scenario.trajectory(scans=900)
    few = scenario.trajectory(scans=40)
    assert (few.poses == many.poses[:40]).all() and (few.times == many.times[:40]).all()


@pytest.mark.parametrize("length", [3.07, 4.31])
def test_scans_of_a_long_drive_come_evenly_also_where_it_turns(length):
    world = World([[-5.0, -5.0, 15.0, -5.0]])
    route = np.array([[0.0, 0.0], [length, 0.0]])
    scenario = Scenario(world, route=route, speed=1.0, scan_interval=0.25)
    np.testing.assert_allclose(np.diff(scenario.trajectory(scans=100).times), 0.25, rtol=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda: follow_route("abc"),
        lambda: follow_route([[0, 0], [5, 0]], speed=-1.0),
        lambda: follow_route([[0, 0], [5, 0]], lookahead=np.nan),
        lambda: follow_route([[0, 0], [5, 0]], dt=1e300),
        lambda: follow_route([[0, 0], [0, 0]]),
        lambda: follow_route([[0, 0, 0]]),
        lambda: follow_route([[0, 0], [1e300, 0]]),
        lambda: follow_route([[0, 0], [1, 0]], start="a"),
        lambda: drive("abc", 1.0, 0.0, duration=1.0),
        lambda: drive((0, 0, 0), "a", 0.0, duration=1.0),
        lambda: drive((0, 0, 0), np.nan, 0.0, duration=1.0),
        lambda: drive((0, 0, 0), 1.0, 0.0, duration=1e300),
        lambda: drive((0, 0, 0), 1.0, 0.0, duration=0.0),
        lambda: drive((0, 0, 0), [1.0, 2.0], 0.0, duration=[1.0, 2.0, 3.0]),
        lambda: drive((0, 0, 0), lambda t: 1.0, 0.0, duration=1.0, tolerance="a"),
        lambda: Trajectory("ab", [[0, 0, 0]]),
        lambda: Trajectory([np.inf], [[0, 0, 0]]),
        lambda: Trajectory([0.0, 0.0], np.zeros((2, 3))),
        lambda: Trajectory([0.0], np.zeros((2, 3))),
        lambda: Trajectory([0.0], "abc"),
        lambda: Trajectory([0.0], [[0, 0, 0]]).at("a"),
        lambda: Trajectory([0.0], [[0, 0, 0]]).every(0),
        lambda: Unicycle(radius=-1.0),
        lambda: Unicycle().move((0, 0, 0), "a", 0.0, 1.0),
        lambda: find_collision(Trajectory([0.0], [[0, 0, 0]]), ROOM, np.nan),
        lambda: check_drive(Trajectory([0.0], [[0, 0, 0]]), ROOM, "a"),
        lambda: Patrol("abc"),
        lambda: Patrol([(0, 0), (1, 0)], speed="a"),
    ],
)
def test_a_value_of_the_wrong_kind_is_one_clear_error(call):
    with pytest.raises(InputError) as caught:
        call()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_a_collision_that_is_ignored_is_reported_without_advice():
    told = []
    scenario = Scenario(ROOM, route=np.array([[5.0, 4.0], [12.0, 4.0]]))
    scenario.trajectory(on_collision=told.append)
    assert len(told) == 1 and "wall 1" in told[0] and "--ignore-collisions" not in told[0]
    with pytest.raises(CollisionError, match="--ignore-collisions"):
        scenario.trajectory()
