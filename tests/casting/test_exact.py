import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from rational import ExactWorld, cast_exact

from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World

AHEAD = (1.0, 0.0)


def cast(walls, origin, direction=AHEAD):
    return cast_exact(np.array(walls, dtype=np.float64), origin, direction)


def test_a_beam_meets_a_wall_where_the_fractions_say():
    assert cast([[3, -1, 3, 2]], (0, 0)) == (0, 3)
    # x + 3y = 3 meets y = x / 2 at x = 6/5: t = 6/5 along (1, 1/2).
    assert cast([[0, 1, 3, 0]], (0, 0), (1.0, 0.5)) == (0, Fraction(6, 5))


def test_float64_is_taken_as_it_is_and_not_as_the_decimal_it_prints():
    assert cast([[0.1, -1, 0.1, 1]], (0, 0)) == (0, Fraction(0.1))
    assert cast([[0.1, -1, 0.1, 1]], (0, 0))[1] != Fraction(1, 10)


@pytest.mark.parametrize(
    ("walls", "winner"),
    [([[2, 0, 2, 1], [2, 0, 3, -1]], 0), ([[2, 0, 3, -1], [2, 0, 2, 1]], 0)],
)
def test_through_a_shared_corner_the_lowest_index_wins(walls, winner):
    assert cast(walls, (0, 0)) == (winner, 2)


def test_an_end_point_belongs_to_its_wall_and_a_hair_beside_it_does_not():
    assert cast([[2, 0, 2, 1]], (0, 0)) == (0, 2)
    assert cast([[2, 1, 2, 0]], (0, 0)) == (0, 2)
    assert cast([[2, 5e-324, 2, 1]], (0, 0)) == (-1, None)
    assert cast([[2, -1, 2, -5e-324]], (0, 0)) == (-1, None)


@pytest.mark.parametrize(
    ("origin", "t"), [((0, 0), 3), ((4, 0), 0), ((3, 0), 0), ((7, 0), 0), ((8, 0), None)]
)
@pytest.mark.parametrize("wall", [[3, 0, 7, 0], [7, 0, 3, 0]])
def test_along_a_wall_the_range_ends_at_its_nearest_point(wall, origin, t):
    assert cast([wall], origin) == (-1 if t is None else 0, t)


def test_along_a_slanted_wall_t_counts_in_lengths_of_the_direction():
    assert cast([[2, 4, 6, 12]], (0, 0), (0.5, 1.0)) == (0, 4)
    assert cast([[2, 4, 6, 12]], (0, 0), (0.0, 1.0)) == (-1, None)
    assert cast([[0, 9, 0, 6]], (0, 2), (0.0, 1.0)) == (0, 4)


def test_beside_a_parallel_wall_a_beam_misses():
    assert cast([[3, 1e-300, 7, 1e-300]], (0, 0)) == (-1, None)


def test_from_a_point_on_a_wall_every_beam_has_t_0():
    for direction in (AHEAD, (-1.0, 0.0), (0.0, 1.0), (0.3, 0.7)):
        assert cast([[9, 9, 9, 8], [-1, 1, 1, -1]], (0, 0), direction) == (1, 0)
        assert cast([[0, 0, 1, -1]], (0, 0), direction) == (0, 0)


def test_what_lies_behind_is_missed_also_in_line():
    assert cast([[-3, -1, -3, 1]], (0, 0)) == (-1, None)
    assert cast([[-7, 0, -3, 0]], (0, 0)) == (-1, None)
    assert cast([[-3, -1, -3, 1], [5, -1, 5, 1]], (0, 0)) == (1, 5)


def test_all_hits_are_found_and_no_walls_are_a_miss():
    world = ExactWorld(np.array([[4, -1, 4, 1], [2, -1, 2, 1.0]]), [(0, 0), (3, 0)])
    assert world.hits(0, AHEAD) == [(0, 4), (1, 2)]
    assert world.cast(1, AHEAD) == (0, 1)
    assert cast_exact(np.empty((0, 4)), (0, 0), AHEAD) == (-1, None)


grid = st.integers(-3, 3).map(float)


@given(
    st.lists(st.tuples(grid, grid, grid, grid), min_size=1, max_size=5),
    st.tuples(grid, grid),
    st.tuples(grid, grid).filter(any),
    st.tuples(st.integers(-60, 60), st.integers(1, 2**40)),
)
@settings(max_examples=150, deadline=None)
def test_moving_scaling_and_turning_a_world_moves_scales_and_turns_its_ranges(
    walls, origin, direction, change
):
    power, shift = change
    walls = np.array(walls)
    wall, t = cast_exact(walls, origin, direction)
    assert cast_exact(walls + shift, np.array(origin) + shift, direction) == (wall, t)
    scaled = cast_exact(walls * 2.0**power, np.array(origin) * 2.0**power, direction)
    assert scaled == (wall, None if t is None else t * Fraction(2) ** power)
    quarter = np.column_stack([-walls[:, 1], walls[:, 0], -walls[:, 3], walls[:, 2]])
    turned = cast_exact(quarter, (-origin[1], origin[0]), (-direction[1], direction[0]))
    assert turned == (wall, t)


@pytest.mark.parametrize("caster", [PlanarCaster, EmbreeCaster])
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_a_beam_that_is_exactly_upright_ends_at_the_nearest_point_of_upright_walls(caster, up):
    # Turned from this heading by this angle, a beam has the direction (0, 1) to the last bit.
    lrf, theta = LaserRangeFinder(up * 1.001, up * 1.001, 1), up * 0.5697963267948968
    assert lrf.directions((0, 0, theta)).tolist() == [[0.0, up]]
    rng = np.random.default_rng(0)
    for _ in range(40):
        ends = rng.uniform(-9.0, 9.0, (4, 2))
        walls = np.column_stack([np.full(4, 0.3), ends[:, 0], np.full(4, 0.3), ends[:, 1]])
        walls = np.vstack([walls[: rng.integers(1, 5)], rng.uniform(-5.0, 5.0, (2, 4))])
        y = float(rng.uniform(-9.0, 9.0))
        wall, t = cast_exact(walls, (0.3, y), (0.0, up))
        scan = caster(World(walls)).cast(lrf, (0.3, y, theta))
        assert scan.walls.tolist() == [wall]
        assert scan.ranges.tolist() == [np.inf if t is None else float(t)]


@njit
def compiled_cos_sin(angles):
    found = np.empty((len(angles), 2))
    for i in range(len(angles)):
        found[i, 0], found[i, 1] = math.cos(angles[i]), math.sin(angles[i])
    return found


def test_compiled_cosines_and_sines_have_the_bits_of_pythons():
    rng = np.random.default_rng(0)
    angles = np.concatenate(
        [
            rng.uniform(-10, 10, 20_000),
            rng.uniform(-1e6, 1e6, 2_000),
            10.0 ** rng.uniform(-18, 0, 2_000),
            0.5 * np.pi * np.arange(-8, 9),
        ]
    )
    expected = [(math.cos(angle), math.sin(angle)) for angle in angles.tolist()]
    assert np.array_equal(compiled_cos_sin(angles), expected)
