"""Roofs: all of each house is covered."""

import numpy as np
import pytest
import shapely

from lrf3d.scene.roofs import build_roofs
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
