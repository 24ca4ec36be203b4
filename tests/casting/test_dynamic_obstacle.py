"""DynamicObstacle: what is refused, and how far points are from it."""

import numpy as np
import pytest

import lrf3d
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.errors import InputError
from lrf3d.robot.laps import Patrol

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
WALK = lrf3d.Trajectory([0, 2], [(0, 0, 0), (4, 0, 0)])


@pytest.mark.parametrize(
    ("outline", "height", "message"),
    [
        (SQUARE[:2], 1.0, "expected at least 3 x, y"),
        ([*SQUARE[:3], (np.nan, 0.0)], 1.0, r"corner 3 is \[nan, 0.0\], expected finite"),
        (SQUARE, 0.0, "height 0.0: expected .* metres, above 0"),
        (SQUARE, np.inf, "height inf"),
    ],
)
def test_outlines_and_heights_that_are_no_body_are_refused(outline, height, message):
    with pytest.raises(InputError, match=message):
        lrf3d.DynamicObstacle(np.array(outline), WALK, height)


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_a_round_outline_needs_a_radius(radius):
    with pytest.raises(InputError, match=r"radius .*: expected a finite number of metres, above 0"):
        round_outline(radius)


def test_distances_are_those_from_where_the_body_is_at_the_time():
    body = lrf3d.DynamicObstacle(SQUARE, WALK)
    points, times = np.array([[4.0, 0.0], [4.0, 3.0], [4.0, 0.5]]), np.array([0.0, 1.0, 2.0])
    assert body.distances(points, times) == pytest.approx([3.0, np.hypot(1.0, 2.0), 0.0])


def test_a_patrol_has_poses_only_up_to_a_time():
    patrol = Patrol([(0.0, 0.0), (4.0, 0.0)], 1.0)
    body = lrf3d.DynamicObstacle(SQUARE, patrol)
    with pytest.raises(InputError, match=r"patrol without an end; call its until\(time\)"):
        body.poses  # noqa: B018
    assert body.until(2.0).poses.times[-1] >= 2.0
