"""Of all that a town, a building or a mesh holds, what is used and what is left out add up."""

import gzip
import json
import warnings

import numpy as np
import pytest
import trimesh
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from PIL import Image

from lrf3d.base.balance import Balance
from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.world import load_world
from lrf3d.world.mesh import cut_of_mesh

GENERATED = {"max_examples": 40, "phases": [Phase.explicit, Phase.generate]}


@pytest.fixture
def balances(monkeypatch):
    """The balances of which readers make notes."""
    found = []
    monkeypatch.setattr(Balance, "note", lambda balance, path, *said: found.append(balance))
    return found


def added_up(balance):
    assert balance.missing == 0, balance
    return balance.left_out


TAGS = st.sampled_from(
    [
        {}, {"highway": "path"}, {"building": "yes"}, {"building": "proposed"}, {"barrier": "wall"},
        {"barrier": "hedge"}, {"indoor": "room", "level": "0;1"}, {"door": "yes"}, {"x": "y"},
        {"building:part": "yes", "min_height": "9"}, {"natural": "tree"}, {"indoor": "wall"},
        {"type": "multipolygon", "building": "yes"}, {"building": "roof"},
    ]
)  # fmt: skip
NODES = st.lists(st.sampled_from([0, 1, 2, 3, 9]), max_size=6)


@settings(**GENERATED)
@given(
    st.lists(TAGS, max_size=3),
    st.lists(st.tuples(NODES, TAGS), max_size=5),
    st.lists(TAGS, max_size=2),
)
@example([], [([0, 3, 2, 0, 0, 1], {"barrier": "wall"})], [])
def test_elements_of_osm_are_used_or_left_out(written, balances, points, ways, relations):
    def tagged(tags):
        return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())

    places = [(0, 0), (1, 0), (1, 1), (0, 1)]
    text = "".join(f'<node id="{n}" lon="{x}e-3" lat="{y}e-3"/>' for n, (x, y) in enumerate(places))
    for number, tags in enumerate(points, 20):
        text += f'<node id="{number}" lon="0.0005" lat="0">{tagged(tags)}</node>'
    for number, (nodes, tags) in enumerate([([0, 1, 2, 3, 0], {"building": "yes"}), *ways]):
        held = "".join(f'<nd ref="{node}"/>' for node in nodes)
        text += f'<way id="{number}">{held}{tagged(tags)}</way>'
    for number, tags in enumerate(relations):
        text += f'<relation id="{number}"><member type="way" ref="0"/>{tagged(tags)}</relation>'
    load_world(written("a.osm", f"<osm>{text}</osm>"))
    added_up(balances[-1])


@pytest.mark.parametrize(("unit", "scale"), [(1000.0, "0.001"), (100.0, "0.01"), (1.0, "")])
def test_a_mesh_in_another_unit_is_doubted_with_the_scale_that_fits(unit, scale, tmp_path):
    hall = trimesh.creation.box((20, 12, 3)).apply_translation((0, 0, 1.5)).apply_scale(unit)
    hall.export(tmp_path / "hall.stl")
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        load_world(tmp_path / "hall.stl")
    assert [f"--scale {scale} " in str(note.message) for note in notes] == [True] * bool(scale)
    world = load_world(tmp_path / "hall.stl", scale=1.0 / unit)
    assert world.heights == pytest.approx(3.0) and np.ptp(world.bounds, axis=0)[0] == 20.0


@settings(**GENERATED)
@given(st.lists(st.sampled_from([0, 60, 100, 205, 230, 254]), min_size=12, max_size=12))
def test_the_cells_of_a_ros_map_add_up(written, tmp_path, balances, greys):
    cells = np.array(greys, dtype=np.uint8).reshape(3, 4)
    cells[0, :2], cells[2, :2] = 0, 254
    Image.fromarray(cells).save(tmp_path / "a.png")
    text = "image: a.png\nresolution: 0.1\norigin: [0, 0, 0]\n"
    load_world(written("a.yaml", text + "occupied_thresh: 0.65\nfree_thresh: 0.25\n"))
    assert added_up(balances[-1]).get("grey cell", 0) in (0, (cells == 100).sum())


def ring(x1, y1, x2, y2):
    return [[[x1, y1], [x2, y1], [x2, y2], [x1, y2], [x1, y1]]]


def feature(geometry="Polygon", coordinates=None, **properties):
    shape = {"type": geometry, "coordinates": coordinates or ring(50, 0, 60, 8)}
    return {"type": "Feature", "properties": properties, "geometry": shape if geometry else None}


FEATURES = st.sampled_from(
    [
        feature(), feature(highway="path"), feature(building="planned"), feature(None),
        feature("Point", [1, 2]), feature("Point", [5, 0], door="yes", level="0"),
        feature(indoor="room", level="0"), feature(indoor="room", level=1),
        feature(indoor="corridor", level="0-2"), feature(category="room", level_id="L1"),
        feature("LineString", [[0, 0], [5, 5]], barrier="fence"), feature(natural="water", wall=1),
    ]
)  # fmt: skip


def geojson(path, features):
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


@settings(**GENERATED)
@given(st.lists(FEATURES, max_size=6))
def test_features_of_geojson_are_used_or_left_out(tmp_path, balances, features):
    load_world(geojson(tmp_path / "a.geojson", [feature(), *features]))
    added_up(balances[-1])


@pytest.mark.parametrize(
    ("tags", "reason"),
    [
        ({"building": "roof"}, "building open at the ground"), ({"building": "no"}, "building: no"),
        ({"building:part": "yes", "min_height": "5"}, "building open at the ground"),
        ({"barrier": "hedge"}, "barrier: hedge"), ({"razed:building": "yes"}, "razed:building"),
        ({"indoor": "area"}, "indoor area without walls"),
        ({"feature_type": "venue"}, "IMDF feature: venue"),
    ],
)  # fmt: skip
def test_geojson_and_openstreetmap_leave_out_the_same(tags, reason, tmp_path, balances):
    features = [feature(building="yes"), feature("Polygon", ring(0, 0, 9, 9), **tags)]
    world = load_world(geojson(tmp_path / "a.geojson", features))
    assert len(world.segments) == 4 and added_up(balances[0]) == {reason: 1}


def test_rooms_without_a_tag_are_named_where_they_lose_their_walls(tmp_path):
    rooms = [feature("Polygon", ring(x, 0, x + 9, 9)) for x in (0, 9)]
    with pytest.warns(Lrf3dNote, match="2 areas that touch.*indoor=room"):
        load_world(geojson(tmp_path / "a.geojson", rooms))


@pytest.mark.parametrize("imdf", [True, False])
def test_rooms_have_walls_in_common_which_doors_open_on_one_level(imdf, tmp_path):
    def named(level):
        unit = {"feature_type": "unit", "category": "room", "level_id": level}
        return unit if imdf else {"indoor": "room", "level": level}

    door = {"feature_type": "opening", "level_id": "0"} if imdf else {"door": "yes", "level": "0"}
    where = ("LineString", [[10, 3], [10, 4]]) if imdf else ("Point", [10, 3.5])
    rooms = [ring(0, 0, 10, 8), ring(10, 0, 20, 8), ring(0, 8, 20, 10)]
    features = [feature("Polygon", each, **named("0")) for each in rooms]
    features += [feature(**named("1")), feature(*where, **door)]
    path = geojson(tmp_path / "a.geojson", features)
    with pytest.warns(Lrf3dNote, match=r"3 indoor rooms; level 0 of 0, 1.*1 feature of another"):
        world = load_world(path)
    assert lengths(world.segments).sum() == pytest.approx(88 - (1.0 if imdf else 0.9), abs=0.02)
    with pytest.warns(Lrf3dNote):
        assert lengths(load_world(path, level="1").segments).sum() == pytest.approx(36)
    with pytest.raises(WorldError, match="no level '7'; levels: 0, 1"):
        load_world(path, level="7")


@pytest.mark.parametrize("floor", [0.0, 100.0, -3.0])
def test_a_mesh_is_cut_above_its_floor_and_its_triangles_add_up(floor, tmp_path):
    slab = trimesh.creation.box((20, 20, 0.2)).apply_translation((0, 0, floor - 0.1))
    wall = trimesh.creation.box((8, 0.5, 2.7)).apply_translation((0, 0, floor + 1.35))
    low = trimesh.creation.box((1, 1, 1.0)).apply_translation((5, 5, floor + 0.5))
    trimesh.util.concatenate([slab, wall, low]).export(tmp_path / "a.stl")
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        world = load_world(tmp_path / "a.stl")
        high = load_world(tmp_path / "a.stl", cut=2.0)
    assert lengths(world.segments).sum() == pytest.approx(21, abs=1e-4)
    assert lengths(high.segments).sum() == pytest.approx(17, abs=1e-4)
    assert world.heights.max() == pytest.approx(2.7, abs=1e-4)
    assert len(notes) == 2 * (floor != 0.0)
    _, balance, _ = cut_of_mesh(tmp_path / "a.stl")
    assert sum(added_up(balance).values()) + balance.used == 36 and balance.used == 16


def test_packed_files_and_features_in_lines_are_read(written, tmp_path):
    features = [json.dumps(feature("LineString", [[0, 0], [9, 0]])) for _ in range(2)]
    (tmp_path / "a.geojsonl").write_text("\n".join(features))
    packed = gzip.compress((tmp_path / "a.geojsonl").read_bytes())
    (tmp_path / "b.geojsonl.gz").write_bytes(packed)
    with pytest.warns(Lrf3dNote):
        plain = load_world(tmp_path / "a.geojsonl")
        unpacked = load_world(tmp_path / "b.geojsonl.gz")
    assert np.array_equal(plain.segments, unpacked.segments) and len(plain.segments) == 2
    drawing = b'<svg width="9m" height="9m" viewBox="0 0 9 9"><path d="M1 1 H8"/></svg>'
    assert load_world(written("a.svgz", gzip.compress(drawing))).bounds == pytest.approx(
        np.array([[1, 8], [8, 8]])
    )
