"""The attitude of a drive: its sensors turn with it, and a planar laser meets the floor."""

from typing import Any

import numpy as np
import pytest
from drives import Holds
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import lrf3d
from lrf3d.robot.attitude import Tilting

ROOM = lrf3d.World([[4, -9, 4, 9], [-4, -9, -4, 9]], heights=[9.0, 9.0])
angles = st.floats(-0.6, 0.6)


@settings(max_examples=20)
@given(angles, angles, angles)
def test_beams_of_a_tilted_robot_end_at_the_floor_and_at_walls(
    pitch: float, roll: float, theta: float
) -> None:
    mount = np.array([0.2, 0.1, 0.7])
    lrf = lrf3d.LaserRangeFinder(beams=37, height=mount[2], mount=(*mount[:2], 0.5))
    lidar = lrf3d.Lidar(np.array([-0.1, 0.0]), columns=9, mount=(*mount, 0.3, 0.1, -0.2))
    attitude = lrf3d.Attitude(pitch, roll)
    drive = [(0.5, 1.0, theta)]
    (step,) = lrf3d.Simulation(ROOM, drive, lrf, attitude=attitude, lidars=lidar)
    robot = Rotation.from_euler("ZYX", [theta, pitch, roll])
    flat = np.column_stack([np.cos(lrf.angles), np.sin(lrf.angles), np.zeros(37)])
    beams = (robot * Rotation.from_euler("Z", 0.5)).apply(flat)
    hits = np.isfinite(step.scan.ranges)
    ends = robot.apply(mount) + [0.5, 1.0, 0.0] + step.scan.ranges[hits, None] * beams[hits]
    ends = np.concatenate([ends, step.lidar_scans[0].points()])
    off = np.minimum(np.abs(ends[:, 2]), np.abs(np.abs(ends[:, 0]) - 4.0))
    assert hits.any() and off.max() < 1e-9
    assert step.scan.pose == lrf3d.Pose(*lrf.placed(np.array(drive[0])))


def test_pitch_and_roll_follow_the_drive() -> None:
    tilting = Tilting(lrf3d.Attitude(0.1, sway=0.01, profile=[(2, 0, 0), (4, 0.2, -0.1)]))
    found = [tilting.drive(t, np.array([x, 0, 0])) for t, x in enumerate((0.0, 3.0, 6.0, 7.0))]
    # It speeds up by 3 m/s², drives on, and brakes by 2 m/s².
    expected = [(0.1, 0.0), (0.2 - 0.03, -0.05), (0.3, -0.1), (0.3 + 0.02, -0.1)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("way", ["poses", "controller", "fleet", "file"])
def test_every_drive_is_tilted_and_runs_keep_how(way: str, tmp_path: Any) -> None:
    drive: Any = [(0, 0, 0), (0.1, 0, 0)] if way in ("poses", "fleet") else Holds(0.1, 0.0)
    more: Any = {"attitude": lrf3d.Attitude(pitch=0.3), "lidars": lrf3d.Lidar([0.0], columns=4)}
    more |= {"scans": 2, "rng": 0}
    if way == "fleet":
        run = lrf3d.simulate_fleet(ROOM, [drive], **more)[0]
    elif way == "file":
        run = lrf3d.load_scenario("paper_room", [f"drive.pitch_deg={np.degrees(0.3)}"]).run(
            rng=0, world=ROOM, poses=[(0, 0, 0), (0.1, 0, 0)], lidars=more["lidars"]
        )
    else:
        run = lrf3d.simulate(ROOM, drive, **more)
    ahead = np.argmin(np.abs(run.lrf.angles))
    assert run.attitudes is not None and np.allclose(run.attitudes, [(0.3, 0.0)] * 2)
    np.testing.assert_allclose(run.truth[:, ahead], 0.5 / np.tan(0.3))
    lrf3d.save_run(run, tmp_path / "run.npz")
    again = lrf3d.load_run(tmp_path / "run.npz").part(np.array([1]))
    assert again.lidar(0).ranges.tobytes() == run.lidar(1).ranges.tobytes()
    assert again.lidar(0, noisy=False).ranges[0, 2] == pytest.approx(0.5 / np.tan(0.3))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"pitch": 5.0}, "radians"),
        ({"profile": [(1, 0, 0), (0, 0, 0)]}, "ascending"),
        ({"pitch": 0.5, "x": 1.0}, "below the floor"),
    ],
)
def test_wrong_attitudes_are_one_line(settings: dict[str, Any], message: str) -> None:
    x = settings.pop("x", 0.0)
    with pytest.raises(lrf3d.InputError, match=message):
        attitude = lrf3d.Attitude(**settings)
        lrf = lrf3d.LaserRangeFinder(height=0.1, mount=(x, 0, 0))
        lrf3d.simulate(ROOM, [(0, 0, 0)], lrf, attitude=attitude)
