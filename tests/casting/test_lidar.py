"""Layers of lidars and columns of depth cameras, by rational numbers and by single rays."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import (
    DepthCamera,
    EmbreeCaster,
    InputError,
    LaserRangeFinder,
    Lidar,
    PlanarCaster,
    World,
    load_world,
)
from lrf3d.casting.skyline import Layered, Walls, _columns, rays_along
from tests.helpers.rational import cast_layer

# Numbers whose sums and quotients often meet: beams through corners, along walls, at heights.
HEIGHTS = st.sampled_from([0.25, 0.5, 0.75, 1.0, 1.25, 2.0])
SHAPES = [
    [(0, 0), (1, 0), (1, 1), (0, 1)],
    [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    [(1, 0), (2, 1), (1, 2), (0, 1)],
    [(0, 0), (2, 0), (1, 1), (2, 2), (0, 2)],
]


@st.composite
def scenes(draw: Any) -> tuple[list[Any], list[Any], World]:
    """Walls and tops as `cast_layer` takes them, on a grid of cells of three metres."""
    walls: list[Any] = []
    tops: list[Any] = []
    owners: list[int] = []
    cells = draw(st.lists(st.integers(0, 8), min_size=1, max_size=5, unique=True))
    for number, cell in enumerate(cells):
        east = 3.0 * (cell % 3) + 1.0
        north = 3.0 * (cell // 3) - 4.0
        height = draw(HEIGHTS)
        corners = [(east + x, north + y) for x, y in draw(st.sampled_from(SHAPES))]
        if draw(st.booleans()):
            tops.append((corners, height))
        else:
            corners = corners[:-1]
        turned = draw(st.booleans())
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            if len(tops) and tops[-1][0] is corners or (bx, by) != corners[0]:
                walls.append(((bx, by, ax, ay) if turned else (ax, ay, bx, by), height))
                owners.append(number)
    for number in range(draw(st.integers(0, 2))):
        # Walls that touch others, and stand on the lines between cells.
        x = draw(st.integers(0, 3)) * 3.0
        walls.append(((x, -4.0, x, draw(st.integers(-2, 5))), draw(HEIGHTS)))
        owners.append(len(cells) + number)
    segments = [ends for ends, _ in walls]
    return walls, tops, World(segments, owners, [height for _, height in walls])


def exact_ranges(scene: Any, place: Any, rays: Any, slopes: Any) -> list[list[Fraction | None]]:
    walls, tops, _ = scene
    return [
        [cast_layer(walls, tops, place, (ray["dx"], ray["dy"], slope)) for slope in slopes]
        for ray in rays
    ]


def assert_equal(found: Any, expected: Any) -> None:
    for ranges, exact in zip(found, expected, strict=True):
        for t, true in zip(ranges, exact, strict=True):
            if true is None:
                assert t == math.inf
            else:
                assert t == pytest.approx(float(true), rel=1e-14, abs=0.0)


@settings(max_examples=150)
@given(scenes(), st.integers(-8, 10), st.sampled_from([0.5, 0.75, 1.0, 1.5]), st.data())
def test_columns_are_those_of_rational_numbers(scene: Any, y: int, z: float, data: Any) -> None:
    place = (0.0, 0.5 * y, z)
    ways = st.tuples(st.integers(1, 4), st.integers(-4, 4), st.just(0))
    beams = np.array(data.draw(st.lists(ways, min_size=1, max_size=6)), float)
    # Slopes that meet the tops and feet of walls on the grid at their ends.
    over = st.builds(lambda h, t: (h - z) / t, st.sampled_from([0.0, 0.25, 0.5, 1, 2]), st.integers(1, 9))
    slopes = sorted(data.draw(st.sets(over, min_size=1, max_size=8)))
    rays = rays_along(place, beams)
    layers = Layered.of(np.array([slopes]), np.ones(len(slopes)), LaserRangeFinder(range_max=1e6))
    walls = Walls(scene[2])
    found, _ = _columns(walls, walls.standing(np.array(place), z), rays, z, layers)
    assert_equal(found, exact_ranges(scene, place, rays, slopes))


@settings(max_examples=60)
@given(scenes(), st.integers(-8, 10), st.sampled_from([0.5, 0.75, 1.0, 1.5]))
def test_layers_are_those_of_rational_numbers(scene: Any, y: int, z: float) -> None:
    place = (0.0, 0.5 * y, z)
    elevations = [-1.2, *np.arctan([(h - z) / t for h in (0, 0.5, 1) for t in (1, 3, 7)]), 0.0]
    lidar = Lidar(elevations, columns=8, mount=(0, 0, z), range_max=1e6)
    scan = PlanarCaster(scene[2]).cast_lidar(lidar, (*place[:2], 0.0))
    beams = np.column_stack([lidar.planar.directions((0, 0, 0)), np.zeros(8)])
    exact = exact_ranges(scene, place, rays_along(place, beams), lidar.slopes)
    assert_equal((scan.ranges / lidar.stretches[:, None]).T, exact)
