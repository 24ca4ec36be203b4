"""Light between faces: an open field, a corner, and what a wall sends on."""

import numpy as np
import pytest
from test_render import box

from lrf3d.scene.light import open_light
from lrf3d.scene.look import GAMMA, SKYSHINE
from lrf3d.scene.stage import paint_faces
from lrf3d.scene.structures import Structures
from lrf3d.world import World


def painted(walls, height, colours=None):
    count = len(walls) // 4
    objects, heights = np.repeat(np.arange(count), 4), np.full(len(walls), float(height))
    structures = Structures.from_world(World(walls, objects, heights, colours=colours))
    return structures, paint_faces(structures)


def middles(walls):
    return walls.places.mean(axis=1)


def light_of(walls):
    """The light (n, 4, 3) where the sun is hidden at the corners of faces, linear."""
    return walls.shaded.astype(float) ** GAMMA


def test_open_ground_has_the_whole_light_of_the_sky_and_less_of_it_beside_a_house():
    _, walls = painted(np.array(box(-5.0, -5.0, 10.0, 10.0)), 12.0)
    x = np.array([5.3, 8.0, 14.0, 40.0, 120.0])
    light, open_air = walls[1].ground(np.column_stack([x, np.zeros(5)]))
    assert open_air.all() and (np.diff(light[:, 2]) > -0.01).all()
    assert light[0, 2] < 0.88 * SKYSHINE[2] and light[-1] == pytest.approx(SKYSHINE, rel=0.03)


def test_under_a_house_it_is_dark_and_known_to_be():
    _, walls = painted(np.array(box(-5.0, -5.0, 10.0, 10.0)), 12.0)
    light, open_air = walls[1].ground(np.array([[0.0, 0.0], [2.0, -3.0]]))
    assert not open_air.any() and (light < 0.05).all()


def test_a_wall_facing_open_land_sees_half_the_sky_and_land_in_the_sun():
    _, walls = painted(np.array(box(-5.0, -5.0, 10.0, 10.0)), 12.0)
    upright = walls[0].normals[:, 0, 2] < 0.5
    outer = upright & (np.abs(middles(walls[0])[:, :2]).max(axis=1) > 4.99)
    light = light_of(walls[0])[outer].mean(axis=1)
    assert (light > 0.45 * SKYSHINE).all() and (light < 1.1 * SKYSHINE).all()


def test_light_takes_on_the_colour_of_what_it_comes_from():
    walls = np.array([*box(0.0, 0.0, 8.0, 8.0), *box(11.0, 0.0, 8.0, 8.0)])
    ratios = []
    for colour in ([0.9, 0.1, 0.1], [0.1, 0.1, 0.9]):
        colours = np.array([[0.5, 0.5, 0.5], colour])
        structures, found = painted(walls, 10.0, colours)
        quads = middles(found[0]) + np.append(structures.origin, 0.0)
        # The grey wall that looks at the coloured one.
        facing = (np.abs(quads[:, 0] - 8.0) < 0.01) & (found[0].normals[:, 0, 0] > 0.5)
        light = light_of(found[0])[facing].mean(axis=(0, 1))
        ratios.append(light[0] / light[2])
    assert ratios[0] > 1.1 * ratios[1]


def test_the_inner_corner_of_a_room_is_darker_than_the_middle_of_its_floor():
    walls = [[0, 0, 6, 0], [6, 0, 6, 5], [6, 5, 0, 5], [0, 5, 0, 0]]
    structures = Structures.from_world(World(walls), np.array([[3.0, 2.0]]))
    places = np.array([[3.0, 2.5], [0.15, 0.15]]) - structures.origin
    walls = paint_faces(structures)
    light, open_air = walls[1].ground(places)
    assert open_air.all() and light[1].mean() < 0.85 * light[0].mean()


def test_light_is_the_same_each_time_and_that_of_an_open_field_without_a_wall():
    walls = np.array(box(0.0, 0.0, 6.0, 4.0))
    one, other = (painted(walls, 7.0)[1][0].shaded for _ in range(2))
    assert np.array_equal(one, other)
    bare = Structures.from_world(World(np.zeros((0, 4))))
    empty = paint_faces(bare)[1]
    light, open_air = empty.ground(np.zeros((2, 2)))
    assert open_air.all() and light[0] == pytest.approx(open_light(indoor=True), rel=1e-6)
