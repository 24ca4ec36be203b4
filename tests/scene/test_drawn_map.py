"""Bands of the map: on their walls, no higher than these, and never too thin to be seen."""

import numpy as np
import pytest

from lrf3d.scene.drawn_map import BAND, DrawnMap
from lrf3d.scene.structures import Structures
from lrf3d.world import World

WALLS = np.array([[0.0, 0.0, 6.0, 0.0], [0.0, 4.0, 6.0, 4.0]])
COLOURS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
EYE = np.array([3.0, -2.0, 1.5])


def levels(heights, *, eye=EYE, least=0.0):
    """The lowest and highest corner (2, 2) of the band of each of two walls."""
    faces = DrawnMap(WALLS, COLOURS, np.array(heights)).bands(eye, least=least)
    up = faces.corners[..., 2].reshape(2, -1)
    return np.column_stack([up.min(axis=1), up.max(axis=1)])


def test_a_band_is_no_higher_than_its_wall():
    due = [[0.66 - BAND[1] + BAND[0], 0.66], list(BAND)]
    assert levels([0.66, 2.5]) == pytest.approx(np.array(due), abs=1e-6)


def test_a_band_far_away_is_higher_but_stays_between_the_ground_and_the_top_of_its_wall():
    near, far = (levels([2.5, 2.5], eye=eye, least=0.01) for eye in (EYE, 50.0 * EYE))
    assert (np.ptp(far, axis=1) > 2.0 * np.ptp(near, axis=1)).all()
    assert far.min() > 0.0 and far.max() <= 2.5


def test_a_segment_of_the_map_has_the_height_of_the_wall_that_it_lies_on():
    structures = Structures.from_world(World(WALLS, heights=[1.5, 8.0]))
    here = WALLS - np.tile(structures.origin, 2)
    assert structures.tops(here + 0.1).tolist() == [1.5, 8.0]
    assert np.isinf(structures.tops(here + 50.0)).all()


def test_faces_of_bands_look_outward():
    drawn = DrawnMap(WALLS[:1], COLOURS[:1], np.full(1, 2.5))
    faces = drawn.bands(EYE, least=0.0)
    a, b, c = np.moveaxis(faces.corners.astype(float), 1, 0)
    out = faces.corners.mean(axis=1) - [3.0, 0.0, np.mean(BAND)]
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), out) > 0.0).all()


def test_what_of_the_map_lies_on_no_wall_stands_free_and_colours_none():
    structures = Structures.from_world(World(WALLS, heights=[1.5, 8.0]))
    here = WALLS - np.tile(structures.origin, 2)
    # One lies on its wall, the other leaves its own half-way and is 1 m off at its end.
    here[1, 3] += 1.0
    drawn = DrawnMap(here, COLOURS, structures.tops(here))
    ghosts = drawn.ghosts(structures, 0.5)
    x = ghosts.corners[..., 0] + structures.origin[0]
    assert (ghosts.colours[..., :3] == COLOURS[1]).all() and 2.8 < x.min() < 3.5 < x.max()
    middles = 0.5 * (here[:, :2] + here[:, 2:])
    tints, found = drawn.tints(np.vstack([middles, [[13.0, -12.0]]]), 0.6)
    assert found.tolist() == [True, True, False] and (tints[:2] == COLOURS).all()
