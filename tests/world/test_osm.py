"""Worlds from OpenStreetMap extracts: buildings, and trees where they are asked for."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d.errors import WorldError
from lrf3d.world import World, load_world, save_world
from lrf3d.world.geographic import EARTH_RADIUS
from lrf3d.world.osm import DEFAULT_TREE, is_building, tag_height, tree_height, trunk_radius

NODES = [(0, 0), (30, 0), (30, 20), (0, 20), (10, 5), (20, 5), (20, 15), (10, 15)]


def told(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())


def node(number: int, place: tuple[float, float], **tags: str) -> str:
    degree = np.degrees(1.0 / EARTH_RADIUS)
    lon, lat = 4 + place[0] * degree / np.cos(np.radians(52)), 52 + place[1] * degree
    return f'<node id="{number}" lon="{lon}" lat="{lat}">{told(tags)}</node>'


def way(number: int, *nodes: int, **tags: str) -> str:
    points = "".join(f'<nd ref="{node}"/>' for node in nodes)
    return f'<way id="{number}">{points}{told(tags)}</way>'


def extract(folder: Path, body: str) -> Path:
    path = folder / "a.osm"
    nodes = "".join(node(number, place) for number, place in enumerate(NODES))
    path.write_text(f"<osm>{nodes}{body}</osm>")
    return path


def osm(folder: Path, body: str) -> World:
    return load_world(extract(folder, body))


HOUSE = way(1, 0, 1, 2, 3, 0, building="yes")


def tree(number: int, x: float, y: float, **tags: str) -> str:
    return node(number, (x, y), natural="tree", **tags)


def test_a_building_is_laid_flat_about_its_middle(tmp_path: Path) -> None:
    body = way(1, 0, 1, 2, 3, 0, building="yes", height="7.5 m", name="hall")
    world = osm(tmp_path, body + way(2, 4, 5, 6, highway="path"))
    assert world.bounds == pytest.approx(np.array([[-15, -10], [15, 10]]), abs=1e-3)
    assert world.heights.tolist() == [7.5] * 4 and world.object_names == ("hall",)
    assert world.place == pytest.approx((4.000219, 52.00009), abs=1e-6)
    save_world(world, tmp_path / "a.toml")
    assert load_world(tmp_path / "a.toml").place == world.place


def test_a_multipolygon_keeps_its_courtyard(tmp_path: Path) -> None:
    ways = way(1, 0, 1, 2) + way(2, 0, 3, 2) + way(3, 4, 5, 6, 7, 4)
    members = "".join(
        f'<member type="way" ref="{ref}" role="{role}"/>'
        for ref, role in ((1, "outer"), (2, "outer"), (3, "inner"), (99, "outer"))
    )
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    world = osm(tmp_path, f'{ways}<relation id="1">{members}{tags}</relation>')
    assert len(world.segments) == 8 and world.object_count == 1


@pytest.mark.parametrize(
    ("tags", "height"),
    [
        ({"height": "12"}, 12.0),
        ({"height": "12,5 m"}, 12.5),
        ({"height": "10'6\""}, 3.2004),
        ({"height": "tall", "building:levels": "4"}, 12.0),
        ({"building:levels": "2", "roof:levels": "1"}, 9.0),
        ({"height": "-3"}, None),
        ({}, None),
    ],
)
def test_the_height_of_a_building_is_told_by_its_tags(tags: dict, height: float | None) -> None:
    assert tag_height(tags) == (None if height is None else pytest.approx(height))


@pytest.mark.parametrize(
    ("tags", "stands"),
    [
        ({"building": "yes"}, True),
        ({"building": "no"}, False),
        ({"building": "roof"}, False),
        ({"building": "yes", "min_height": "4"}, False),
        ({"building": "yes", "min_height": "0.3"}, True),
        ({"building": "yes", "building:min_level": "2"}, False),
        ({"building": "yes", "location": "underground"}, False),
        ({"highway": "path"}, False),
    ],
)
def test_what_stands_over_the_robot_is_no_building(tags: dict, stands: bool) -> None:
    assert is_building(tags) == stands


@settings(max_examples=25, deadline=None)
@given(cuts=st.sets(st.integers(1, 3)), rng=st.randoms())
def test_a_ring_cut_into_ways_in_any_order_is_closed_again(
    cuts, rng, tmp_path_factory: pytest.TempPathFactory
) -> None:
    ring = [0, 1, 2, 3, 0]
    parts = [ring[a : b + 1] for a, b in pairwise([0, *sorted(cuts), 4])]
    parts = [part[::-1] if rng.random() < 0.5 else part for part in parts]
    rng.shuffle(parts)
    ways = "".join(way(number, *part) for number, part in enumerate(parts))
    members = "".join(f'<member type="way" ref="{n}" role="outer"/>' for n in range(len(parts)))
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    body = f'{ways}<relation id="1">{members}{tags}</relation>'
    assert len(osm(tmp_path_factory.mktemp("osm"), body).segments) == 4


def test_an_extract_without_a_building_says_so(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="no whole building"):
        osm(tmp_path, way(1, 0, 1, 2))


def test_trees_are_read_where_they_are_asked_for(tmp_path: Path) -> None:
    lime = tree(10, 40, 5, height="12", circumference="1.5", species="Tilia")
    path = extract(tmp_path, lime + node(11, (45, 5), highway="street_lamp") + HOUSE)
    plain, world = load_world(path), load_world(path, trees=True)
    assert plain.object_count == 1 and not plain.materials
    assert world.object_count == 2 and world.object_names[1] == "Tilia"
    assert np.array_equal(world.segments[:4], plain.segments)
    trunk = world.segments[world.objects == 1].reshape(-1, 2)
    assert trunk.mean(axis=0) == pytest.approx([25, -5], abs=1e-2)
    assert np.hypot(*(trunk - trunk.mean(axis=0)).T) == pytest.approx(1.5 / (2 * np.pi))
    assert world.heights[4:].tolist() == [12.0] * 6
    assert [None, "bark"] == [made and made.name for made in world.materials]


def test_a_tree_within_or_at_a_building_is_left_out_and_one_mapped_twice_counts_once(
    tmp_path: Path,
) -> None:
    places = [(15, 10), (30.2, 5), (34, 5), (34.1, 5)]
    trees = "".join(tree(10 + number, *place) for number, place in enumerate(places))
    assert load_world(extract(tmp_path, trees + HOUSE), trees=True).object_count == 2


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
def test_a_tree_is_as_its_tags_say_or_as_most(tags: dict, height: float, radius: float) -> None:
    assert (tree_height(tags), trunk_radius(tags)) == pytest.approx((height, radius))


def test_other_files_have_no_trees(tmp_path: Path) -> None:
    save_world(World([[0, 0, 4, 0]]), tmp_path / "wall.toml")
    with pytest.raises(WorldError, match=r"trees are read from OpenStreetMap"):
        load_world(tmp_path / "wall.toml", trees=True)
