"""Bands of the map: on their walls, no higher than these, and growing from what was known."""

import numpy as np
import pytest

from lrf3d.scene.look import MAP_BAND
from lrf3d.scene.map_bands import BAND_SIZES, GLOW, SOLID, WallTops, map_bands

WALLS = np.array([[0.0, 0.0, 6.0, 0.0], [0.0, 4.0, 6.0, 4.0]])
COLOURS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_a_band_is_no_higher_than_its_wall():
    tops = WallTops(WALLS, np.array([0.66, 2.5]))
    assert tops.of(WALLS).tolist() == [0.66, np.inf]
    assert tops.bands(WALLS) == pytest.approx([0.66, MAP_BAND[1]])
    rows = map_bands(WALLS, COLOURS, tops.of(WALLS), WALLS).solid.reshape(2, -1, sum(BAND_SIZES))
    middle, top = rows[0, :, 7].astype(float), rows[0, :, 8]
    half = 0.5 * (MAP_BAND[1] - MAP_BAND[0])
    assert middle + half == pytest.approx(np.full(len(middle), 0.66), abs=1e-6)
    assert (top == np.float32(0.66)).all()


def test_bands_grow_from_what_the_map_before_showed():
    before = np.array([[1.0, 0.02, 3.0, 0.02]])
    rows = map_bands(WALLS, COLOURS, np.full(2, np.inf), before).solid.astype(float)
    known, new = rows.reshape(2, -1, sum(BAND_SIZES))
    assert known[:, 0].min() == pytest.approx(1.0) and known[:, 0].max() == pytest.approx(3.0)
    assert known[:, 2].min() == 0.0 and known[:, 2].max() == 6.0
    # A wall that is seen for the first time grows from its middle.
    assert new[:, :2] == pytest.approx(np.tile([3.0, 4.0], (len(new), 1)))
    assert (known[:, 9:12] == COLOURS[0]).all() and (new[:, 9:12] == COLOURS[1]).all()


def test_a_segment_that_stays_does_not_grow_again():
    rows = map_bands(WALLS, COLOURS, np.full(2, np.inf), WALLS[::-1]).solid
    assert np.array_equal(rows[:, 0:2], rows[:, 2:4])


def test_the_glow_fades_away_from_its_band():
    glow = map_bands(WALLS, COLOURS, np.full(2, np.inf), WALLS).glow
    near = np.abs(glow[:, 6]) <= 1.0
    assert (glow[near, 12] > 0.0).all() and (glow[~near, 12] == 0.0).all() and near.mean() == 0.5


def test_corners_are_shared_by_the_faces_of_a_band():
    bands = map_bands(WALLS, COLOURS, np.full(2, np.inf), WALLS)
    assert len(bands.solid) == 2 * 8 and len(bands.glow) == 2 * 16
    assert len(SOLID) == 5 * 6 and len(GLOW) == 4 * 6
    assert SOLID.max() == 7 and GLOW.max() == 15


def test_a_map_of_nothing_has_no_band():
    nothing = np.zeros((0, 4))
    bands = map_bands(nothing, np.zeros((0, 3)), np.zeros(0), WALLS)
    assert len(bands.solid) == len(bands.glow) == 0
    assert len(WallTops(nothing, np.zeros(0)).of(WALLS)) == 2
