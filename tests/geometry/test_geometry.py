import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import (
    fit_line,
    lengths,
    normal_lines,
    number,
    numbers,
    read_only,
    whole_number,
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
    # The remainder of the last rounds to a full turn, which would give −π.
    for angle in (np.pi, -np.pi, np.nextafter(np.pi, 4.0)):
        assert wrap_angle(angle) == np.pi


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


def test_a_normal_along_minus_x_has_the_angle_pi_and_one_at_the_origin_is_the_left_one():
    walls = [[-2, 0, -2, 5], [-2, 5, -2, 0], [0, -1, -1e-38, 0], [1, 1, 2, 2], [2, 2, 1, 1]]
    lines = normal_lines(np.array(walls, dtype=float))
    assert lines[:, 0] == pytest.approx([np.pi, np.pi, np.pi, 0.75 * np.pi, -0.25 * np.pi])
    assert lines[:, 1] == pytest.approx([2.0, 2.0, 0.0, 0.0, 0.0])


@given(st.floats(0, 2 * np.pi), metres, metres)
def test_points_on_a_line_are_fitted_far_from_the_origin_too(heading, x, y):
    unit = np.array([np.cos(heading), np.sin(heading)])
    points = 1e6 + np.array([x, y]) + np.linspace(-1.0, 1.0, 20)[:, None] * unit
    mean, found = fit_line(points)
    assert abs(found @ unit) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(mean, points.mean(axis=0))


@given(st.lists(st.tuples(metres, metres, st.integers(1, 5)), min_size=2, max_size=8))
def test_a_weight_counts_a_point_so_many_times(weighted):
    points = np.array([(x, y) for x, y, _ in weighted])
    weights = np.array([float(weight) for *_, weight in weighted])
    mean, unit = fit_line(points, weights)
    repeated = np.repeat(points, weights.astype(int), axis=0)
    centred = repeated - repeated.mean(axis=0)
    assert mean == pytest.approx(repeated.mean(axis=0))
    assert np.hypot(*unit) == pytest.approx(1.0)
    # No other direction has a larger spread.
    along = ((centred @ unit) ** 2).sum()
    assert along == pytest.approx(np.linalg.svd(centred)[1][0] ** 2, rel=1e-6, abs=1e-6)


def test_arrays_from_outside_are_copied_unless_nobody_can_write_to_them():
    given_array = np.arange(6.0).reshape(2, 3)
    kept = read_only(given_array, "name")
    assert not kept.flags.writeable and not np.shares_memory(kept, given_array)
    given_array[0, 0] = 9.0
    assert kept[0, 0] == 0.0
    assert read_only(kept, "name") is kept and read_only(kept[:1], "name").base is kept
    for other in (kept.T, kept.astype(np.float32), kept.tolist()):
        made = read_only(other, "name")
        assert made is not other and made.dtype == np.float64 and not made.flags.writeable
    # A read-only view of an array that can be written to may still change.
    view = given_array[:]
    view.setflags(write=False)
    assert not np.shares_memory(read_only(view, "name"), given_array)


def test_numbers_of_any_kind_are_numbers_and_words_are_not():
    assert numbers([1, 2.5], "name").tolist() == [1, 2.5]
    assert numbers([True, False], "name").dtype == bool
    assert numbers([2**70, 1], "name").tolist() == [2.0**70, 1.0]
    assert numbers(np.array([1, 2], np.uint8), "name").dtype == np.uint8
    for wrong in ("word", ["a"], [1, [2, 3]], [1j], [object()]):
        with pytest.raises(InputError, match="name: expected numbers in rows of equal length"):
            numbers(wrong, "name")


def test_numbers_are_those_within_their_limits():
    assert number(0, "height") == 0.0 and number(5.0, "height", most=5.0) == 5.0
    for wrong in (-0.5, 0.0, 5.5, np.nan, np.inf, "3", None):
        with pytest.raises(InputError, match=r"height .* of metres, above 0 and at most 5"):
            number(wrong, "height", "metres", positive=True, most=5.0)


def test_whole_numbers_are_those_within_their_limits():
    for value in (1, 5, 5.0, np.int64(3)):
        assert whole_number(value, "beams", most=5) == value
        assert type(whole_number(value, "beams", most=5)) is int
    assert whole_number(1, "beams") == 1 and whole_number(10**9, "beams") == 10**9
    assert whole_number(0, "key scan", least=0, most=0) == 0
    too_many = [(wrong, {"most": 5}) for wrong in (0, 6, 2.5, -3, np.nan, np.inf, "3", None)]
    for wrong, limits in (*too_many, (1, {"least": 0, "most": 0}), (0, {}), (2.5, {})):
        said = f"from {limits.get('least', 1)} to {limits['most']}" if limits else "of at least 1"
        with pytest.raises(InputError, match=f"beams .*: expected a whole number {said}"):
            whole_number(wrong, "beams", **limits)
