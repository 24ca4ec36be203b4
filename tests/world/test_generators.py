import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from lrf3d.base.errors import InputError
from lrf3d.planning.free_space import free_places
from lrf3d.world.generators import KINDS, generate

SMALL = {"city": 60.0, "maze": 14.0, "office": 24.0, "rooms": 20.0}


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_repeats_a_world_and_another_gives_another(kind):
    one, same, other = (generate(kind, size=SMALL[kind], seed=seed) for seed in (4, 4, 5))
    assert one.segments.tobytes() == same.segments.tobytes()
    assert one.segments.tobytes() != other.segments.tobytes()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_every_object_is_made_of_rings_that_touch_no_other(kind, seed):
    world = generate(kind, size=SMALL[kind], seed=seed)
    lines = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    objects = [lines[world.objects == number] for number in range(world.object_count)]
    areas = [shapely.build_area(shapely.geometrycollections(each)) for each in objects]
    assert {area.geom_type for area in areas} == {"Polygon"} and shapely.is_valid(areas).all()
    # Each wall is a side of its object.
    assert shapely.length(areas) == pytest.approx([shapely.length(each).sum() for each in objects])
    assert shapely.union_all(areas).area == pytest.approx(shapely.area(areas).sum())


@pytest.mark.parametrize("kind", ["maze", "office", "rooms"])
@pytest.mark.parametrize("seed", range(3))
def test_every_room_can_be_driven_to(kind, seed):
    world = generate(kind, size=SMALL[kind], seed=seed)
    places = free_places(world, 0.65)
    low, high = world.bounds
    assert (places > low).all() and (places < high).all()
    lattice = np.stack(np.meshgrid(*map(np.arange, low, high, (0.3, 0.3))))
    free = shapely.points(np.moveaxis(lattice, 0, -1).reshape(-1, 2))
    walls = shapely.multilinestrings(shapely.linestrings(world.segments.reshape(-1, 2, 2)))
    free = shapely.get_coordinates(free[shapely.distance(walls, free) > 0.9])
    # A nook between a desk and a wall may be shut off; a room may not.
    assert (cKDTree(places).query(free)[0] > 0.3).mean() < 0.01


@pytest.mark.parametrize(
    ("kind", "size", "said"),
    [
        ("jungle", None, r"jungle: unknown kind.*maze"),
        ("maze", 1.0, "size 1 m: expected 12"),
        ("maze", float("nan"), "size nan"),
    ],
)
def test_what_cannot_be_generated_is_refused(kind, size, said):
    with pytest.raises(InputError, match=said):
        generate(kind, size=size)
