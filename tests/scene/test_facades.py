"""Façades: one texture, and walls that lie on it."""

import numpy as np
import pytest
import shapely
from test_render import box

from lrf3d.geometry import lengths
from lrf3d.scene.facades import BAYS, BLANK, WINDOWED
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import NARROW, lay_walls
from lrf3d.world import World


def town():
    """Houses of 3 to 60 m in length, 3 to 25 m high."""
    sides = np.array([3.0, 7.0, 20.0, 60.0])
    walls = [box(100.0 * i, 0.0, 100.0 * i + side, 10.0) for i, side in enumerate(sides)]
    objects = np.repeat(np.arange(len(sides)), 4)
    heights = np.repeat([3.0, 8.0, 12.0, 25.0], 4)
    return Structures.from_world(World(np.concatenate(walls), objects, heights))


def test_pieces_of_walls_cover_what_the_walls_did():
    structures = town()
    quads = lay_walls(structures)
    side, up = (quads.places[:, corner] - quads.places[:, 0] for corner in (1, 3))
    area = np.linalg.norm(np.cross(side, up), axis=1)
    whole = np.bincount(structures.objects, lengths(structures.segments) * structures.heights)
    assert np.allclose(whole, np.bincount(quads.objects, area), rtol=1e-5)


def test_a_house_has_one_door_in_a_face_of_some_bays():
    painted = lay_walls(town())
    ground = (painted.texture[:, 0, 2] >= WINDOWED) & (painted.places[:, 0, 2] == 0.0)
    start, end = painted.texture[ground, 0, 0], painted.texture[ground, 1, 0]
    # The door stands in the first of the bays that repeat.
    doors = np.ceil(end / BAYS - 1e-4) - np.ceil(start / BAYS - 1e-4)
    bays = np.round(end - start)
    assert (doors[bays == 1] == 0).all() and (bays == 1).any()
    assert (doors[(bays > 1) & (bays <= BAYS)] == 1).all()
    assert (np.abs(end - start - bays) < 1e-4).all()


@pytest.mark.parametrize(
    ("depth", "material", "windows"),
    [(8.0, "plaster", True), (8.0, "metal", False), (0.9 * NARROW, "plaster", True)],
)
def test_there_are_no_windows_in_metal_and_in_narrow_faces(depth, material, windows):
    world = World(box(0.0, 0.0, 20.0, depth), [0] * 4, [9.0] * 4, materials=(material,))
    painted = lay_walls(Structures.from_world(world))
    width = np.linalg.norm(painted.places[:, 1] - painted.places[:, 0], axis=1)
    layer = painted.texture[:, 0, 2]
    assert (layer[width > 10.0] >= WINDOWED).any() == windows
    assert set(layer[width < NARROW]) <= {BLANK}


def laid(*walls):
    """The faces of a room of 8 by 6 m with further walls (k, 4) in it, in the world's frame."""
    segments = np.array([*box(0.0, 0.0, 8.0, 6.0), *walls])
    structures = Structures.from_world(World(segments, [0] * len(segments)), np.array([[7.0, 1.0]]))
    quads = lay_walls(structures)
    quads.places[..., :2] += structures.origin.astype(np.float32)
    return quads


def test_where_two_walls_are_at_one_place_one_is_drawn():
    quads = laid([1.0, 2.0, 4.0, 2.0], [6.0, 2.0, 3.0, 2.0], [2.0, 2.0, 2.0, 5.0])
    there = (np.abs(quads.places[..., 1] - 2.0) < 0.01).all(axis=1)
    sides = quads.places[there & (quads.places[..., 2].min(axis=1) == 0.0), :2, 0]
    # Both sides of 5 m of wall: a wall that only meets it takes nothing away.
    assert np.ptp(sides, axis=1).sum() == pytest.approx(10.0, abs=0.05)
    assert sides.min() == pytest.approx(1.0) and sides.max() == pytest.approx(6.0)


def test_the_inside_of_a_wall_with_two_lines_has_a_lid_and_a_closet_has_none():
    def has_lid(x, y, *walls):
        quads = laid(*walls)
        level = quads.places[quads.normals[:, 0, 2] > 0.9, :, :2]
        return shapely.contains_xy(shapely.convex_hull(shapely.multipoints(level)), x, y).any()

    double = box(2.0, 2.0, 4.0, 0.3)
    assert has_lid(2.2, 2.15, *double) and has_lid(5.8, 2.15, *double)
    assert not has_lid(4.0, 4.0, *double)
    assert not has_lid(4.0, 2.45, *box(2.0, 2.0, 4.0, 0.9))
    # What is open to the room is seen by the laser, however narrow it is.
    assert not has_lid(4.0, 2.15, [2.0, 2.0, 6.0, 2.0], [2.0, 2.3, 6.0, 2.3])
