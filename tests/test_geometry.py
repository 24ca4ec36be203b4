import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lrf3d.geometry import (
    directions,
    fit_line,
    lengths,
    normal_lines,
    principal_direction,
    wrap_angle,
)

metres = st.floats(-1e4, 1e4)
angles = st.floats(-50.0, 50.0)


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_circle_and_point_the_same_way(angle):
    wrapped = wrap_angle(angle)
    assert -np.pi < wrapped <= np.pi
    assert np.allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)])


def test_an_angle_inside_keeps_its_bits_and_minus_pi_becomes_pi():
    assert wrap_angle(0.1) == 0.1
    assert wrap_angle(np.pi) == np.pi
    assert wrap_angle(-np.pi) == np.pi


@given(metres, metres, metres, metres)
def test_both_ends_of_a_segment_lie_on_its_normal_line(x1, y1, x2, y2):
    segment = np.array([[x1, y1, x2, y2]])
    if lengths(segment)[0] < 1e-3:
        return
    alpha, p = normal_lines(segment)[0]
    assert -np.pi < alpha <= np.pi and p >= 0.0
    reach = 1e-9 * (1.0 + np.abs(segment).max() ** 2 / lengths(segment)[0])
    for x, y in ((x1, y1), (x2, y2)):
        assert abs(x * np.cos(alpha) + y * np.sin(alpha) - p) <= reach


def test_a_normal_along_minus_x_has_the_angle_pi():
    assert normal_lines(np.array([[-2.0, 0.0, -2.0, 5.0]]))[0] == pytest.approx([np.pi, 2.0])
    assert normal_lines(np.array([[-2.0, 5.0, -2.0, 0.0]]))[0] == pytest.approx([np.pi, 2.0])
    assert normal_lines(np.array([[0.0, -1.0, -1e-38, 0.0]]))[0] == pytest.approx([np.pi, 0.0])


@given(st.floats(0, 2 * np.pi), metres, metres)
def test_points_on_a_line_are_fitted_far_from_the_origin_too(heading, x, y):
    unit = np.array([np.cos(heading), np.sin(heading)])
    points = 1e6 + np.array([x, y]) + np.linspace(-1.0, 1.0, 20)[:, None] * unit
    mean, found = fit_line(points)
    assert abs(found @ unit) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(mean, points.mean(axis=0))


def test_weights_pull_the_line():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]])
    mean, _ = fit_line(points, np.array([1.0, 1.0, 0.0]))
    assert mean == pytest.approx([0.5, 0.0])


def test_the_principal_direction_is_that_of_the_largest_spread():
    assert np.abs(principal_direction(4.0, 0.0, 1.0)) == pytest.approx([1.0, 0.0])
    assert np.abs(principal_direction(1.0, 0.0, 4.0)) == pytest.approx([0.0, 1.0])


def test_directions_are_unit_vectors():
    segments = np.array([[0.0, 0.0, 3.0, 4.0], [1.0, 1.0, 1.0, -1.0]])
    assert directions(segments) == pytest.approx(np.array([[0.6, 0.8], [0.0, -1.0]]))
