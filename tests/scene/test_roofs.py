"""Roofs: all of each house is covered, and what stands on them is above every beam."""

import numpy as np
import pytest
import shapely

from lrf3d.scene.hipped_roofs import plan_hips
from lrf3d.scene.look import SUN
from lrf3d.scene.roofs import build_tops
from lrf3d.scene.shadows import LIT
from lrf3d.scene.structures import Structures
from lrf3d.world import load_world


@pytest.fixture(scope="module")
def town():
    return Structures.from_world(load_world("city"))


def tops_of(town, *, shadows=True):
    solids = np.arange(len(town.solids))
    return build_tops(town, town.solids, solids, np.full(len(solids), LIT), shadows=shadows)


def covered(faces):
    """The area (t,) of triangles from above."""
    first, second = (faces[:, k, :2] - faces[:, 0, :2] for k in (1, 2))
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


@pytest.mark.parametrize("shadows", [True, False])
def test_roofs_cover_each_house_once(town, shadows):
    top = tops_of(town, shadows=shadows)
    areas = covered(top.roofs.astype(np.float64))
    assert (areas > 0.0).all()
    found = np.bincount(top.objects, areas, minlength=town.solid_objects.max() + 1)
    assert found[town.solid_objects] == pytest.approx(shapely.area(town.solids), rel=1e-3)


def test_a_hipped_roof_starts_at_the_eaves_and_all_of_it_sees_the_sun(town):
    hips = plan_hips(town)
    assert 5 < hips.chosen.sum() < len(town.solids)
    top = tops_of(town)
    for solid in np.flatnonzero(hips.chosen):
        faces = top.roofs[top.objects == town.solid_objects[solid]]
        heights = faces[..., 2]
        assert heights.min() == pytest.approx(town.solid_heights[solid], abs=1e-3)
        assert heights.max() > heights.min() + 0.5
        assert (faces[:, 0, 3:6] @ SUN > 0.1).all()
        # Its normals are those of its triangles.
        a, b, c = (faces[:, k, :3].astype(np.float64) for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        assert np.abs(normal - faces[:, 0, 3:6]).max() < 5e-3


def test_what_stands_on_roofs_is_above_every_beam_and_within_its_house(town):
    top = tops_of(town)
    lowest = town.solid_heights.min() - 0.6
    assert top.quads[..., 2].min() >= lowest > 2.0
    whole = shapely.union_all(shapely.buffer(town.solids, 1e-3))
    assert shapely.contains_xy(whole, *top.quads[..., :2].reshape(-1, 2).T.astype(float)).all()


def test_parapets_and_boxes_shade_their_roofs(town):
    areas = [
        covered(top.roofs[top.under > 0.0].astype(np.float64)).sum()
        for top in (tops_of(town), tops_of(town, shadows=False))
    ]
    assert areas[0] > 10.0 and areas[1] == 0.0


def test_rooms_have_neither_hips_nor_boxes():
    room = Structures.from_world(load_world("paper_room"))
    top = tops_of(room)
    assert not plan_hips(room).chosen.any() and not len(top.quads)
