"""Light between faces: an open field, a corner, and what a wall sends on."""

import numpy as np
import pytest
from test_render import box

from lrf3d.scene import light as module
from lrf3d.scene.light import bake_light, open_light
from lrf3d.scene.look import GAMMA
from lrf3d.scene.panels import cut_small
from lrf3d.scene.stage import paint_stage
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import lay_walls
from lrf3d.world import World


def painted(walls, height, colours=None):
    """The faces of houses, the light (n,) on each, and their world."""
    objects = np.repeat(np.arange(len(walls) // 4), 4)
    world = World(walls, objects, np.full(len(walls), float(height)), colours=colours)
    structures = Structures.from_world(world)
    faces = paint_stage(structures).faces
    return faces, (faces.light.astype(float) ** GAMMA).mean(axis=(1, 2)), structures


def on_ground(structures, places, reach):
    """The light (n, 3) on the ground at places (n, 2) of a world, which lie within a reach [m]."""
    faces = cut_small(lay_walls(structures), 1.0, 10_000)
    low, high = -reach * np.ones(2), reach * np.ones(2)
    light = bake_light(faces, low, high, indoor=structures.indoor).ground
    share = (places - structures.origin - low) / (high - low)
    column, row = (share * light.shape[1::-1]).astype(int).T
    return light[row, column]


def test_open_ground_has_the_whole_light_of_the_sky_and_less_of_it_next_to_a_house():
    structures = Structures.from_world(World(box(-5.0, -5.0, 10.0, 10.0), None, [12.0] * 4))
    x = np.array([5.9, 9.0, 15.0, 30.0, 58.0])
    light = on_ground(structures, np.column_stack([x, np.zeros(5)]), 60.0)
    assert (np.diff(light[:, 2]) > -0.01).all()
    assert light[-1] == pytest.approx(open_light(indoor=False), rel=0.02)
    assert light[0].max() < 0.88 * light[-1].max()


def test_light_is_the_same_each_time_and_that_of_an_open_field_without_a_wall():
    walls = np.array(box(0.0, 0.0, 6.0, 4.0))
    one, other = (painted(walls, 7.0)[1] for _ in range(2))
    assert np.array_equal(one, other)
    bare = Structures.from_world(World(np.zeros((0, 4))))
    light = on_ground(bare, np.zeros((2, 2)), 5.0)
    assert light[0] == pytest.approx(open_light(indoor=True), rel=1e-6)


def test_between_white_walls_more_bounces_would_change_nothing_that_is_seen(monkeypatch):
    walls = np.array([*box(0.0, 0.0, 20.0, 8.0), *box(0.0, 11.0, 20.0, 8.0)])
    white = np.full((2, 3), 0.95)
    light = [painted(walls, 12.0, white)[0].light]
    monkeypatch.setattr(module, "_BOUNCES", 20)
    light.append(painted(walls, 12.0, white)[0].light)
    assert np.abs(light[1] - light[0]).max() < 0.01
