"""Faces in pieces: small where light changes, put together where it changes evenly."""

import numpy as np
import pytest

from lrf3d.geometry import lengths
from lrf3d.scene.pieces import Pieces, cut_small, put_together

LIGHT = [3]


def wall(length: float, height: float) -> np.ndarray:
    """A quad whose corners have a place, and a fourth value for light."""
    quad = np.zeros((4, 4), np.float32)
    quad[[1, 2], 0], quad[[2, 3], 2] = length, height
    return quad


def lit(quads: list[np.ndarray], light, *, step: float = 1.0) -> Pieces:
    """Small pieces with a light at their corners that is a function of x and z."""
    pieces = cut_small(np.array(quads), step, 1000)
    pieces.quads[..., 3] = light(pieces.quads[..., 0], pieces.quads[..., 2])
    return pieces


def together(pieces: Pieces, kinds=None, walls=None) -> Pieces:
    """Pieces put together, as those of one object."""
    none = np.zeros(len(pieces.quads), dtype=int)
    kinds, walls = (none if each is None else each for each in (kinds, walls))
    return put_together(pieces, LIGHT, kinds, walls, none, error=0.01)[0]


def area(pieces: Pieces) -> float:
    """The area of upright pieces along x."""
    sides = pieces.quads[:, 2] - pieces.quads[:, 0]
    return float((sides[:, 0] * sides[:, 2]).sum())


def test_light_that_changes_evenly_needs_one_piece():
    pieces = lit([wall(8.0, 4.0)], lambda x, z: 0.1 * x + 0.2 * z)
    assert len(pieces.quads) == 32
    large = together(pieces)
    assert len(large.quads) == 1
    assert large.quads[0] == pytest.approx(
        np.array([[0, 0, 0, 0], [8, 0, 0, 0.8], [8, 0, 4, 1.6], [0, 0, 4, 0.8]])
    )


def test_light_stays_within_its_error_and_walls_stay_whole():
    pieces = lit([wall(16.0, 3.0), wall(5.0, 2.0)], lambda x, z: np.exp(-x) * (1.0 + 0.1 * z))
    large = together(pieces, walls=pieces.owners)
    assert 2 < len(large.quads) < len(pieces.quads)
    assert area(large) == pytest.approx(area(pieces))
    # At every corner of a small piece, what is mixed in the large one is right.
    for corner in pieces.quads.reshape(-1, 4).astype(float):
        x, _, z, light = corner
        for quad in large.quads.astype(float):
            (left, low), (right, high) = quad[0, [0, 2]], quad[2, [0, 2]]
            if not (left <= x <= right and low <= z <= high):
                continue
            s, t = (x - left) / (right - left), (z - low) / (high - low)
            mixed = (1 - t) * ((1 - s) * quad[0, 3] + s * quad[1, 3])
            mixed += t * ((1 - s) * quad[3, 3] + s * quad[2, 3])
            assert mixed == pytest.approx(light, abs=0.02) or x == right or z == high


def test_all_pieces_of_a_wall_are_as_wide():
    pieces = lit([wall(8.0, 1.0), wall(8.0, 1.0)], lambda x, z: 0.0 * x)
    pieces.quads[pieces.owners == 1, :, 3] = np.sin(3.0 * pieces.quads[pieces.owners == 1, :, 0])
    large = together(pieces)
    widths = lengths(large.quads[:, [0, 1]][:, :, [0, 2]].reshape(-1, 4).astype(float))
    assert widths == pytest.approx(np.full(len(widths), widths[0]))
    assert len(together(pieces, walls=pieces.owners).quads) < len(large.quads)


def test_what_is_painted_otherwise_stays_apart():
    pieces = lit([wall(2.0, 4.0)], lambda x, z: 0.0 * x)
    foot = (pieces.quads[:, 0, 2] < 0.5).astype(int)
    large = together(pieces, kinds=foot)
    assert sorted(large.quads[:, 2, 2].tolist()) == [1.0, 4.0]
    assert len(together(pieces).quads) == 1


def test_nothing_is_put_together_of_nothing():
    none = cut_small(np.zeros((0, 4, 4), np.float32), 1.0, 10)
    assert len(together(none).quads) == 0
