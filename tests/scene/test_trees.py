"""Trees in pictures: crowns over trunks of bark, their shadows, and what is not a tree."""

import numpy as np
import pytest
import shapely
from test_render import box

from lrf3d.geometry import directions
from lrf3d.scene.ground import paint_ground
from lrf3d.scene.look import SUN
from lrf3d.scene.shadows import height_of_shadows
from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import Crowns
from lrf3d.scene.walls import paint_walls
from lrf3d.world import World


def trunk(x: float, y: float, radius: float = 0.2) -> np.ndarray:
    turn = np.arange(7) % 6 * np.pi / 3
    ring = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return np.hstack([ring[:-1], ring[1:]])


def town(*places: tuple[float, float], height: float = 8.0, material: str = "bark") -> World:
    """A house of 10 m by 8 m, and trees."""
    walls = [np.array(box(0, 0, 10, 8), dtype=float), *(trunk(*place) for place in places)]
    objects = np.repeat(np.arange(len(walls)), [len(each) for each in walls])
    heights = np.where(objects == 0, 6.0, height)
    materials = [None, *(material for _ in places)]
    return World(np.concatenate(walls), objects, heights, materials=materials)


def test_slender_solids_of_bark_are_trees_and_others_are_not():
    structures = Structures.from_world(town((15, 4), (18, 4)))
    assert structures.tree_objects.tolist() == [1, 2] and len(structures.solids) == 1
    area = np.sqrt(1.5 * np.sqrt(3) * 0.2**2 / np.pi)
    local = structures.trees + np.append(structures.origin, [0, 0])
    assert local == pytest.approx(np.array([[15, 4, area, 8], [18, 4, area, 8]]), abs=1e-3)
    assert not len(Structures.from_world(town((15, 4), material="brick")).trees)
    hall = World(box(0, 0, 10, 8), heights=[6.0] * 4, materials=["bark"])
    assert not len(Structures.from_world(hall).trees)


def test_crowns_stand_over_their_trunks_above_beams_and_beside_houses():
    structures = Structures.from_world(town((15, 4), (11.2, 4), (20, 4)))
    crowns = structures.crowns
    assert crowns.corners[..., 2].min() > 2.0 and crowns.corners[..., 2].max() < 1.2 * 8.0
    assert crowns.sizes[1, 0] < 0.7 * crowns.sizes[2, 0]
    flat = shapely.convex_hull(shapely.multipoints(crowns.corners[..., :2]))
    assert not shapely.intersects(flat, structures.solids[0]).any()
    assert shapely.contains_xy(flat, structures.trees[:, :2]).all()


def test_low_trunks_are_posts_without_a_crown():
    structures = Structures.from_world(town((15, 4), height=1.2))
    assert len(structures.trees) == 1 and not len(structures.crowns.trees)
    assert len(paint_walls(structures).walls.places) > 6


def test_triangles_of_crowns_look_outward():
    crowns = Crowns.of(np.array([[0.0, 0.0, 0.2, 8.0], [30.0, 0.0, 0.2, 9.0]]), np.empty(0, object))
    faces = crowns.faces().reshape(2, -1, 3, 14).astype(float)
    corners = faces[..., :3]
    normal = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    outward = corners.mean(axis=2) - crowns.middles[:, None]
    assert ((normal * outward).sum(axis=-1) > 0).all()
    assert np.linalg.norm(faces[..., 3:6], axis=-1) == pytest.approx(1.0, abs=1e-6)


def test_a_screen_hides_the_sun_where_its_crown_does():
    crowns = Crowns.of(np.array([[0.0, 0.0, 0.2, 8.0]]), np.empty(0, object))
    walls, tops = crowns.screens()
    assert directions(walls) @ SUN[:2] == pytest.approx(0.0)
    slide = SUN[:2] / SUN[2]
    ends = walls.reshape(-1, 2) - tops.reshape(-1, 1) * slide
    reach = shapely.distance(shapely.points(ends), crowns.shadows()[0])
    assert reach.max() < 0.3 * crowns.sizes[0, 0]


def test_houses_hide_the_sun_from_the_places_behind_them():
    structures = Structures.from_world(town())
    level = np.hypot(*SUN[:2])
    middle = np.array([5.0, 8.0]) - structures.origin
    places = middle - np.outer([0.5, 2.0, 10.0], SUN[:2] / level)
    heights = height_of_shadows(structures, places)
    assert heights[:2] == pytest.approx(6.0 - SUN[2] / level * np.array([0.5, 2.0]))
    assert heights[2] < 0.0


def test_the_ground_is_darker_under_a_tree_and_in_its_shadow():
    bare, grown = (Structures.from_world(town(*places)) for places in ([(25, 4)], [(25, 4)]))
    object.__setattr__(bare, "trees", np.zeros((0, 4)))
    object.__setattr__(bare, "tree_objects", np.zeros(0, int))
    x, y = grown.trees[0, :2] - grown.crowns.middles[0, 2] * SUN[:2] / SUN[2]
    seen = []
    for structures in (bare, grown):
        ground = paint_ground(structures, paint_walls(structures).light)
        pixel = ground.size[0] / ground.picture.shape[1]
        column, row = (np.array([x, y]) - ground.corner) / pixel
        seen.append(int(ground.picture[int(row), int(column), :3].sum()))
    assert seen[1] < 0.8 * seen[0]
