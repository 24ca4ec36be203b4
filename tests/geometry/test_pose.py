import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.geometry.pose import Pose, as_pose, as_poses, bent, between, compose

poses = st.builds(Pose, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-np.pi, np.pi))


def same(one, other):
    turn = np.exp(1j * (one.theta - other.theta))
    return np.allclose(one[:2], other[:2], atol=1e-9) and abs(turn - 1.0) < 1e-9


@given(poses)
def test_a_pose_and_its_inverse_give_the_identity(pose):
    assert same(pose @ pose.inverse(), Pose(0.0, 0.0, 0.0))
    assert same(pose.inverse() @ pose, Pose(0.0, 0.0, 0.0))


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert same((a @ b) @ c, a @ (b @ c))


@given(poses, poses)
def test_applying_a_composition_applies_both(a, b):
    points = np.array([[0.0, 0.0], [1.0, 2.0]])
    assert np.allclose((a @ b).apply(points), a.apply(b.apply(points)))


@given(poses, poses)
def test_rows_of_poses_are_composed_and_compared_as_single_ones(a, b):
    whole = compose(np.array(a), np.array(b))
    assert same(Pose(*whole), a @ b)
    assert same(Pose(*between(np.array(a), whole)), b)


def test_a_bent_path_meets_the_known_poses_and_goes_with_them_before_and_after():
    path = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    known = np.array([[1.0, 1.0, 0.0], [3.0, 2.0, 0.0]])
    assert bent(path, np.array([1, 3]), known)[:, 1] == pytest.approx([1.0, 1.0, 1.5, 2.0, 2.0])


def test_the_text_of_a_pose_is_python_whatever_its_numbers_are():
    numpy, plain = Pose(*np.array([1.5, -2.0, 0.0])), Pose(1.5, -2.0, 0.0)
    assert repr(numpy) == repr(plain) == "Pose(x=1.5, y=-2.0, theta=0.0)"


@pytest.mark.parametrize("bad", [(1, 2), (1, 2, np.nan), "abc", 3, (1, 2, 3, 4)])
def test_what_is_no_pose_is_refused_by_name(bad):
    with pytest.raises(InputError, match="pose"):
        as_pose(bad)


def test_bad_poses_are_named_by_their_row_and_denormal_numbers_are_zero():
    assert as_poses([[1e-310, 1e9, -1e-310]]).tolist() == [[0.0, 1e9, 0.0]]
    with pytest.raises(InputError, match="pose 1"):
        as_poses([[0, 0, 0], [0, np.inf, 0]])
    with pytest.raises(InputError, match="shape"):
        as_poses([[0, 0]])


@pytest.mark.parametrize("taken", [as_pose, lambda pose: as_poses([pose])])
def test_a_heading_of_degrees_is_warned_of(taken):
    taken((1.0, 2.0, 7.0))
    taken((1.0, 2.0, 180.5))
    with pytest.warns(Lrf3dWarning, match=r"theta 180 is read as radians; .*math.radians\(180\)"):
        taken(Pose(1, 2, 180))
