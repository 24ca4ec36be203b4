"""Trees in pictures: crowns over trunks of bark, and what is not a tree."""

import numpy as np
import pytest
import shapely
from test_render import box

from lrf3d.scene.structures import Structures
from lrf3d.scene.trees import crowns_of
from lrf3d.world import World


def trunk(x, y, radius=0.2):
    turn = np.arange(7) % 6 * np.pi / 3
    ring = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return np.hstack([ring[:-1], ring[1:]])


def town(*places, height=8.0, material="bark"):
    """A house of 10 m by 8 m, and trees."""
    walls = [np.array(box(0, 0, 10, 8), dtype=float), *(trunk(*place) for place in places)]
    objects = np.repeat(np.arange(len(walls)), [len(each) for each in walls])
    heights = np.where(objects == 0, 6.0, height)
    materials = [None, *(material for _ in places)]
    return Structures.from_world(
        World(np.concatenate(walls), objects, heights, materials=materials)
    )


def test_slender_solids_of_bark_are_trees_and_others_are_not():
    structures = town((15, 4), (18, 4))
    assert structures.trees.tolist() == [1, 2] and len(structures.houses) == 1
    assert not len(town((15, 4), material="brick").trees)
    hall = World(box(0, 0, 10, 8), heights=[6.0] * 4, materials=["bark"])
    assert not len(Structures.from_world(hall).trees)
    assert not len(crowns_of(town((15, 4), height=1.2)).places)


def test_crowns_stand_over_their_trunks_above_beams():
    structures = town((15, 4), (20, 4))
    crowns = crowns_of(structures)
    corners = crowns.places.reshape(2, -1, 4, 3)
    assert corners[..., 2].min() > 2.0 and corners[..., 2].max() < 1.2 * 8.0
    flat = shapely.convex_hull(shapely.multipoints(corners[..., :2].reshape(2, -1, 2)))
    assert shapely.contains(flat, structures.solids[structures.trees]).all()
    # Triangles look outward.
    normal = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    outward = corners.mean(axis=2) - corners.mean(axis=(1, 2))[:, None]
    assert ((normal * outward).sum(axis=-1) > 0).all()
    assert np.linalg.norm(crowns.normals, axis=-1) == pytest.approx(1.0, abs=1e-6)
