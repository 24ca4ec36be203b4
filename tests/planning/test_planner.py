import functools
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from synthetic_run import box

from lrf3d import (
    InputError,
    LaserRangeFinder,
    PlanarCaster,
    Scenario,
    World,
    follow_route,
    load_world,
    save_world,
)
from lrf3d.casting.collision import find_collision
from lrf3d.planning import rooms
from lrf3d.planning.free_space import Ground, find_free_space
from lrf3d.planning.planner import find_route, plan_route
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.generators import generate

SMALL = {"city": 60.0, "maze": 16.0, "office": 25.0, "rooms": 18.0}


def town(boxes):
    objects = np.repeat(np.arange(len(boxes)), 4)
    return World(np.concatenate(boxes), objects, np.full(len(objects), 8.0))


def distance_to_walls(world, places):
    origin = world.origin
    walls = shapely.MultiLineString(list((world.segments - np.tile(origin, 2)).reshape(-1, 2, 2)))
    return float(shapely.distance(walls, shapely.LineString(places - origin)))


def room(width, depth):
    return World(np.concatenate([box(0, 0, width, depth), box(2, 2, 1, 1)]), [0] * 4 + [1] * 4)


STREET_BOXES = [box(16.0 * i, 14.0 * j, 10.0, 8.0) for i in range(3) for j in range(3)]
STREETS = town(STREET_BOXES)
PAIR_BOXES = [box(0.0, 0.0, 10.0, 8.0), box(15.0, 2.0, 6.0, 9.0)]
PAIR = town(PAIR_BOXES)


@functools.cache
def found_in_the_streets():
    return find_route(STREETS)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "radius", "east"), [(148, 0.25, 0.0), (3, 0.45, 85_000.0)])
def test_a_route_is_followed_without_coming_near_a_wall(seed, radius, east):
    rng = np.random.default_rng(seed)
    spots = rng.permutation(9)[:5]
    boxes = [box(east + 13.0 * (s // 3), 12.0 * (s % 3), *rng.uniform(4.0, 10.0, 2)) for s in spots]
    world = town(boxes)
    route = plan_route(world, radius=radius)
    # All passages are at least 2 m wide.
    assert distance_to_walls(world, route) >= radius + 0.25
    drive = follow_route(route, speed=3.0, lookahead=1.0)
    assert find_collision(drive, world, radius) is None


@pytest.mark.slow
def test_most_walls_of_a_town_are_seen_from_a_route_of_sensible_length():
    drive = follow_route(found_in_the_streets().waypoints, speed=3.0, lookahead=1.0, dt=0.5)
    assert drive.length < 500.0
    caster, lrf = PlanarCaster(STREETS), LaserRangeFinder(range_max=40.0)
    hit = np.concatenate([caster.cast(lrf, pose).walls for pose in drive.poses])
    assert (np.bincount(hit[hit >= 0], minlength=len(STREETS.segments)) > 10).mean() > 0.8


@pytest.mark.slow
def test_the_same_world_gives_the_same_route_wherever_it_lies():
    route = plan_route(PAIR)
    assert (plan_route(PAIR) == route).all()
    shift = np.array([85_000.0, 447_500.0])
    moved = World(PAIR.segments + np.tile(shift, 2), PAIR.objects, PAIR.heights)
    np.testing.assert_allclose(plan_route(moved), route + shift, atol=1e-6)


def test_in_a_closed_room_the_route_stays_inside():
    for world in (room(9.0, 7.0), World(box(0.0, 0.0, 6.0, 5.0))):
        route = plan_route(world, radius=0.3)
        low, high = world.bounds
        assert ((route > low + 0.5) & (route < high - 0.5)).all()
        assert np.hypot(*(route[-1] - route[0])) + len(route) > 2.0


def test_a_plan_with_a_line_on_each_side_of_its_outer_wall_is_driven_inside():
    walls = [*box(0.0, 0.0, 12.0, 9.0), *box(0.2, 0.2, 11.6, 8.6), [6.0, 0.2, 6.0, 4.0]]
    route = plan_route(World(np.array(walls), objects=[0] * 4 + [1] * 5))
    assert shapely.contains_xy(shapely.box(0.2, 0.2, 11.8, 8.8), route[:, 0], route[:, 1]).all()


@pytest.mark.slow
def test_a_very_large_world_is_planned_in_its_densest_part():
    crowd = [box(3000.0 + 15.0 * i, 14.0 * j, 9.0, 8.0) for i in range(4) for j in range(3)]
    world = town([*crowd, box(0.0, 0.0, 10.0, 10.0), box(0.0, 5000.0, 10.0, 10.0)])
    assert (np.abs(plan_route(world) - [3030.0, 20.0]) < 260.0).all()


def house(door, entrance):
    """A house of four rooms, with doors between them, and one to the outside in the first."""

    def wall(start, end, gap):
        a, b = np.array(start), np.array(end)
        step = (b - a) * 0.5 * (1.0 - gap / np.hypot(*(b - a)))
        return [np.hstack([a, a + step]), np.hstack([b - step, b])]

    walls = [
        *wall((6, 0), (6, 4.5), door),
        *wall((6, 4.5), (6, 9), door),
        *wall((0, 4.5), (6, 4.5), door),
        *wall((6, 4.5), (12, 4.5), door),
        *wall((0, 0), (12, 0), entrance),
        *box(0, 0, 12, 9)[1:],
    ]
    return World(np.array(walls))


def rooms_of(positions):
    """The rooms of a house in which some of the positions lie."""
    rooms = set(map(tuple, np.floor(positions[:, :2] / [6.0, 4.5]).astype(int)))
    return rooms & {(0, 0), (1, 0), (0, 1), (1, 1)}


@pytest.mark.parametrize(("door", "entrance"), [(1.7, 1.7), (1.0, 1.0), (1.0, 1.2), (0.9, 0.0)])
def test_a_robot_drives_through_the_doors_that_it_fits_through_and_stays_inside(door, entrance):
    world = house(door, entrance)
    found = find_route(world, radius=0.35, lookahead=0.4)
    assert found.side == "inside" and inside_the_house(found.waypoints).all()
    drive = follow_route(found.waypoints, speed=found.speed, lookahead=found.lookahead, dt=0.05)
    assert find_collision(drive, world, 0.35) is None
    assert len(rooms_of(drive.poses)) >= 3


@pytest.mark.slow
def test_doors_that_are_too_narrow_are_named_and_a_smaller_robot_is_tried():
    found = find_route(house(0.84, 0.0), radius=0.4, lookahead=0.4)
    assert distance_to_walls(house(0.0, 0.0), found.waypoints) >= 0.4
    (note,) = map(str, found.notes)
    assert re.match(
        r"doors? of 0\.84 m at \(.+\).* too narrow for a robot of 0\.80 m; 3 of 4 rooms are not"
        r" reached; --set robot\.radius=0\.28$",
        note,
    )
    smaller = find_route(house(0.75, 0.0), lookahead=0.4)
    assert smaller.radius < 0.35
    assert "the robot's radius is 0.28 m instead of 0.35 m" in smaller.notes[0].fact
    assert len(rooms_of(smaller.waypoints)) >= 3
    assert find_route(house(1.0, 0.0), lookahead=0.4).notes == ()
    # A hall next to the house has room for the wider robot, but far fewer walls.
    walls = np.vstack([house(0.75, 0.0).segments, box(20, 0, 13, 9)])
    beside = find_route(World(walls), lookahead=0.4)
    assert beside.radius == smaller.radius and inside_the_house(beside.waypoints).all()


@pytest.mark.parametrize(
    "name",
    [
        *("rooms", "maze", "corridor", "paper_room"),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("office", "city")),
    ],
)
def test_the_drive_keeps_its_radius_from_all_walls_there_and_back(name):
    world = generate(name, size=SMALL[name], seed=3) if name in SMALL else load_world(name)
    scenario = Scenario(world).with_route()
    assert find_collision(scenario.trajectory(scans=2000), world, scenario.radius) is None


def corridor(width, turn, rooms):
    """A corridor of 30 m, which opens into a room behind a door of 1 m every 6 m, on one side."""
    walls = [[0, width, 30, width], [0, 0, 0, width], [30, 0, 30, width]]
    posts = [0.0, *(x + y for x in range(3, 30, 6) for y in (-0.5, 0.5)), 30.0]
    walls += [[x, 0, y, 0] for x, y in zip(posts[::2], posts[1::2], strict=True)]
    for x in range(3, 30, 6):
        walls += [[x - 2, 0, x - 2, -4], [x + 2, 0, x + 2, -4], [x - 2, -4, x + 2, -4]]
    segments = np.array(walls if rooms else box(0.0, 0.0, 30.0, width), dtype=np.float64)
    cos, sin = np.cos(turn), np.sin(turn)
    return World((segments.reshape(-1, 2) @ [[cos, sin], [-sin, cos]]).reshape(-1, 4))


@pytest.mark.parametrize(
    ("turn", "rooms", "mapped"),
    [(0.0, False, True), (0.0, True, False), (0.3, False, False), (0.3, True, True)],
)
def test_a_corridor_with_centimetres_on_both_sides_is_driven_to_its_end(
    turn, rooms, mapped, tmp_path
):
    world = corridor(1.0, turn, rooms)
    if mapped:
        save_world(world, tmp_path / "map.yaml")
        world = load_world(tmp_path / "map.yaml")
    scenario = Scenario(world).with_route(say=(notes := list[str]()).append)
    assert (scenario.planned, scenario.radius, notes) == ("inside", 0.35, [])
    drive = scenario.trajectory(scans=1000)
    assert find_collision(drive, world, 0.35) is None
    assert np.ptp(drive.poses[:, :2] @ [np.cos(turn), np.sin(turn)]) > 19.0


@pytest.mark.slow
def test_rooms_without_a_door_are_named(tmp_path):
    for door in (0.0, 0.2):
        (note,) = map(str, find_route(house(door, 0.0), radius=0.35, lookahead=0.4).notes)
        assert re.match(r"3 of 4 rooms are not reached, 2\d\.\d m² at \(.+\): no door", note)
    # A flat that one enters from outside alone is one, a table and a pillar are none.
    doors = [[0, 0, 2.5, 0], [3.5, 0, 8.5, 0], [9.5, 0, 12, 0], [6, 0, 6, 9], [3, 0, 3, -0.9]]
    (note,) = map(str, find_route(World(np.vstack([doors, box(0, 0, 12, 9)[1:]]))).notes)
    assert re.match(r"1 of 2 rooms is not reached, 5.*: no door leads there from inside", note)
    hall = [box(0, 0, 12, 9), box(2, 2, 3, 2), box(8, 4, 0.6, 0.6)]
    furnished = World(np.concatenate(hall), heights=[2.5] * 4 + [0.8] * 4 + [2.5] * 4)
    assert find_route(furnished).notes == ()
    # A robot may be thinner than those that doors are looked for with.
    assert find_route(furnished, radius=1e-3).notes == ()


def test_rooms_are_separated_at_their_open_doors():
    # A hall, and behind a narrow door two rooms with an open door between them.
    across = [[12, 0, 12, 3], [12, 3.5, 12, 8], [16, 0, 16, 3], [16, 4, 16, 8]]
    world = World(np.vstack([across, box(0, 0, 20, 8)]))
    (note,) = map(str, find_route(world, radius=0.35).notes)
    assert (
        note.startswith("door of 0.50 m at (12.0, 3.2) is too narrow")
        and "; 2 of 3 rooms are" in note
    )
    two = World(np.vstack([across[2:], box(0, 0, 20, 8)]))
    (note,) = map(str, find_route(two, radius=0.6).notes)
    assert "1 of 2 rooms is not reached" in note


def test_rooms_are_counted_in_the_same_way_where_furniture_divides_them():
    # A counter divides the first of three rooms, the second has no door.
    walls = [*box(0, 0, 12, 6), [4, 0, 4, 6], [8, 0, 8, 2.5], [8, 3.5, 8, 6], [0, 3, 4, 3]]
    counted = rooms.rooms_of(world := World(np.array(walls), heights=[2.5] * 7 + [0.8]))
    (note,) = map(str, find_route(world).notes)
    assert [area for area, _ in counted] == pytest.approx([24.0] * 3, rel=0.02)
    assert note.startswith("1 of 3 rooms is not reached")
    assert any(f" {area:.1f} m² at" in note for area, _ in counted)
    # Where a cupboard stands in the way no door is too narrow.
    walls = [*box(0, 0, 12, 6), [4, 0, 4, 2.5], [4, 3.5, 4, 6], [5.2, 0, 5.2, 5.5]]
    cupboard = World(np.array(walls), heights=[2.5] * 6 + [0.8])
    (note,) = map(str, find_route(cupboard, radius=0.35).notes)
    assert "or blocked" in note


def test_every_room_with_a_door_is_entered():
    ends = [[x, 3, x + 3, 3] for x in range(0, 20, 4)] + [[x, 0, x, 3] for x in range(4, 20, 4)]
    found = find_route(World(np.vstack([np.array(ends, dtype=float), box(0, 0, 20, 6)])))
    assert found.notes == ()
    rooms = found.waypoints[found.waypoints[:, 1] < 2.8, 0] // 4
    assert set(rooms.tolist()) == {0, 1, 2, 3, 4}


def test_walls_just_beyond_what_is_planned_in_keep_the_robot_away():
    far = [[250.3, -200, 250.3, 200], [0, 3000, 9, 3000]]
    ground = Ground(World(np.vstack([PAIR.segments, far])), np.array([0.0, 0.0]))
    assert ground.gaps[-1, 250] < 1.0


def test_wide_doors_and_doors_to_the_outside_are_not_reported_as_narrow(tmp_path):
    assert find_route(house(0.98, 0.3), radius=0.35, lookahead=0.4).notes == ()
    save_world(house(1.2, 1.2), tmp_path / "map.yaml")
    assert find_route(load_world(tmp_path / "map.yaml"), lookahead=0.4).notes == ()


HOUSE = house(1.0, 2.0)


def inside_the_house(route):
    return ((route > [0.0, 0.0]) & (route < [12.0, 9.0])).all(axis=1)


@pytest.mark.slow
def test_the_side_of_the_walls_is_chosen_or_asked_for_and_indoors_the_robot_is_slow():
    assert find_route(HOUSE, lookahead=0.4).speed == 1.0
    assert find_route(HOUSE, lookahead=0.4, speed=2.0).speed == 2.0
    assert not inside_the_house(plan_route(HOUSE, lookahead=0.4, where="outside")).any()
    streets = found_in_the_streets()
    assert (streets.side, streets.speed) == ("outside", 3.0)
    within = find_route(PAIR, where="inside")
    assert within.side == "inside"
    houses = shapely.MultiPolygon([shapely.Polygon(row[:, :2]) for row in PAIR_BOXES])
    assert shapely.contains_xy(houses, *within.waypoints.T).all()


@pytest.mark.slow
def test_the_route_begins_at_the_start_and_stays_on_its_side():
    route = plan_route(HOUSE, lookahead=0.4, start=(9.0, 7.0, 1.0))
    assert tuple(route[0]) == (9.0, 7.0)
    assert inside_the_house(route).all()
    route = plan_route(HOUSE, lookahead=0.4, start=(-3.0, 2.0))
    assert tuple(route[0]) == (-3.0, 2.0)
    assert not inside_the_house(route).any()
    assert tuple(plan_route(PAIR, start=(12.0, 11.0, 0.0))[0]) == (12.0, 11.0)


@pytest.mark.parametrize(
    ("world", "settings", "said"),
    [
        (World(np.empty((0, 4)), name="void"), {}, "no walls"),
        (STREETS, {"radius": float("nan")}, "radius nan"),
        (STREETS, {"radius": 0.0}, "radius 0"),
        (room(9.0, 7.0), {"radius": 60.0}, "away from all walls"),
        (HOUSE, {"start": (0.1, 2.0, 0.0)}, r"start \(0\.1, 2\): nearer to a wall"),
        (HOUSE, {"start": (9.0, 7.0), "where": "outside"}, "does not lie outside the walls"),
        (HOUSE, {"start": (np.nan, 2.0)}, "expected finite numbers"),
        (HOUSE, {"where": "within"}, "where 'within': expected"),
    ],
)
def test_where_no_robot_can_be_is_a_clear_error(world, settings, said):
    with pytest.raises(InputError, match=said):
        plan_route(world, **settings)


def test_only_cells_that_a_map_knows_to_be_free_are_driven_through():
    cells = np.zeros((90, 120), dtype=bool)
    cells[:, :60] = True
    world = World(house(1.0, 0.9).segments, free=FreeCells(cells, 0.1))
    route = plan_route(world, lookahead=0.4)
    assert inside_the_house(route).all() and (route[:, 0] < 6.0).all()


def test_a_map_in_which_no_cell_is_known_to_be_free_is_driven_by_its_walls():
    world = World(house(1.0, 0.9).segments, free=FreeCells(np.zeros((90, 120), dtype=bool), 0.1))
    found = find_route(world, lookahead=0.4)
    assert found.side == "inside" and "knows no free cell" in found.notes[0].fact


@pytest.mark.parametrize("far", [pytest.param(2e6, marks=pytest.mark.slow), 1e9])
def test_walls_that_reach_far_away_cost_nothing_and_the_town_is_driven_to(far):
    corner = [[150.0, 0.0, far, 3.0], [far, 3.0, 150.0, 8.0], [150.0, 8.0, 150.0, 0.0]]
    objects = np.append(PAIR.objects, [PAIR.object_count] * 3)
    world = World(np.vstack([PAIR.segments, corner]), objects, np.full(len(objects), 8.0))
    route = plan_route(world)
    assert (np.abs(route) < 600.0).all()
    assert (np.abs(route - [12.0, 5.0]) < 60.0).all(axis=1).any()


def test_a_laser_that_sees_no_wall_from_anywhere_still_has_a_route():
    assert len(plan_route(room(9.0, 7.0), range_max=0.5)) >= 2


def test_a_room_that_is_seen_at_one_look_is_driven_through_for_some_seconds():
    room = World([[0, 0, 5, 0], [5, 0, 5, 4], [5, 4, 0, 4], [0, 4, 0, 0]])
    route = plan_route(room, range_max=10.0)
    assert np.hypot(*np.diff(route, axis=0).T).sum() > 15.0
    assert ((route > 0.35) & (route < [4.65, 3.65])).all()


@pytest.mark.parametrize(("unit", "scale"), [(1000.0, "0.001"), (100.0, "0.01")])
def test_a_plan_in_other_units_is_refused_with_the_scale_that_fits(unit, scale):
    flat = house(0.9, 0.9)
    with pytest.raises(InputError, match=rf"--scale {scale} makes it 12 m by 9 m"):
        plan_route(flat.scaled(unit))
    town = np.vstack([STREETS.segments + np.tile([x, 0.0], 2) for x in (0.0, 4000.0)])
    assert len(plan_route(World(town))) > 2


@pytest.mark.slow
def test_a_tip_close_to_a_wall_is_turned_in_without_touching_it():
    picture = Path(__file__).parents[2] / "examples/flat.png"
    scenario = Scenario(load_world(picture, resolution=0.02)).with_route()
    assert scenario.speed < 1.0
    assert find_collision(scenario.trajectory(), scenario.world, scenario.radius) is None


def test_a_plan_of_thousands_of_rooms_has_one_that_is_driven_in():
    # The number of rooms times that of pieces of wall is more than 32 bits hold.
    at = np.arange(0.0, 491.0, 7.0)
    across = np.column_stack([np.zeros_like(at), at, np.full_like(at, 490.0), at])
    ground = Ground(World(np.concatenate([across, across[:, [1, 0, 3, 2]]])))
    assert find_free_space(ground, 0.35).places.size > 0


def test_a_drive_that_more_care_does_not_help_is_tried_twice(monkeypatch):
    tried = []

    def hit(_, begins, ends, radius):
        tried.append(len(begins))
        return np.zeros(len(begins), dtype=np.int64)

    monkeypatch.setattr("lrf3d.planning.planner.CollisionChecker.hit", hit)
    assert find_route(room(9.0, 7.0)).speed == 1.0
    assert len(tried) == 2


def test_the_rooms_of_a_plan_are_those_by_doors_without_furniture():
    walls = house(0.9, 0.9)
    table = np.array([[0.5, 1.5, 2.5, 1.5], [2.5, 1.5, 2.5, 2.5], [2.5, 2.5, 0.5, 2.5]])
    world = World(
        np.vstack([walls.segments, table]), heights=[*np.full(len(walls.segments), 2.5), *[0.8] * 3]
    )
    plain, furnished = (sorted(area for area, _ in rooms.rooms_of(each)) for each in (walls, world))
    assert len(plain) > 1 and plain == furnished
