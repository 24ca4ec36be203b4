"""Roofs: all of each house is covered, and hips see the sun."""

import numpy as np
import pytest
import shapely

from lrf3d.scene.look import SUN
from lrf3d.scene.roofs import build_roofs, hipped_houses
from lrf3d.scene.structures import Structures
from lrf3d.world import load_world


@pytest.fixture(scope="module")
def town():
    return Structures.from_world(load_world("city"))


def covered(faces):
    """The area (t,) of triangles from above."""
    first, second = (faces[:, k, :2] - faces[:, 0, :2] for k in (1, 2))
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def test_roofs_cover_each_house_once(town):
    roofs = build_roofs(town)
    areas = covered(roofs.places)
    assert (areas > 0.0).all()
    found = np.bincount(roofs.objects, areas, minlength=town.solid_objects.max() + 1)
    assert found[town.solid_objects] == pytest.approx(shapely.area(town.solids), rel=0.016)


def test_a_hipped_roof_starts_at_the_eaves_and_all_of_it_sees_the_sun(town):
    hips = hipped_houses(town)
    assert 5 < hips.sum() < len(town.solids)
    roofs = build_roofs(town)
    for solid in np.flatnonzero(hips):
        own = roofs.objects == town.solid_objects[solid]
        faces, normals = roofs.places[own], roofs.normals[own, 0]
        heights = faces[..., 2]
        assert heights.min() == pytest.approx(town.solid_heights[solid], abs=1e-3)
        assert heights.max() > heights.min() + 0.5
        assert (normals @ SUN > 0.1).all()
        # Its normals are those of its triangles.
        a, b, c = (faces[:, k] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        assert np.abs(normal - normals).max() < 5e-3
