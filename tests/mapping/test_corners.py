import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.links import CORNER_REACH, CORNER_SINE, close_corners


def cross(one, other):
    return one[0] * other[1] - one[1] * other[0]


def crossing_of(one, other, side, turned):
    """Where the lines of two walls cross, if the two ends may meet there; else None."""
    begins, ways = (
        np.array([one[:2], other[:2]]),
        np.array([one[2:] - one[:2], other[2:] - other[:2]]),
    )
    sizes, turn = np.hypot(*ways.T), cross(*ways)
    if abs(turn) < CORNER_SINE * sizes.prod():
        return None
    for way, size, end in zip((1, 0), sizes, (side, turned), strict=True):
        # How far beyond its end a wall reaches the corner.
        along = cross(begins[1] - begins[0], ways[way]) / turn
        beyond = size * (along - 1.0 if end else -along)
        if not -min(CELL, 0.5 * size) <= beyond <= CORNER_REACH:
            return None
    return begins[0] + cross(begins[1] - begins[0], ways[1]) / turn * ways[0]


def closed_by_definition(ends, objects):
    """Two ends, each the nearest to the other of all that it may meet, are where they cross."""
    partners = {}
    for end in range(2 * len(ends)):
        wall, side = divmod(end, 2)
        found = []
        for other in range(2 * len(ends)):
            row, turned = divmod(other, 2)
            if row == wall or objects[row] != objects[wall]:
                continue
            corner = crossing_of(ends[wall], ends[row], side, turned)
            if corner is not None:
                dx, dy = ends[row].reshape(2, 2)[turned] - ends[wall].reshape(2, 2)[side]
                # Of equally near ones the order of the rows decides.
                found.append((dx * dx + dy * dy, other, tuple(corner)))
        partners[end] = min(found, default=(0.0, -1, ()))
    closed = ends.copy()
    for end, (_, other, corner) in partners.items():
        if other >= 0 and partners[other][1] == end:
            closed[end // 2].reshape(2, 2)[end % 2] = corner
    return closed


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.sampled_from([0.0, 0.0625, 0.25]))
def test_closed_corners_are_those_of_the_definition(seed, count, step):
    """Ends round one place, at any distance or on a lattice, where many are equally near."""
    rng = np.random.default_rng(seed)
    middle, heading = rng.choice([0.0, -7.0, 20.0], 2), rng.uniform(-np.pi, np.pi, count)
    near_ends = rng.uniform(-0.3, 0.3, (count, 2))
    reach = rng.choice([0.1, 0.15, 0.5, 3.0], (count, 1))
    far_ends = near_ends + reach * np.column_stack([np.cos(heading), np.sin(heading)])
    if step:
        near_ends, far_ends = (step * np.round(each / step) for each in (near_ends, far_ends))
        far_ends += np.where((near_ends == far_ends).all(axis=1), step, 0.0)[:, None]
    ends = np.tile(middle, 2) + np.hstack([near_ends, far_ends])
    turned = rng.random(count) < 0.5
    ends[turned] = ends[turned][:, [2, 3, 0, 1]]
    objects = rng.integers(0, 2, count) if count > 4 else np.zeros(count, np.int64)
    assert close_corners(ends, objects) == pytest.approx(
        closed_by_definition(ends, objects), abs=1e-9
    )


@pytest.mark.parametrize(
    ("gap", "cut", "closed"), [(0.29, 0, True), (0.31, 0, False), (0, 0.09, True), (0, 0.11, False)]
)
def test_a_wall_reaches_thirty_centimetres_to_a_corner_and_loses_ten_to_it(gap, cut, closed):
    ends = np.array([[0.0, 0.0, 4.0 - gap + cut, 0.0], [4.0, 0.0, 4.0, 3.0]])
    found = close_corners(ends, np.zeros(2, np.int64))[0]
    assert found.tolist() == ([0.0, 0.0, 4.0, 0.0] if closed else ends[0].tolist())
