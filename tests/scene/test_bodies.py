import numpy as np
import pytest

from lrf3d.robot.kinematics import RADIUS
from lrf3d.scene.bodies import robot_body


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("height", [0.4, 0.8])
def test_the_column_of_a_robot_reaches_to_its_laser_and_the_rest_keeps_its_shape(height, size):
    usual = robot_body(0.495, RADIUS).corners.reshape(-1, 3)
    other = robot_body(height, size * RADIUS).corners.reshape(-1, 3)
    # A larger robot is as high as the usual one, a smaller one is lower.
    low = min(size, 1.0)
    assert other[:, :2] == pytest.approx(size * usual[:, :2], abs=1e-6)
    above = np.maximum(usual[:, 2] - 0.31, 0.0)
    stretched = low * (usual[:, 2] - above) + above / (0.495 - 0.31) * (height - 0.31 * low)
    assert other[:, 2] == pytest.approx(stretched, abs=1e-6)
