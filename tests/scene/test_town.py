"""The plan of a town: streets where robots drive, straight kerbs, lawns elsewhere."""

import numpy as np
import pytest
import shapely
from test_render import box

from lrf3d.scene.ground import bare_ground
from lrf3d.scene.structures import Structures
from lrf3d.scene.town import PAVEMENT, STREET, plan_town
from lrf3d.world import World, load_world


def houses(*corners, path=None):
    """Houses x0 y0 x1 y1 [m], 6 m high."""
    walls = [box(a, b, c - a, d - b) for a, b, c, d in corners]
    objects = np.repeat(np.arange(len(walls)), 4)
    world = World(np.concatenate(walls), objects, np.full(len(objects), 6.0))
    return Structures.from_world(world, path)


def local(places, structures):
    return shapely.points(np.asarray(places, float) - structures.origin)


def test_a_robot_drives_on_a_street_wherever_it_goes():
    path = np.array([[-5.0, 12.0], [12.5, 12.0], [12.5, -9.0]])
    # Between the second and the third house it drives through a passage of a block.
    town = houses((0, 0, 10, 10), (15, 0, 25, 10), (0, 14, 25, 20), path=path)
    streets = plan_town(town).streets
    assert shapely.contains(streets, shapely.linestrings(path - town.origin))


def test_no_street_reaches_into_a_house():
    town = Structures.from_world(load_world("city"))
    assert shapely.distance(plan_town(town).streets, shapely.union_all(town.solids)) > 0.3


def test_the_kerb_runs_straight_before_houses_that_stand_side_by_side():
    town = houses((0, 0, 8, 8), (12, 1, 20, 8), (24, 0.5, 32, 8))
    streets = plan_town(town).streets
    (block,) = shapely.polygons(shapely.get_parts(streets)[0].interiors)
    # A kerb that follows each house would leave bays of some sixty square metres.
    assert shapely.area(shapely.convex_hull(block)) - shapely.area(block) < 14.0


def test_far_from_houses_and_ways_there_are_lawns():
    town = houses((0, 0, 10, 10))
    paved = plan_town(town).paved
    reach = STREET + 2.0 * PAVEMENT
    assert shapely.contains(paved, local([5.0, -reach], town))
    assert not shapely.intersects(paved, local([5.0, -reach - 4.0], town))


@pytest.mark.parametrize("driven", [True, False])
def test_a_closed_yard_is_a_lawn_unless_a_robot_drives_in_it(driven):
    ring = [(0, 0, 60, 10), (0, 50, 60, 60), (0, 10.01, 10, 49.99), (50, 10.01, 60, 49.99)]
    path = np.array([[25.0, 30.0], [35.0, 30.0]]) if driven else np.array([[-6.0, 0], [-6.0, 60]])
    town = houses(*ring, path=path)
    assert shapely.intersects(plan_town(town).streets, local([30.0, 30.0], town)) == driven


def test_kerbs_are_planned_only_where_they_can_be_seen(monkeypatch):
    monkeypatch.setattr("lrf3d.scene.ground.plan_town", None)
    town = houses((0, 0, 10, 10), (20, 0, 30, 10), (900, 900, 910, 910))
    brush, cover, _ = bare_ground(town)
    places = np.array([[60.0, 5.0], [15.0, 5.0], [11.0, 5.0]]) - town.origin
    columns, rows = ((places - brush.corner) / brush.pixel).astype(int).T
    lawn, street, pavement = cover[rows, columns]
    assert lawn[1] > 1.05 * lawn[0]
    assert pavement.min() > 1.2 * street.max()
