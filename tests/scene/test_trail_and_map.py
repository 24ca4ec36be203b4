"""The trail and the map as all pictures show them."""

from dataclasses import replace

import numpy as np
import pytest
from test_render import room_run

from lrf3d.robot import Trajectory
from lrf3d.scene.timeline import DriveKeys, Timeline, drive_keys
from lrf3d.scene.trail_and_map import straight_pieces, thinned, trail_lines


def test_the_trail_is_one_in_all_pictures_and_leaves_out_where_the_robot_was_set_down():
    run = room_run(stops=True)
    timeline = Timeline(run)
    timeline.jumps = np.array([False, True])
    keys = drive_keys(timeline)
    # The robot is where the film has it at each key, and between keys goes straight.
    poses = timeline.poses(keys.times + timeline.start) - [*timeline.origin, 0.0]
    np.testing.assert_allclose(keys.poses[:, :2], poses[:, :2])
    assert keys.set_down.sum() == 2 and np.diff(keys.times)[keys.set_down].max() < 0.01
    lines = trail_lines(keys, float(keys.times[-1]), 1e9)
    assert len(lines.starts) == len(keys.set_down) - 2
    driven = sum(np.hypot(*piece.way) for piece in straight_pieces(keys))
    assert driven == pytest.approx(np.hypot(*np.diff(run.trajectory.poses[:2, :2], axis=0)[0]))


def test_the_trail_ends_at_the_robot_and_pales_with_its_age():
    times = np.arange(5.0)
    keys = DriveKeys(times, np.column_stack([times, 0 * times, 0 * times]), np.zeros(4, bool))
    lines = trail_lines(keys, 2.5, 2.0)
    assert lines.ends[-1, 0] == pytest.approx(2.5) and len(lines.starts) == 3
    assert (np.diff(lines.opacities[:, 0]) >= 0.0).all()
    assert lines.opacities[0, 0] < lines.opacities[-1, 1]
    assert not len(trail_lines(keys, 0.0, 2.0).starts)


def test_keys_go_only_where_the_robot_drives_evenly():
    times = np.arange(13.0)
    poses = np.zeros((13, 3))
    # Ahead for four seconds, then faster, then to the left, then set down elsewhere.
    poses[:, 0] = [0, 1, 2, 3, 4, 6, 8, 8, 8, 8, 20, 21, 22]
    poses[7:10, 1] = [1, 2, 3]
    set_down = np.zeros(12, dtype=bool)
    set_down[9] = True
    keys = thinned(DriveKeys(times, poses, set_down))
    assert keys.times.tolist() == [0, 4, 6, 9, 10, 12]
    assert keys.set_down.tolist() == [False, False, False, True, False]
    for name, whole in zip("xy", poses.T, strict=False):
        axis = "xy".index(name)
        assert np.interp(times, keys.times, keys.poses[:, axis]) == pytest.approx(whole, abs=0.01)
    circle = np.column_stack([np.cos(times), np.sin(times), times])
    bent = DriveKeys(times, circle, np.zeros(12, dtype=bool))
    assert len(thinned(bent).times) == 13


def test_scans_in_quick_succession_are_a_drive():
    run = room_run()
    quick = replace(run, trajectory=Trajectory(1e-3 * run.trajectory.times, run.trajectory.poses))
    keys = drive_keys(Timeline(quick))
    assert not keys.set_down.any()
    assert sum(np.hypot(*piece.way) for piece in straight_pieces(keys)) == pytest.approx(1.5)
