"""The map as it is drawn: its colours on walls, and a ghost where there is none."""

import numpy as np

from lrf3d.scene.drawn_map import DrawnMap
from lrf3d.scene.stage.structures import Structures
from lrf3d.world import World

WALLS = np.array([[0.0, 0.0, 6.0, 0.0], [0.0, 4.0, 6.0, 4.0]])
COLOURS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_what_of_the_map_lies_on_no_wall_stands_free_and_colours_none():
    structures = Structures.from_world(World(WALLS, heights=[1.5, 8.0]))
    here = WALLS - np.tile(structures.origin, 2)
    # One lies on its wall, the other leaves its own half-way and is 1 m off at its end.
    here[1, 3] += 1.0
    drawn = DrawnMap(here, COLOURS)
    ghosts = drawn.ghosts(structures, 0.5)
    x = ghosts.corners[..., 0] + structures.origin[0]
    assert (ghosts.colours[..., :3] == COLOURS[1]).all() and 2.8 < x.min() < 3.5 < x.max()
    middles = 0.5 * (here[:, :2] + here[:, 2:])
    tints, found = drawn.tints(np.vstack([middles, [[13.0, -12.0]]]), 0.6)
    assert found.tolist() == [True, True, False] and (tints[:2] == COLOURS).all()
