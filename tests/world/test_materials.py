import numpy as np
import pytest

import lrf3d
from lrf3d.world import Material, World, load_world
from lrf3d.world.materials import BUILT_IN, material_of

WALLS = [[0, 0, 4, 0], [4, 0, 4, 3]]


@pytest.mark.parametrize("material", BUILT_IN.values(), ids=str)
def test_a_built_in_material_reflects_no_more_light_than_falls_on_it(material):
    assert material.diffuse + material.specular + material.transmission <= 1.0
    assert World(WALLS, materials=[material.name]).materials == (material,)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"diffuse": -0.1}, "diffuse -0.1: expected a finite number, at least 0 and at most 1"),
        ({"diffuse": np.nan}, "diffuse nan"),
        ({"retro": "much"}, "retro 'much'"),
        ({"index": 0.5}, "index is 0.5; expected 1 or more"),
        ({"index": 1.5, "transmission": 0.5}, "which follow from it"),
        ({"diffuse": 0.6, "transmission": 0.6}, "over 1 together"),
    ],
)
def test_an_invalid_material_is_refused(values, message):
    with pytest.raises(lrf3d.WorldError, match=message):
        Material("own", **values)


@pytest.mark.parametrize(
    ("said", "material"),
    [
        ("metal_plates", BUILT_IN["metal"]),
        ("Brick ", BUILT_IN["brick"]),
        ("rammed_earth", None),
        (None, None),
    ],
)
def test_materials_are_read_as_openstreetmap_says_them(said, material):
    assert material_of(said) == material


def test_a_material_of_a_world_file_stands_for_the_built_in_one(written):
    path = written(
        "w.toml",
        '[[object]]\npoints = [[0, 0], [1, 0]]\nmaterial = "glass"\n'
        '[[material]]\nname = "glass"\nindex = 1.9\n',
    )
    assert load_world(path).materials == (Material("glass", index=1.9),)


def test_a_run_keeps_the_materials_of_its_world_and_what_its_laser_makes_of_light(tmp_path):
    own = Material("frosted", diffuse=0.1, transmission=0.5)
    world = World(WALLS, objects=[0, 2], materials=["mirror", None, own])
    lrf = lrf3d.LaserRangeFinder(threshold=1e-4, near_field=0.3, echo="last", echoes=2)
    lrf3d.save_run(lrf3d.simulate(world, [(1, 1, 0)], lrf, rng=0), tmp_path / "run.npz")
    back = lrf3d.load_run(tmp_path / "run.npz")
    assert (back.world.materials, back.lrf) == (world.materials, lrf)
