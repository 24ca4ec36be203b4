"""Trees of OpenStreetMap extracts: which become trunks, and how thick and high these are."""

import numpy as np
import pytest

from lrf3d.errors import WorldError
from lrf3d.world import World, load_world, save_world
from lrf3d.world.geographic import EARTH_RADIUS
from lrf3d.world.osm import DEFAULT_TREE, tree_height, trunk_radius

HOUSE = [(0, 0), (30, 0), (30, 20), (0, 20)]


def node(number, place, **tags):
    degree = np.degrees(1.0 / EARTH_RADIUS)
    lon, lat = 4 + place[0] * degree / np.cos(np.radians(52)), 52 + place[1] * degree
    told = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    return f'<node id="{number}" lon="{lon}" lat="{lat}">{told}</node>'


def extract(folder, *trees):
    nodes = "".join(node(number, place) for number, place in enumerate(HOUSE))
    refs = "".join(f'<nd ref="{number}"/>' for number in (0, 1, 2, 3, 0))
    house = f'<way id="1">{refs}<tag k="building" v="yes"/></way>'
    path = folder / "town.osm"
    path.write_text(f"<osm>{nodes}{''.join(trees)}{house}</osm>")
    return path


def tree(number, x, y, **tags):
    return node(number, (x, y), natural="tree", **tags)


def test_trees_are_read_where_they_are_asked_for(tmp_path):
    path = extract(
        tmp_path,
        tree(10, 40, 5, height="12", circumference="1.5", species="Tilia"),
        node(11, (45, 5), highway="street_lamp"),
    )
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
    tmp_path,
):
    path = extract(
        tmp_path, tree(10, 15, 10), tree(11, 30.2, 5), tree(12, 34, 5), tree(13, 34.1, 5)
    )
    assert load_world(path, trees=True).object_count == 2


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
    with pytest.raises(WorldError, match=r"trees are read from OpenStreetMap"):
        load_world(tmp_path / "wall.toml", trees=True)
