from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d.slam.mounting import doubtful_mount


@pytest.fixture(scope="module")
def scans():
    run = lrf3d.load_scenario("corridor").run(scans=60)
    return [run.scan(number) for number in range(len(run))]


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, -90.0])
def test_a_laser_that_is_mounted_otherwise_than_declared_is_named(turn, sense, scans):
    declared = lrf3d.Pose(0.0, 0.0, -np.radians(turn))
    changed = [
        replace(each, angles=sense * each.angles, pose=each.pose @ declared, mount=declared)
        for each in scans
    ]
    doubt = doubtful_mount(changed) or ""
    assert (f"turned by {turn:.0f}°" in doubt) == (turn != 0.0)
    assert ("mirrored" in doubt) == (sense < 0.0)
