"""Cameras: the whole world, the shots of a story, and cameras that follow the robot."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from test_render import box, city_run, room_run, run_of

from lrf3d import DynamicObstacle, Trajectory
from lrf3d.studio.scene import moments
from lrf3d.studio.scene.camera import CameraPath
from lrf3d.studio.scene.cameras import Fixed, chase, orbit, overview, top
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.shots import CLOSING, FILLING, OPENING, plan_shots
from lrf3d.studio.scene.stage.stage import stage_of
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.story import Story
from lrf3d.studio.scene.subject import Subject
from lrf3d.studio.scene.timeline import Timeline
from lrf3d.studio.scene.views import film_times, margin
from lrf3d.world import World
from lrf3d.world.cameras import FixedCamera


def seen(look, points, aspect):
    """Where points (n, 3) are in a picture, −1…1 to the right and down."""
    clip = np.column_stack([points, np.ones(len(points))]) @ look.matrix(aspect, 4000.0).T
    return clip[:, :2] / clip[:, 3:]


def filmed(run, playback=1.0):
    """The timeline of a run and what stands in its world."""
    return Timeline(run, playback=playback), Structures.from_run(run)


def told(run, playback=1.0, length=15.0):
    """The timeline of a run, what stands in its world, and the camera of its story."""
    stage = stage_of(run)
    timeline = Timeline(run, playback=playback)
    return timeline, stage.structures, Story(timeline, stage.structures, stage.exposure, length)


def level(places):
    return np.column_stack([places, np.zeros(len(places))])


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 9 / 16])
@pytest.mark.parametrize("camera", [overview, top])
@pytest.mark.parametrize("make", [city_run, room_run])
def test_the_whole_world_is_shown_above_the_text(make, camera, aspect):
    timeline, structures = filmed(make())
    whole = camera(timeline, structures)
    for time in (0.0, 1.3, timeline.end):
        places = seen(whole.look(time, aspect), level(structures.places), aspect)
        assert (np.abs(places) < 1.0).all()
        assert places[:, 1].max() < 0.9
        assert max(np.ptp(places[:, 0]), np.ptp(places[:, 1])) > 1.05


def test_a_story_begins_at_the_robot_in_its_first_light_and_ends_with_the_whole_without_the_map():
    timeline, structures, story = told(city_run(seconds=60.0), 2.0)
    begins = story.shots[0].start
    assert begins == timeline.start + 2.0 * OPENING
    first = story.look(begins, 1.5)
    assert first.shot == "wave" and first.dusk < 1.0
    robot = timeline.poses(np.array([begins]))[0, :2] - timeline.origin
    assert np.abs(seen(first, np.array([[*robot, 0.35]]), 1.5)).max() < 0.3
    # Above a town, and then in its streets.
    opened = story.look(story.shots[0].end, 1.5)
    assert opened.away < 0.4 * first.away
    story.widens = 1.9
    turned = CLOSING - FILLING
    held = [story.look(timeline.end + 2.0 * share * turned, 1.5) for share in (0.1, 1.0)]
    assert [(look.shot, look.inset) for look in held] == [("end", 0.0)] * 2
    shown = np.abs(seen(held[1], level(structures.places), 1.9))
    assert (shown < 1.0).all() and shown.max(axis=0).min() > 0.65


@pytest.mark.parametrize(
    ("seconds", "length", "takes"),
    [(4, 15, 3.95), (20, 15, 7.65), (400, 15, 15), (400, 40, 40), (400, 6, 6)],
)
def test_a_story_takes_a_length_and_its_shots_go_on_in_time(seconds, length, takes):
    timeline = Timeline(city_run(seconds=float(seconds)), playback=4.0)
    shots = plan_shots(timeline, length)
    assert sum(shot.length for shot in shots) == pytest.approx(takes, abs=0.1)
    names = [shot.name for shot in shots]
    assert names[:1] + names[-3:] == ["opening", "rise", "whole", "end"]
    assert shots[1].start >= shots[0].end - 1e-9
    assert shots[-2].end == shots[-1].start == timeline.end
    for before, after in pairwise(shots):
        assert before.start < before.end <= after.start + 1e-9
    times = film_times("story", timeline, 25.0, length)
    assert len(times) == pytest.approx(25.0 * takes, abs=3) and (np.diff(times) > 0.0).all()


def test_a_robot_whose_map_is_not_shown_is_another_robot_in_what_is_said():
    path = Trajectory([0.0, 9.0], [(4.0, 3.0, 0.0)] * 2)
    other = DynamicObstacle([[0, 0], [1, 0], [0, 1]], path, is_robot=True)
    timeline, _, story = told(replace(room_run(), obstacles=(other,)))
    story.names = ["robot 1"]
    story._subject = Subject("", proof="Here {0} sees {1}")
    story.shots = [shot._replace(name="proof") for shot in story.shots]
    assert story._said(0, timeline.start)[0] == "Here robot 1 sees another robot"


def test_a_moment_that_comes_too_late_does_not_shorten_the_rise(monkeypatch):
    timeline = Timeline(city_run(seconds=20.0), playback=4.0)
    usual = plan_shots(timeline)
    late = timeline.start + 0.99 * (timeline.end - timeline.start)
    monkeypatch.setattr("lrf3d.studio.scene.shots.subject_of", lambda *_: Subject("", late))
    planned = plan_shots(timeline)
    assert "proof" not in [shot.name for shot in planned]
    assert planned[-3].length > 0.8 * usual[-3].length


def test_a_story_says_that_it_is_fast_forward_but_not_in_a_picture_or_a_part():
    _, _, story = told(city_run(seconds=400.0), 4.0)
    number = [shot.name for shot in story.shots].index("rise")
    time = story.shots[number].start
    assert story._said(number, time) == ("", "fast forward")
    story.rushes = False
    assert story._said(number, time) == ("",)


def test_a_story_rises_in_time_and_ends_only_after_the_run():
    timeline, _, story = told(room_run(), 0.2)
    begins, ends = story.shots[0][2:]
    times = begins + np.array([0.2, 0.8, 0.95]) * (ends - begins)
    low, *high = (story.look(time, 1.5).away for time in times.tolist())
    assert low < 0.9 * high[0] and high[0] == pytest.approx(high[1])
    assert story.look(timeline.end, 1.5).shot != "end"
    assert story.look(timeline.end + 1e-9, 1.5).shot == "end"


def test_between_two_looks_the_eye_goes_from_one_to_the_other_by_the_short_way_round():
    _, _, story = told(room_run())
    times, shares = np.arange(5.0), np.linspace(0.0, 1.0, 5)
    even = np.ones(5)
    near = CameraPath(
        times, np.zeros((5, 3)), 0.1 * even, 0.3 * even, 2.0 * even, 0.8 * even, 0 * even
    )
    turns = 0.1 + 5.5 * shares
    far = CameraPath(times, np.ones((5, 3)), turns, 1.2 * even, 18.0 * even, 0.5 * even, 0.2 * even)
    found = story._between(near, far, shares)
    for column, one, other in zip(found[1:], near[1:], far[1:], strict=True):
        assert column[0] == pytest.approx(one[0]) and column[4] == pytest.approx(other[4])
    # The distance grows evenly in factors; half-way the eye has gone less than half a turn.
    assert found.aways[2] == pytest.approx(6.0) and found.turns[2] == pytest.approx(
        0.1 + 0.5 * 2.75
    )
    look = found.look(1.5, shot="chase")
    assert look.pose[2, 0] == pytest.approx(0.0, abs=1e-12) and look.shot == "chase"


def test_among_houses_the_eye_is_low_and_no_wall_hides_the_robot_from_it():
    timeline, structures, story = told(city_run(seconds=80.0), 4.0)
    walls = shapely.linestrings(structures.segments.reshape(-1, 2, 2))
    for moving in (story, orbit(timeline, structures), chase(timeline, structures)):
        for time in np.arange(timeline.start + 8.0, timeline.end, 0.5).tolist():
            look = moving.look(time, 16 / 9)
            if look.shot not in ("chase", "close"):
                continue
            eye, ahead = look.eye, look.target - look.eye
            assert -ahead[2] < 1.5 * np.hypot(*ahead[:2])
            robot = np.array([*(timeline.poses(np.array([time]))[0, :2] - timeline.origin), 0.5])
            cuts = shapely.intersection(shapely.linestrings([robot[:2], eye[:2]]), walls)
            met = ~shapely.is_empty(cuts)
            share = shapely.distance(shapely.points(robot[:2]), cuts[met]) / np.hypot(
                *(eye - robot)[:2]
            )
            assert (robot[2] + share * (eye - robot)[2] > structures.heights[met]).all()


def test_in_a_passage_too_narrow_for_the_eye_it_looks_down_and_stays_out_of_the_houses():
    segments = np.array([*box(-40.0, 1.2, 80.0, 10.0), *box(-40.0, -11.2, 80.0, 10.0)])
    world = World(segments, np.repeat([0, 1], 4), np.full(8, 8.0), "passage")
    times = np.arange(0.0, 20.0, 0.2)
    poses = np.column_stack([times - 10.0, np.zeros_like(times), np.zeros_like(times)])
    timeline, structures = filmed(run_of(world, times, poses))
    for phase in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False).tolist():
        track = orbit(timeline, structures, phase=phase).track(1.0)
        assert (np.abs(track.eyes()[:, 1]) < 1.2).all()
        assert track.aways.min() > 1.0


def test_the_eye_does_not_leap_where_the_robot_turns_away_in_a_shot():
    run = room_run()
    times = np.arange(0.0, 30.0, 0.25)
    # It goes round in the room four times, on a circle.
    turns = np.linspace(0.0, 8.0 * np.pi, len(times))
    poses = np.column_stack([2.0 + np.sin(turns), 3.0 - np.cos(turns), turns])
    timeline, _, story = told(run_of(run.world, times, poses))
    moments = film_times("story", timeline, 25.0, 15.0)
    looks = [story.look(float(moment), 16 / 9) for moment in moments]
    for before, now, after in zip(looks, looks[1:], looks[2:], strict=False):
        if before.shot == after.shot:
            assert np.linalg.norm(before.eye - 2.0 * now.eye + after.eye) < 0.02 * now.away


@pytest.mark.slow
def test_in_a_fast_film_the_robot_stands_where_it_is_and_in_every_picture_from_near():
    run, turns = room_run(), np.linspace(0.0, 20.0 * np.pi, 1000)
    # It goes round in the room ten times, once in a third of a second of the film.
    poses = np.column_stack([3.0 + 2.0 * np.sin(turns), 3.0 - 2.0 * np.cos(turns), turns])
    run = run_of(run.world, np.arange(1000.0) / 5.3, poses)
    scene = Scene(Timeline(run, playback=60.0))
    timeline, frames = scene.timeline, scene.timeline.frame_times(5.0, margin("story"))
    first, last = np.searchsorted(frames, [timeline.start, timeline.end - 1e-9])
    assert 15 <= last - first <= 20
    story = Story(timeline, scene.structures, scene.exposure)
    for moving in (chase(timeline, scene.structures), orbit(timeline, scene.structures), story):
        # A story begins a moment into the run.
        begins = story.shots[0].start if moving is story else frames[0]
        for time in frames[frames >= begins].tolist():
            look = moving.look(time, 16 / 9)
            [pose] = run.trajectory.at(np.clip([time], timeline.start, timeline.end))
            [(name, robot)] = scene.seen(timeline.moment(time), look, (64, 36)).bodies
            here = np.array([*(pose[:2] - scene.origin), 0.35])
            ahead = [np.cos(pose[2]), np.sin(pose[2]), 0.0]
            assert name == "robot" and len(robot.faces.corners) > 100
            assert robot.pose[:2, 3] == pytest.approx(here[:2], abs=1e-9)
            assert robot.pose[:3, 0] == pytest.approx(ahead, abs=1e-9)
            if look.shot not in ("rise", "end"):
                assert np.abs(seen(look, here[None], 16 / 9)).max() < 0.8


@pytest.mark.parametrize(("tall", "turned"), [(40.0, True), (11.0, False)])
def test_a_world_much_longer_than_wide_is_turned_to_fit_the_picture(tall, turned):
    run = run_of(
        World(np.array(box(0, 0, 10, tall))), [0.0, 1.0], [(5.0, 3.0, 0.0), (5.0, 4.0, 0.0)]
    )
    camera = top(*filmed(run))
    assert camera.look(0.0, 9 / 16).up == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    up = (1.0, 0.0, 0.0) if turned else (0.0, 1.0, 0.0)
    assert camera.look(0.0, 16 / 9).up == pytest.approx(up, abs=1e-9)


def test_the_inset_shows_the_whole_world_with_a_rim_and_a_scale_of_a_round_length():
    scene = Scene(Timeline(room_run()))
    window = scene.inset_view()
    assert window.middle + scene.origin == pytest.approx([4.0, 3.0])
    assert (window.width, window.aspect) == pytest.approx((1.04 * 8.0, 6.0 / 8.0))
    bars = {5.9: 1.0, 6.1: 2.0, 14.9: 2.0, 15.1: 5.0, 31.0: 10.0, 2.9: 0.5}
    assert [window._replace(width=each).bar for each in bars] == pytest.approx([*bars.values()])


def test_only_an_inset_that_is_not_compared_shows_a_false_room(monkeypatch):
    there = np.array([[30.0, 3.0]])
    monkeypatch.setattr(moments, "subject_of", lambda *_: Subject("", places=there, aim=there[0]))
    scene = Scene(Timeline(room_run()))
    widths = [scene.inset_view(compared=compared).width for compared in (False, True)]
    assert widths == pytest.approx([1.04 * 30.0, 1.04 * 8.0])


def test_a_film_of_a_story_goes_on_while_the_run_stands_still():
    timeline = Timeline(city_run(seconds=4.0), playback=2.0)
    times = timeline.frame_times(10.0, margin("story"))
    assert len(times) == 21 + round(10 * CLOSING) and times[0] == 0.0
    assert timeline.moment(float(times[-1])).time == timeline.end
    assert margin("chase") == 0.0


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
