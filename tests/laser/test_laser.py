import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lrf3d import InputError, LaserRangeFinder, LaserScan, Pose


@given(st.floats(-10, 10))
def test_directions_are_unit_vectors_that_turn_with_the_pose(theta):
    # Limits of any type of numbers.
    lrf = LaserRangeFinder(angle_max=np.float32(0.5), beams=7)
    assert lrf.angles.dtype == np.float64
    beams = LaserRangeFinder(beams=7).directions((3.0, -4.0, theta))
    assert beams.dtype == np.float64 and beams.shape == (7, 2)
    assert np.hypot(*beams.T) == pytest.approx(np.ones(7))
    assert beams[3] == pytest.approx([np.cos(theta), np.sin(theta)])


@pytest.mark.parametrize(
    "settings",
    [
        {"beams": 0},
        {"beams": 2.5},
        {"range_max": np.nan},
        {"height": "a"},
        {"range_min": 90.0},
        {"angle_min": 1.0, "angle_max": 0.0},
        {"threshold": -1.0},
        {"near_field": np.inf},
        {"echo": "loudest"},
    ],
)
def test_a_range_finder_that_makes_no_sense_is_refused(settings):
    with pytest.raises(InputError, match="range finder"):
        LaserRangeFinder(**settings)


def test_points_follow_equation_8_and_leave_out_what_did_not_return():
    scan = LaserScan((1.0, 2.0, np.pi / 2), [-np.pi / 2, 0.0, 0.5], [2.0, 3.0, np.inf])
    assert scan.points() == pytest.approx(np.array([[3.0, 2.0], [1.0, 5.0]]))
    assert scan.hits.tolist() == [True, True, False]
    assert scan.walls.tolist() == [-1, -1, -1]
    assert isinstance(scan.pose, Pose)


def test_a_scan_has_the_covariance_of_its_pose_as_a_copy_that_stays():
    covariance = np.diag([0.01, 0.02, 0.001])
    scan = LaserScan((0, 0, 0), [0.0], [1.0], pose_covariance=covariance)
    covariance[0, 0] = 9.0
    assert scan.pose_covariance[0, 0] == 0.01 and not scan.pose_covariance.flags.writeable
    assert LaserScan((0, 0, 0), [0.0], [1.0]).pose_covariance is None


@pytest.mark.parametrize(
    ("told", "range_max", "known"),
    [
        *(([5.0, miss, -np.inf], 20.0, [5.0, np.inf, -np.inf])
          for miss in (np.nan, np.inf, 20.0, 20.5, 3.4e38)),
        # Too near, also where all beams return.
        ([-0.01, 1.0, 2.0], 20.0, [-np.inf, 1.0, 2.0]),
        # Unknown, as it is beyond all coordinates.
        *(([5.0, 5.0, most], most, [5.0, 5.0, np.inf])
          for most in (float(np.finfo(np.float32).max), 1e20, np.inf)),
    ],
)  # fmt: skip
def test_what_is_not_within_the_limits_is_no_return_or_too_near(told, range_max, known):
    scan = LaserScan((0, 0, 0), [0.0, 0.1, 0.2], told, range_max=range_max)
    assert scan.ranges.tolist() == known and scan.hits.tolist() == np.isfinite(known).tolist()
    assert scan.range_max == (20.0 if range_max == 20.0 else np.inf)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"angles": [0.0, np.nan]}, "angle nan of beam 1"),
        ({"angles": [0.0, 100.0]}, "angle 100 of beam 1"),
        ({"walls": [np.nan, 1]}, "walls: expected whole numbers"),
        ({"time": "a"}, "time 'a'"),
        ({"time_increment": np.nan}, "time_increment nan"),
        ({"range_max": np.nan}, "range_max nan"),
        ({"range_min": 3.0, "range_max": 2.0}, "range_min 3.0"),
        ({"pose": (1e300, 0.0, 0.0)}, "pose"),
        ({"ranges": [1.0]}, "one of each"),
        ({"intensities": [1.0]}, r"intensities \(1,\): expected a row for each of 2 beams"),
        ({"pose_covariance": np.eye(2)}, "pose_covariance"),
        ({"pose_covariance": np.diag([1.0, 1.0, -1.0])}, "pose_covariance"),
        ({"pose_covariance": np.triu(np.ones((3, 3)))}, "pose_covariance"),
    ],
)
def test_a_scan_that_makes_no_sense_is_refused_in_one_line(settings, named):
    usual = {"pose": (0, 0, 0), "angles": [0.0, 0.1], "ranges": [1.0, 2.0]}
    with pytest.raises(InputError, match=named) as raised:
        LaserScan(**{**usual, **settings})
    assert "\n" not in str(raised.value)


def test_intensities_and_echoes_that_are_no_numbers_stand_for_nothing():
    light = {"intensities": [np.nan, 0.5], "echoes": [[1.0, np.nan], [2.0, 3.0]]}
    scan = LaserScan((0, 0, 0), [0.0, 0.1], [1.0, 2.0], **light)
    assert scan.intensities.tolist() == [0.0, 0.5]
    assert scan.echoes.tolist() == [[1.0, np.inf], [2.0, 3.0]]
