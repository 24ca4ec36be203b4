"""Walls and roofs: all of them is covered once."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from test_render import SIZE, box, run_of

from lrf3d.geometry.lines import lengths
from lrf3d.studio.gltf import run_glb
from lrf3d.studio.scene.cameras import chase
from lrf3d.studio.scene.glass import Panes
from lrf3d.studio.scene.look import SECTION
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.stage.exposure import unexposed
from lrf3d.studio.scene.stage.stage import FURNITURE, ROOM_WALL, lay_faces
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import Timeline
from lrf3d.world import World, load_world


def laid(structures):
    """Faces, which of them are walls, and their areas [m²]."""
    low, high = structures.places.min(axis=0) - 9.0, structures.places.max(axis=0) + 9.0
    faces = lay_faces(structures, unexposed(structures, low, high))
    up, side = (faces.places[:, corner] - faces.places[:, 0] for corner in (1, 2))
    return faces, faces.before[:, 0, 2] == 1.0, np.linalg.norm(np.cross(up, side), axis=1)


def test_each_wall_and_roof_of_a_town_is_there_once_and_walls_look_at_streets():
    structures = Structures.from_world(load_world("city"))
    faces, walls, areas = laid(structures)
    whole = np.bincount(structures.objects, lengths(structures.segments) * structures.heights)
    assert np.allclose(whole, np.bincount(faces.objects[walls], areas[walls]), rtol=1e-5)
    roofs = np.bincount(faces.objects[~walls], 0.5 * areas[~walls], len(whole))
    assert roofs[structures.solid_objects] == pytest.approx(
        shapely.area(structures.solids), rel=0.016
    )
    town = shapely.union_all(structures.solids)
    before = faces.before[walls, :, :2].mean(axis=1)
    assert not shapely.contains_xy(town, *before.T).any()


def test_where_two_walls_are_at_one_place_one_is_drawn():
    walls = [[1.0, 2.0, 4.0, 2.0], [6.0, 2.0, 3.0, 2.0], [2.0, 2.0, 2.0, 5.0]]
    world = World(np.array([*box(0.0, 0.0, 8.0, 6.0), *walls]), [0] * 7)
    structures = Structures.from_world(world, np.array([[7.0, 1.0]]))
    places = laid(structures)[0].places
    places[..., :2] += structures.origin.astype(np.float32)
    sides = places[(np.abs(places[..., 1] - 2.0) < 0.01).all(axis=1), :2, 0]
    # Both sides of 5 m of wall: a wall that only meets it takes nothing away.
    assert np.ptp(sides, axis=1).sum() == pytest.approx(10.0, abs=0.05)
    assert sides.min() == pytest.approx(1.0) and sides.max() == pytest.approx(6.0)


def test_glass_has_clear_panes_and_glass_and_mirrors_have_bright_edges():
    walls = [*box(0.0, 0.0, 8.0, 6.0), [4.0, 0.0, 4.0, 6.0]]
    world = World(walls, [0] * 4 + [1], materials=["brick", "glass"])
    run = run_of(world, np.arange(3.0), [(2.0, 3.0, 0.1 * turn) for turn in range(3)])
    scene = Scene(Timeline(run))
    assert set(scene.stage.faces.objects) == {0}
    camera = chase(scene.timeline, scene.structures).look(1.0, 1.5)
    # Panes stand out where walls are cut.
    for cuts, top in ((True, 1.9), (False, 2.5)):
        marks = dict(scene.seen(scene.timeline.moment(1.0), replace(camera, cuts=cuts), SIZE).marks)
        panes, edges = marks["panes"], marks["edges"]
        assert panes.corners[..., 2].max() == edges.ends[:, 2].max() == pytest.approx(top)
        assert panes.colours[..., 3].max() < 0.7 and edges.opacities.min() == 1.0
    assert b'"name":"glass"' in run_glb(run)
    # A mirror has no pane, and edges up both ends and along the top.
    mirror = Structures.from_world(World(walls, [0] * 4 + [1], materials=[None, "mirror"]))
    panes = Panes.of(mirror, SECTION)
    assert len(panes.corners) == 0 and len(panes.edges.starts) == 3


def test_thick_outlines_are_walls_and_a_low_box_with_its_head_at_one_is_a_bed():
    sides = [*box(0.0, 0.0, 8.0, 6.0), *box(0.2, 0.2, 7.6, 5.6)]
    low = [*box(0.3, 1.0, 2.0, 1.6), *box(5.45, 2.0, 2.0, 1.6), *box(0.3, 3.5, 2.0, 1.6)]
    heights = [2.5] * 8 + [0.8] * 8 + [0.9] * 4
    world = World([*sides, *low], np.repeat([0, 1, 2, 3], [8, 4, 4, 4]), heights=heights)
    faces, walls, _ = laid(Structures.from_world(world, np.array([[3.0, 5.0]])))
    kinds = np.floor(faces.skin[walls, 0, 3])
    assert (kinds == np.where(faces.objects[walls] == 0, ROOM_WALL, FURNITURE)).all()
    # A sheet in five parts, two pillows and a cover; a table off the wall and a workbench have two
    # triangles.
    assert np.bincount(faces.objects[~walls])[1:].tolist() == [8, 2, 2]
    up = np.cross(*np.moveaxis(np.diff(faces.places[~walls, :3], axis=1), 1, 0))
    assert (up[:, 2] > 0.0).all()
