"""The robot and its shadow, and what mirrors show of a scene."""

import numpy as np
import pytest

from lrf3d.robot.kinematics import RADIUS
from lrf3d.studio.scene.bodies import _lit, robot_body, robot_shadow
from lrf3d.studio.scene.look import BODY_LIGHT, SUN
from lrf3d.studio.scene.shapes import Lens, Seen, reflections


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


def test_a_body_is_brightest_facing_the_sun_and_facing_up():
    everywhere, sunny, upward = BODY_LIGHT
    normals = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    light = [sunny * SUN[2] + upward, sunny * SUN[0], 0.0, -sunny * SUN[1]]
    assert _lit(np.ones((4, 3)), normals)[:, 0] == pytest.approx(np.add(light, everywhere))


def test_a_shadow_is_dark_under_the_robot_and_fades_out_around_it():
    shadow = robot_shadow(np.array([3.0, -2.0, 0.4]), RADIUS)
    away = np.linalg.norm(shadow.corners[..., :2] - [3.0, -2.0], axis=2)
    clear = shadow.colours[..., 3] == 0.0
    assert away[~clear].max() == pytest.approx(0.27, abs=0.01)
    assert away[clear] == pytest.approx(0.27 + 0.35, abs=0.01)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_mirror_is_closed_just_before_its_wall_and_shows_what_is_as_far_behind_it(side):
    eye = np.array([1.0, -3.0 * side, 1.0])
    seen = Seen(
        Lens(np.eye(4)[[0, 2, 1, 3]] * 0.1 + np.diag([0, 0, 0, 0.9]), eye, 1, 0, 0, 0), (), ()
    )
    [reflection] = reflections(seen, np.array([[0.0, 0.0, 4.0, 0.0, 2.0]]))
    corners = reflection.seal.reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([0.0, -0.03 * side, 0.0])
    assert corners.max(axis=0) == pytest.approx([4.0, -0.03 * side, 2.0])
    assert reflection.lens.eye == pytest.approx([1.0, 3.0 * side, 1.0])
    assert reflection.turn @ [2.0, 5.0, 1.0, 1.0] == pytest.approx([2.0, -5.0, 1.0, 1.0])
    # One that stands beside the picture is left out.
    assert not [*reflections(seen, np.array([[11.0, 0.0, 14.0, 0.0, 2.0]]))]
