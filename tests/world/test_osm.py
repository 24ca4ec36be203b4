"""OpenStreetMap extracts: which buildings and trees are walls, where they stand, and how high."""

import json
from contextlib import nullcontext
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.world import World, load_world, save_world
from lrf3d.world.towns.features import EARTH_RADIUS
from lrf3d.world.towns.osm import DEFAULT_TREE, is_building, tag_height, tree_height, trunk_radius

NODES = [(0, 0), (30, 0), (30, 20), (0, 20), (10, 5), (20, 5), (20, 15), (10, 15)]


def of_tags(tags):
    return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())


def node(number, place, **tags):
    degree = np.degrees(1.0 / EARTH_RADIUS)
    lon, lat = 4 + place[0] * degree / np.cos(np.radians(52)), 52 + place[1] * degree
    return f'<node id="{number}" lon="{lon}" lat="{lat}">{of_tags(tags)}</node>'


def way(number, *nodes, **tags):
    points = "".join(f'<nd ref="{node}"/>' for node in nodes)
    return f'<way id="{number}">{points}{of_tags(tags)}</way>'


def multipolygon(*members, **tags):
    rows = "".join(f'<member type="way" ref="{n}" role="{role}"/>' for n, role in members)
    tags = {"type": "multipolygon", **(tags or {"building": "yes"})}
    return f'<relation id="1">{rows}{of_tags(tags)}</relation>'


def osm(folder, body, **how):
    nodes = "".join(node(number, place) for number, place in enumerate(NODES))
    return both(folder, f"<osm>{nodes}{body}</osm>", **how)


def both(folder, text, **how):
    """The world of an extract, which is the same in XML and in JSON."""
    path = folder / "a.osm"
    path.write_text(text)
    elements = [answer(each) for each in ElementTree.fromstring(text)]
    (folder / "b").mkdir(exist_ok=True)
    (folder / "b" / "a.json").write_text(json.dumps({"version": 0.6, "elements": elements}))
    world = load_world(path, **how)
    answered = load_world(folder / "b" / "a.json", **how)
    assert answered.segments.tobytes() == world.segments.tobytes()
    assert answered.heights.tolist() == world.heights.tolist()
    return world


def answer(element):
    """An element of an extract as Overpass answers it in JSON."""
    item = {"type": element.tag, **element.attrib, "id": int(element.get("id"))}
    item |= {key: float(element.get(key)) for key in ("lon", "lat") if key in element.attrib}
    item["tags"] = {tag.get("k"): tag.get("v") for tag in element.iter("tag")}
    item["nodes"] = [int(each.get("ref")) for each in element.findall("nd") if "ref" in each.attrib]
    item["geometry"] = places(element)
    item["members"] = [
        {**each.attrib, "ref": int(each.get("ref")), "geometry": places(each)}
        for each in element.findall("member")
    ]
    return {key: value for key, value in item.items() if value not in ({}, [])}


def places(element):
    found = [
        {key: float(value) for key, value in each.attrib.items() if key != "ref"} or None
        for each in element.findall("nd")
    ]
    return found if any(found) else []


HOUSE = way(1, 0, 1, 2, 3, 0, building="yes")


def tree(number, x, y, **tags):
    return node(number, (x, y), natural="tree", **tags)


def test_a_building_is_laid_flat_about_its_middle(tmp_path):
    body = way(1, 0, 1, 2, 3, 0, building="yes", height="7.5 m", name="hall")
    world = osm(tmp_path, body + way(2, 4, 5, 6, highway="path"))
    assert world.bounds == pytest.approx(np.array([[-15, -10], [15, 10]]), abs=1e-3)
    assert world.heights.tolist() == [7.5] * 4 and world.object_names == ("hall",)
    assert world.place == pytest.approx((4.000219, 52.00009), abs=1e-6)
    save_world(world, tmp_path / "a.toml")
    assert load_world(tmp_path / "a.toml").place == world.place


def test_a_multipolygon_keeps_its_courtyard(tmp_path):
    ways = way(1, 0, 1, 2) + way(2, 0, 3, 2) + way(3, 4, 5, 6, 7, 4)
    whole = multipolygon((1, "outer"), (2, "outer"), (3, "inner"), (99, "outer"))
    world = osm(tmp_path, ways + whole)
    assert len(world.segments) == 8 and world.object_count == 1


def test_an_entrance_opens_a_room_with_a_courtyard_not_the_building_around_it(tmp_path):
    room = multipolygon((5, "outer"), (6, "inner"), indoor="room", level="0")
    ways = way(5, 0, 1, 9, 2, 3, 0) + way(6, 4, 5, 6, 7, 4)
    tags = {"building": "yes", "height": "12", "name": "tower"}
    shell = way(7, 0, 1, 9, 2, 3, 0, **tags) + node(9, (30, 10), entrance="main")
    world = osm(tmp_path, ways + room + shell)
    # The entrance is 0.9 m wide.
    assert lengths(world.segments).sum() == pytest.approx(100 + 100 + 40 - 0.9, abs=0.01)
    assert world.heights.max() == 12.0 and "tower" in world.object_names


def test_places_within_ways_and_relations_are_read(tmp_path):
    """Overpass's ``out geom`` has no nodes: places stand in the ways, in relations without refs."""

    def inline(*nodes, named=True):
        places = [node(n, NODES[n]).partition("lon")[2].partition(">")[0] for n in nodes]
        return "".join(
            f'<nd {f"""ref="{n}" """ * named}lon{place}/>'
            for n, place in zip(nodes, places, strict=True)
        )

    tags = of_tags({"building": "yes"})
    for body in (
        f'<way id="1">{inline(0, 1, 2, 3, 0)}{tags}</way>',
        f'<relation id="1"><member type="way" ref="5" role="outer">{inline(0, 1, 2, named=False)}'
        f'</member><member type="way" ref="6" role="outer">{inline(2, 3, 0, named=False)}</member>'
        f"{of_tags({'type': 'multipolygon', 'building': 'yes'})}</relation>",
    ):
        world = both(tmp_path, f"<osm>{body}</osm>")
        assert world.bounds == pytest.approx(np.array([[-15, -10], [15, 10]]), abs=1e-3)
    cut = f'<way id="1">{inline(0, 1, 2)}<nd/><nd/>{tags}</way>'
    (tmp_path / "a.osm").write_text(f"<osm>{cut}{HOUSE}</osm>")
    with pytest.raises(WorldError, match="no whole building"):
        load_world(tmp_path / "a.osm")


def test_elements_that_come_twice_are_merged(tmp_path):
    """Overpass's ``out body; >; out skel`` repeats elements, the second time without their tags."""
    oak = tree(10, 40, 5, height="12")
    ways = way(1, 0, 1, 2) + way(2, 0, 3, 2) + multipolygon((1, "outer"), (2, "outer"))
    for body in (HOUSE + way(1, 0, 1, 2, 3, 0), way(1) + HOUSE, ways + ways):
        world = osm(tmp_path, oak + body + oak + node(10, (40, 5)), trees=True)
        assert world.object_count == 2 and len(world.segments) == 10


def test_what_stands_in_a_courtyard_is_a_building_if_it_is_tagged_as_one(tmp_path):
    ring = way(1, 0, 1, 2, 3, 0)
    whole = multipolygon((1, "outer"), (3, "inner"))
    for tags, walls in (({}, 8), ({"building": "yes"}, 4), ({"highway": "pedestrian"}, 8)):
        assert len(osm(tmp_path, ring + way(3, 4, 5, 6, 7, 4, **tags) + whole).segments) == walls


@pytest.mark.parametrize(("part", "walls"), [({}, 4), ({"min_height": "4"}, 8)])
@pytest.mark.parametrize("grouped", [False, True])
def test_parts_take_the_place_of_their_building(part, walls, grouped, tmp_path):
    """A hall of 20 m with a tower of 50 m; in the middle of the tower a passage, or a part."""
    tall, low = {"building:part": "yes", "height": "50"}, {"building:part": "yes", "height": "20"}
    nodes = "".join(
        node(20 + n, place) for n, place in enumerate([(10, 0), (20, 0), (20, 20), (10, 20)])
    )
    body = nodes + way(1, 0, 20, 21, 1, 2, 22, 23, 3, 0, building="yes", height="50")
    body += way(2, 0, 20, 23, 3, 0, **low) + way(3, 21, 1, 2, 22, 21, **low)
    body += way(4, 20, 21, 22, 23, 20, **tall, **part)
    if grouped:
        members = [(1, "outline"), (2, "part"), (3, "part"), (4, "part")]
        rows = "".join(f'<member type="way" ref="{n}" role="{role}"/>' for n, role in members)
        body += f'<relation id="1">{rows}{of_tags({"type": "building"})}</relation>'
    world = osm(tmp_path, body)
    assert len(world.segments) == walls
    upright = np.isclose(world.segments[:, 0], world.segments[:, 2], atol=1e-6)
    assert world.heights[upright].tolist() == [20.0] * (walls // 2)
    assert set(world.heights[~upright].tolist()) == ({20.0} if part else {50.0})
    assert len(osm(tmp_path, way(2, 0, 1, 2, 3, 0, **low)).segments) == 4


def test_a_ring_cut_into_ways_in_any_order_is_closed_again(tmp_path):
    rng = np.random.default_rng(0)
    for _ in range(20):
        cuts = sorted({0, 4, *rng.integers(1, 4, 2).tolist()})
        parts = [[0, 1, 2, 3, 0][a : b + 1][:: rng.choice([-1, 1])] for a, b in pairwise(cuts)]
        order = rng.permutation(len(parts)).tolist()
        ways = "".join(way(n, *parts[k]) for n, k in enumerate(order))
        world = osm(tmp_path, ways + multipolygon(*((n, "outer") for n in order)))
        assert len(world.segments) == 4


@pytest.mark.parametrize(
    ("tags", "height"),
    [
        *(({"height": text}, height) for text, height in (
            ("12", 12.0), ("12,5 m", 12.5), ("10'6\"", 3.2004), ("40 ft", 12.192), ("950 cm", 9.5),
            ("0.1 km", 100.0), ("-3", None),
        )),
        ({"height": "tall", "building:levels": "4"}, 12.0),
        ({"building:levels": "2", "roof:levels": "1"}, 9.0),
        ({}, None),
    ],
)  # fmt: skip
def test_the_height_of_a_building_follows_from_its_tags(tags, height):
    assert tag_height(tags) == (height and pytest.approx(height))


def test_what_is_left_out_is_counted(tmp_path):
    carport = way(2, 4, 5, 6, 7, 4, building="carport")
    said = "left out: 1 building open at the ground, 1 incomplete building"
    with pytest.warns(Lrf3dNote, match=said):
        osm(tmp_path, HOUSE + carport + way(3, 4, 5, 99, 4, building="yes"))


@pytest.mark.parametrize(
    ("tags", "stands"),
    [
        ({"building": "yes"}, True),
        ({"building": "yes", "min_height": "0.3"}, True),
        ({"building": "yes", "min_height": "4"}, False),
        ({"building": "yes", "building:min_level": "2"}, False),
        ({"building": "yes", "location": "underground"}, False),
        ({"building": "no"}, False),
        ({"building": "roof"}, False),
        ({"highway": "path"}, False),
    ],
)
def test_what_stands_over_the_robot_is_no_building(tags, stands):
    assert is_building(tags) == stands


def test_trees_are_read_where_they_are_asked_for(tmp_path):
    oak = tree(10, 40, 5, height="12", circumference="1.5", species="Tilia")
    body = oak + node(11, (45, 5), highway="street_lamp") + HOUSE
    plain, world = osm(tmp_path, body), osm(tmp_path, body, trees=True)
    assert plain.object_count == 1 and not plain.materials
    assert world.object_count == 2 and world.object_names[1] == "Tilia"
    assert np.array_equal(world.segments[:4], plain.segments)
    trunk = world.segments[world.objects == 1].reshape(-1, 2)
    assert trunk.mean(axis=0) == pytest.approx([25, -5], abs=1e-2)
    assert np.hypot(*(trunk - trunk.mean(axis=0)).T) == pytest.approx(1.5 / (2 * np.pi))
    assert world.heights[4:].tolist() == [12.0] * 6
    assert [None, "bark"] == [made and made.name for made in world.materials]


def test_a_tree_within_or_at_a_building_is_left_out_and_one_mapped_twice_counts_once(tmp_path):
    places = ((15, 10), (30.2, 5), (31, 15), (34, 5), (34.1, 5))
    trees = "".join(tree(10 + n, *place) for n, place in enumerate(places))
    # More pairs than any file may have.
    trees += "".join(tree(20 + n, 34, 5) for n in range(1500))
    assert osm(tmp_path, trees + HOUSE, trees=True).object_count == 3


@pytest.mark.parametrize(
    ("tags", "height", "radius"),
    [
        ({}, DEFAULT_TREE, DEFAULT_TREE / 45),
        ({"height": "9 m", "circumference": "0.628318"}, 9.0, 0.1),
        ({"diameter_crown": "6"}, 10.0, 10 / 45),
        ({"height": "tall", "circumference": "90"}, DEFAULT_TREE, 1.2),
        ({"height": "4000"}, DEFAULT_TREE, DEFAULT_TREE / 45),
    ],
)
def test_a_tree_is_as_its_tags_say_or_as_most(tags, height, radius):
    assert (tree_height(tags), trunk_radius(tags)) == pytest.approx((height, radius))


def test_other_files_have_no_trees(tmp_path):
    save_world(World([[0, 0, 4, 0]]), tmp_path / "wall.toml")
    with pytest.raises(WorldError, match=r"trees is for \.json, \.osm files alone"):
        load_world(tmp_path / "wall.toml", trees=True)


SQUARE = [{"lat": 48.0 + a, "lon": 11.0 + b} for a, b in [(0, 0), (0, 2e-4), (2e-4, 2e-4), (0, 0)]]
SQUARE_HOUSE = {"type": "way", "id": 9, "geometry": SQUARE, "tags": {"building": "yes"}}


@pytest.mark.parametrize(
    ("element", "note"),
    [
        ({"type": "count", "id": 0, "tags": {"total": "5"}}, "left out: 1 count"),
        ({"type": "area", "id": 3600062422}, "left out: 1 area"),
        (
            {**SQUARE_HOUSE, "id": 8, "geometry": None, "nodes": None},
            "left out: 1 incomplete building",
        ),
        ({"type": "relation", "id": 3, "tags": None, "members": None}, ""),
    ],
)
def test_what_overpass_answers_besides_is_left_out_and_counted(element, note, written):
    path = written("a.json", json.dumps({"elements": [element, SQUARE_HOUSE]}))
    with pytest.warns(Lrf3dNote, match=note) if note else nullcontext():
        assert len(load_world(path).segments) == 3
