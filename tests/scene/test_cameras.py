"""Cameras that tell a story: the whole, the way down to the robot, and cameras that turn."""

from dataclasses import replace

import numpy as np
import pytest
from test_render import city_run, room_run

from lrf3d.robot import Trajectory
from lrf3d.scene.camera import Chase, Orbit
from lrf3d.scene.cameras import Fixed, margins
from lrf3d.scene.overview import CLOSING, OPENING, Overview, Story
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.world.cameras import FixedCamera


def seen(look, points, aspect):
    """Where points (n, 3) are in a picture, −1…1 to the right and up."""
    local = np.column_stack([points, np.ones(len(points))]) @ np.linalg.inv(look.pose).T
    focus = 1.0 / np.tan(0.5 * look.field)
    return focus * local[:, :2] / -local[:, 2:3] / [aspect, 1.0]


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 9 / 16])
@pytest.mark.parametrize("make", [city_run, room_run])
def test_the_overview_shows_all_of_the_path_and_fills_the_picture(make, aspect):
    timeline = Timeline(make(), playback=1.0)
    structures = Structures.from_run(timeline.run)
    camera = Overview(timeline, structures)
    for time in (0.0, 1.3, timeline.end):
        look = camera.look(time, aspect)
        path = timeline.run.trajectory.poses[:, :2] - timeline.origin
        assert (np.abs(seen(look, np.column_stack([path, 0 * path[:, 0]]), aspect)) < 1.0).all()
        corners = seen(look, camera._corners, aspect)
        assert np.abs(corners).max() == pytest.approx(Overview.FILL, abs=0.02)
        # The middle of what is shown is the middle of the picture.
        assert corners.max(axis=0) == pytest.approx(-corners.min(axis=0), abs=0.03)


@pytest.mark.parametrize("aspect", [16 / 9, 9 / 16])
def test_the_overview_shows_all_of_a_world_that_stands_askew(aspect):
    # The long sides of such a world are not those of a box around it.
    turn = np.array([[np.cos(0.6), np.sin(0.6)], [-np.sin(0.6), np.cos(0.6)]])
    run = city_run()
    ends = run.world.segments.reshape(-1, 2)
    poses = run.trajectory.poses.copy()
    low, high = ends.min(axis=0), ends.max(axis=0)
    poses[:, :2] = (low + np.linspace(0.25, 0.75, len(poses))[:, None] * (high - low)) @ turn
    ends = ends @ turn
    world = replace(run.world, segments=ends.reshape(-1, 4))
    run = replace(run, world=world, trajectory=Trajectory(run.trajectory.times, poses))
    timeline = Timeline(run, playback=1.0)
    structures = Structures.from_run(run)
    look = Overview(timeline, structures).look(0.0, aspect)
    walls = structures.segments.reshape(-1, 2)
    assert (np.abs(seen(look, np.column_stack([walls, 0 * walls[:, 0]]), aspect)) < 1.0).all()


def test_in_a_tall_picture_the_overview_is_not_smaller_than_it_must_be():
    timeline = Timeline(city_run(), playback=1.0)
    camera = Overview(timeline, Structures.from_run(timeline.run))
    upright = camera.look(0.0, 9 / 16)
    others = []
    for side in camera.SIDES:
        camera._sides[9 / 16] = side, camera.STEEP
        others.append(camera.look(0.0, 9 / 16))
    away = [float(np.linalg.norm(look.eye - look.target)) for look in (upright, *others)]
    assert away[0] <= min(away[1:]) * 1.02


def test_the_overview_of_a_low_and_narrow_town_is_steeper_and_a_full_picture_is_not():
    timeline = Timeline(city_run(), playback=1.0)
    camera = Overview(timeline, Structures.from_run(timeline.run))
    full, wide = camera._side(1.0)[1], camera._side(6.0)[1]
    assert full == pytest.approx(camera.STEEP) and wide == pytest.approx(camera.STEEP)
    camera.FULL = 1.1
    camera._sides.clear()
    assert camera._side(1.0)[1] == pytest.approx(camera.STEEPER)


def test_a_story_begins_and_ends_with_the_whole_and_follows_the_robot_between():
    timeline = Timeline(city_run(), playback=2.0)
    structures = Structures.from_run(timeline.run)
    story = Story(timeline, structures)
    whole, chase = Overview(timeline, structures), Chase(timeline, structures)
    first, last = timeline.start - 2.0 * OPENING, timeline.end + 2.0 * CLOSING
    for camera, time in ((whole, first), (chase, 0.0), (chase, 2.2), (whole, last)):
        look, other = story.look(time, 1.5), camera.look(time, 1.5)
        assert look.eye == pytest.approx(other.eye, abs=1e-6) and look.field == other.field
        assert look.pose == pytest.approx(other.pose, abs=1e-6)
        # The whole shows its map through houses, and so the film opens and ends with it.
        assert look.through == other.through == float(camera is whole)


def test_the_way_down_is_smooth_and_keeps_the_robot_in_the_picture():
    timeline = Timeline(city_run(), playback=1.0)
    story = Story(timeline, Structures.from_run(timeline.run))
    times = np.linspace(-OPENING, 0.2, 80)
    looks = [story.look(float(time), 16 / 9) for time in times]
    robot = np.array([[*(timeline.poses(np.zeros(1))[0, :2] - timeline.origin), 0.3]])
    assert all((np.abs(seen(look, robot, 16 / 9)) < 1.0).all() for look in looks)
    away = np.array([np.linalg.norm(look.eye - robot[0]) for look in looks])
    assert (np.abs(np.diff(np.log(away))) < 0.12).all()


def test_a_film_of_a_story_goes_on_while_the_run_stands_still():
    timeline = Timeline(city_run(seconds=4.0), playback=2.0)
    times = timeline.frame_times(10.0, margins("story"))
    assert len(times) == 21 + 10 * (OPENING + CLOSING)
    assert times[0] == pytest.approx(-2.0 * OPENING)
    assert timeline.moment(float(times[0])).time == 0.0
    assert timeline.moment(float(times[-1])).time == timeline.end
    assert margins("chase") == (0.0, 0.0)


def test_a_camera_that_turns_has_the_robot_in_its_middle_and_looks_closer_from_afar():
    timeline = Timeline(city_run(), playback=1.0)
    still, turning = (
        Fixed(FixedCamera("gate", (-60.0, -3.0, 9.0), (0.0, 0.0, 0.0), track=track), timeline)
        for track in (False, True)
    )
    fields = []
    for time in (0.5, 2.0, 3.5):
        look = turning.look(time, 1.0)
        robot = timeline.poses(np.array([time]))[0, :2] - timeline.origin
        middle = seen(look, np.array([[*robot, 0.4]]), 1.0)
        assert np.abs(middle).max() < 0.1
        fields.append(look.field)
        assert still.look(time, 1.0) is still.look(0.0, 1.0)
    assert fields[0] < still.look(0.0, 1.0).field and fields == sorted(fields, reverse=True)


@pytest.mark.parametrize("playback", [1.0, 8.0])
def test_in_a_fast_film_the_robot_stays_as_near_to_the_middle(playback):
    timeline = Timeline(city_run(), playback=playback)
    structures = Structures.from_run(timeline.run)
    camera = FixedCamera("gate", (-60.0, -3.0, 9.0), (0.0, 0.0, 0.0), track=True)
    for look in (Fixed(camera, timeline).look, Orbit(timeline, structures).look):
        for time in np.linspace(timeline.start, timeline.end, 9).tolist():
            robot = timeline.poses(np.array([time]))[0, :2] - timeline.origin
            place = seen(look(time, 1.0), np.array([[*robot, 0.4]]), 1.0)
            assert np.abs(place).max() < 0.35
