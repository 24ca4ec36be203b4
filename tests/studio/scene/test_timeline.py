"""The robot's path as all pictures show it."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import box, make_run, make_world
from test_render import room_run

from lrf3d import LaserRangeFinder, Trajectory
from lrf3d.studio.scene.marks import trail_lines
from lrf3d.studio.scene.timeline import DriveKeys, Timeline, scan_times
from lrf3d.world.cameras import FilmPlan


@pytest.mark.parametrize(("minutes", "seconds"), [(1, 15), (3, 31), (45, 31)])
def test_a_film_takes_half_a_minute_at_most_however_long_the_run(minutes, seconds):
    poses = [(20.0, 5.0, 3.0 + 0.001 * number) for number in range(3 * 60 * minutes + 1)]
    run = make_run(make_world(box(0, 0, 9, 9)), np.array(poses), LaserRangeFinder(beams=9))
    run = replace(run, trajectory=Trajectory(np.arange(len(poses)) / 3.0, poses))
    assert len(Timeline(run).frame_times(10.0)) == pytest.approx(10 * seconds, 1)
    own = replace(run, film=FilmPlan(playback=2.0))
    assert Timeline(own).playback == 2.0


def test_the_trail_ends_at_the_robot_and_pales_with_its_age():
    times = np.arange(5.0)
    keys = DriveKeys(times, np.column_stack([times, 0 * times, 0 * times]))
    lines = trail_lines(keys, 2.5, 2.0)
    assert lines.ends[-1, 0] == pytest.approx(2.5) and len(lines.starts) == 3
    assert (np.diff(lines.opacities[:, 0]) >= 0.0).all()
    assert lines.opacities[0, 0] < lines.opacities[-1, 1]
    assert not len(trail_lines(keys, 0.0, 2.0).starts)


def test_keys_go_only_where_the_robot_drives_evenly():
    times = np.arange(13.0)
    poses = np.zeros((13, 3))
    # Ahead for four seconds, then faster, then to the left, then to the right.
    poses[:, 0] = [0, 1, 2, 3, 4, 6, 8, 8, 8, 8, 9, 10, 11]
    poses[7:, 1] = [1, 2, 3, 3, 3, 3]
    keys = DriveKeys(times, poses).thinned(0.002)
    assert keys.times.tolist() == [0, 4, 6, 9, 12]
    for axis in (0, 1):
        even = np.interp(times, keys.times, keys.poses[:, axis])
        assert even == pytest.approx(poses[:, axis], abs=0.01)
    circle = np.column_stack([np.cos(times), np.sin(times), times])
    assert len(DriveKeys(times, circle).thinned(0.002).times) == 13


def test_a_scan_is_seen_from_half_before_to_half_after_its_moment_or_until_the_robot_leaves():
    begin, end = scan_times(Timeline(room_run()), every=2)
    # A scan in each half second; the last of those that are kept is seen to the end.
    assert begin == pytest.approx([0.0, 0.25, 0.75, 1.25, 1.75, 2.25])
    assert end == pytest.approx([*begin[1:], 2.75])
    begin, end = scan_times(Timeline(room_run(stops=True)))
    assert begin.tolist() == [0.0, 4.0, 8.0] and end == pytest.approx([2.0, 6.0, 10.0])
