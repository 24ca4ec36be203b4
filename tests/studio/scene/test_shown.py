"""What a scene asks: runs and drives by hand have it."""

import numpy as np
import pytest
from test_render import room_run
from yard import YARD, hand

from lrf3d.studio.page.hand_drive import HandDrive
from lrf3d.studio.scene.shown import Shown


@pytest.mark.parametrize("kind", ["run", "drive"])
def test_runs_and_drives_by_hand_have_all_that_a_scene_asks(kind, tmp_path):
    shown: Shown = room_run() if kind == "run" else hand(YARD, tmp_path)
    asked = [name for name in vars(Shown) if not name.startswith("_")]
    assert len(asked) > 10 and all(hasattr(shown, name) for name in asked)
    assert len(shown.scans_at(0)) == len(shown.lasers)
    assert len(shown.trajectory.times) == len(shown.trajectory.poses) > 0


def test_a_drive_that_goes_on_does_not_copy_its_path_at_each_scan(tmp_path):
    drive: HandDrive = hand(YARD, tmp_path)
    path, before, copies = drive.trajectory, drive.trajectory.poses, 0
    for _ in range(299):
        drive.robot.drive(0.01, 1.0, 0.5)
        path.append()
        copies += not np.shares_memory(before, path.poses)
        before = path.poses
    assert len(path.times) == len(path.poses) == 300
    # Arrays of 64 rows double twice and once more.
    assert copies == 3
    assert path.poses[-1] == pytest.approx(drive.robot.pose)
    assert np.array_equal(path.keys(np.zeros(2)).poses[-1], drive.robot.pose)
    assert (np.diff(path.times) > 0.0).all()
