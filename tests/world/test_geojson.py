import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d.base.errors import Lrf3dNote, MissingLibraryError, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.world import load_world, save_world
from lrf3d.world.towns.features import DEFAULT_BUILDING_HEIGHT

TOWN = Path(__file__).parents[2] / "examples/town.geojson"
FAR = np.array([85000.0, 447500.0])


def rectangle(x, y, width, depth):
    ring = [[x, y], [x + width, y], [x + width, y + depth], [x, y + depth], [x, y]]
    return (np.array(ring) + FAR).tolist()


def feature(geometry, **properties):
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def polygon(*rings, **properties):
    return feature({"type": "Polygon", "coordinates": list(rings)}, **properties)


def read(folder, *features, **members):
    path = folder / "town.geojson"
    collection = {"type": "FeatureCollection", "features": list(features), **members}
    path.write_text(json.dumps(collection))
    return load_world(path)


def test_a_footprint_keeps_its_coordinates_and_turns_counter_clockwise(tmp_path):
    ring = rectangle(0.123456789, 0.3, 10.1, 8.7)
    world = read(tmp_path, polygon(ring[::-1], height=12))
    assert sorted(map(tuple, world.segments[:, :2])) == sorted(map(tuple, ring[:-1]))
    ends = world.segments - np.tile(FAR, 2)
    assert (ends[:, 0] * ends[:, 3] - ends[:, 2] * ends[:, 1]).sum() > 0.0
    assert (world.segments[:, 2:] == np.roll(world.segments[:, :2], -1, axis=0)).all()
    assert (world.heights == 12.0).all()
    assert world.name == "town"


def test_touching_footprints_become_one_block_with_straight_facades(tmp_path):
    houses = [polygon(rectangle(6.0 * i, 0.0, 6.0, 9.0)) for i in range(5)]
    world = read(tmp_path, *houses, polygon(rectangle(30.06, 0.0, 5.0, 5.0)))
    assert world.object_count == 2
    assert np.bincount(world.objects).tolist() == [4, 4]
    assert sorted(lengths(world.segments)[world.objects == 0]) == pytest.approx(
        [9.0, 9.0, 30.0, 30.0]
    )


@settings(max_examples=60)
@given(
    gap=st.floats(-0.5, 0.049),
    angle=st.floats(0.0, 3.0),
    width=st.floats(4.0, 30.0),
    depth=st.floats(4.0, 30.0),
)
def test_a_hair_between_footprints_is_closed_and_corners_stay(
    gap, angle, width, depth, tmp_path_factory
):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    first = np.array([[0, 0], [width, 0], [width, depth], [0, depth]]) @ turn.T + FAR
    second = first + turn @ [width + gap, 0.0]
    path = tmp_path_factory.mktemp("gap") / "pair.geojson"
    path.write_text(
        json.dumps({"type": "MultiPolygon", "coordinates": [[first.tolist()], [second.tolist()]]})
    )
    world = load_world(path)
    assert world.object_count == 1
    assert len(world.segments) == 4
    outer = {tuple(first[0]), tuple(first[3]), tuple(second[1]), tuple(second[2])}
    assert {tuple(corner) for corner in world.segments[:, :2]} == outer


def test_a_world_from_degrees_is_written_in_degrees_and_comes_back(tmp_path):
    town = load_world(TOWN)
    path = tmp_path / "back.geojson"
    save_world(town, path)
    written, given = (json.loads(file.read_text())["features"][0] for file in (path, TOWN))
    assert written["geometry"]["coordinates"][0] == given["geometry"]["coordinates"][0][0]
    back = load_world(path)
    assert (back.segments == town.segments).all() and back.place == town.place


def test_a_sharp_corner_survives_the_closing(tmp_path):
    wedge = (np.array([[0, 0], [20, 0], [0, 4]]) + FAR).tolist()
    world = read(tmp_path, polygon(wedge), polygon(rectangle(-8.0, 0.0, 8.0, 4.0)))
    assert (world.segments[:, :2] == wedge[1]).all(axis=1).any()
    assert len(world.segments) == 4


def test_walls_take_the_height_of_their_footprint(tmp_path):
    world = read(
        tmp_path,
        polygon(rectangle(0, 0, 10, 10), height="12.5 m"),
        polygon(rectangle(10, 2, 10, 5), **{"building:levels": "2"}),
    )
    assert world.object_count == 1
    by_x = world.segments[:, [0, 2]].mean(axis=1) - FAR[0]
    assert (world.heights[by_x <= 10.0] == 12.5).all()
    assert (world.heights[by_x > 10.0] == 6.0).all()


def test_a_courtyard_stays_and_turns_clockwise(tmp_path):
    world = read(tmp_path, polygon(rectangle(0, 0, 30, 30), rectangle(10, 10, 8, 8)))
    assert world.object_count == 1
    ends = (world.segments - np.tile(FAR, 2))[4:]
    assert (ends[:, 0] * ends[:, 3] - ends[:, 2] * ends[:, 1]).sum() / 2 == pytest.approx(-64.0)


def test_lines_are_walls_as_they_are_and_points_are_none(tmp_path):
    world = read(
        tmp_path,
        feature({"type": "Point", "coordinates": [1, 2]}),
        feature(None),
        feature({"type": "Polygon", "coordinates": []}),
        feature({"type": "LineString", "coordinates": [[0, 0, 9], [5, 0], [5, 5, 9]]}),
        polygon(rectangle(0, 10, 4, 4), name="hut", colour="#ffffff"),
        feature(
            {
                "type": "GeometryCollection",
                "geometries": [
                    {"type": "MultiLineString", "coordinates": [[[7, 7], [8, 8]], [[9, 9], [9, 8]]]}
                ],
            },
            height=1.5,
        ),
    )
    assert world.object_names == ("hut", "", "")
    assert world.objects.tolist() == [0, 0, 0, 0, 1, 1, 2, 2]
    assert world.heights.tolist() == [DEFAULT_BUILDING_HEIGHT] * 4 + [2.5, 2.5, 1.5, 1.5]
    assert world.segments[4:].tolist() == [[0, 0, 5, 0], [5, 0, 5, 5], [7, 7, 8, 8], [9, 9, 9, 8]]
    assert world.colours[0].tolist() == [1.0, 1.0, 1.0]


def test_degrees_are_laid_flat_to_metres(tmp_path):
    # A house of 20 m by 10 m at 52° north, and another one 100 m farther north.
    east, north = 20.0 / (111195.08 * np.cos(np.radians(52.0))), 10.0 / 111195.08
    house = np.array([[0, 0], [east, 0], [east, north], [0, north]]) + np.array([4.36, 52.0])
    other = house + np.array([0.0, 10.0 * north])
    with pytest.warns(Lrf3dNote, match=r"latitude 52\.0005°, longitude 4\.3601°"):
        world = read(tmp_path, polygon(house.tolist()), polygon(other.tolist()))
    assert sorted(lengths(world.segments)[:4]) == pytest.approx([10.0, 10.0, 20.0, 20.0], rel=1e-4)
    assert np.abs(world.bounds.mean(axis=0)).max() < 1.0
    with pytest.raises(WorldError, match="latitude stands before longitude"):
        read(tmp_path, polygon(np.fliplr(house + np.array([140.0, 0.0])).tolist()))


def test_metres_near_the_origin_are_no_degrees(tmp_path):
    ring = [[0, 0], [0.4, 0], [0.4, 0.3], [0, 0.3]]
    assert lengths(read(tmp_path, polygon(ring)).segments).max() == 0.4
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    assert lengths(read(tmp_path, polygon(ring), crs=crs).segments).max() > 40_000.0


def test_blocks_come_in_the_order_of_the_file_and_each_time_the_same(tmp_path):
    spots = np.random.default_rng(5).permutation(25)
    houses = [polygon(rectangle(9.0 * (s // 5), 9.0 * (s % 5), 6, 6), name=str(s)) for s in spots]
    world = read(tmp_path, *houses)
    assert world.object_names == tuple(str(spot) for spot in spots)
    assert world.segments.tobytes() == read(tmp_path, *houses).segments.tobytes()


def test_an_outline_that_crosses_itself_is_mended(tmp_path):
    bow = [[0, 0], [10, 10], [10, 0], [0, 10]]
    assert len(read(tmp_path, polygon((np.array(bow) + FAR).tolist())).segments) == 6


@pytest.mark.parametrize("height", ["tall", -3, [1, "x"], True, [], 10**400])
def test_a_height_that_is_none_is_refused_with_its_feature(height, tmp_path):
    good = polygon(rectangle(0, 0, 5, 5))
    with pytest.raises(WorldError, match=r"feature 1: height is .*expected metres"):
        read(tmp_path, good, polygon(rectangle(9, 0, 5, 5), height=height))


@pytest.mark.parametrize(
    "crs", ["urn:ogc:def:crs:EPSG::3857", "EPSG:3857", "http://www.opengis.net/def/crs/EPSG/0/3857"]
)
def test_the_stretched_metres_of_web_maps_are_laid_flat(crs, tmp_path):
    degrees = np.array([[4.35, 52.0], [4.351, 52.0], [4.351, 52.0005], [4.35, 52.0005]])
    flat = read(tmp_path, polygon(degrees.tolist()))
    radius = 6_378_137.0
    north = radius * np.log(np.tan(np.pi / 4 + np.radians(degrees[:, 1]) / 2))
    web = np.column_stack([radius * np.radians(degrees[:, 0]), north])
    assert np.ptp(web[:, 0]) > 1.5 * np.ptp(flat.segments[:, 0])
    told = {"type": "name", "properties": {"name": crs}}
    world = read(tmp_path, polygon(web.tolist()), crs=told)
    assert world.bounds == pytest.approx(flat.bounds, abs=1e-6)
    assert world.place == pytest.approx(flat.place)


@pytest.mark.parametrize(
    ("code", "crs", "flat"),
    [
        ("EPSG:2263", "urn:ogc:def:crs:EPSG::2263", False),  # Feet.
        ("ESRI:102718", "ESRI:102718", False),
        ("EPSG:32618", "EPSG:32618", False),
        ("EPSG:32618", "WGS 84 / UTM zone 18N", False),
        ("EPSG:3395", {"type": "EPSG", "properties": {"code": 3395}}, True),  # Enlarged by 1.3.
        ("EPSG:4267", {"type": "link", "properties": {"href": "http://x.org/epsg/4267/"}}, True),
    ],
)
def test_other_systems_become_metres(code, crs, flat, tmp_path):
    pyproj = pytest.importorskip("pyproj")
    degrees = np.array([[0, 0], [5, 0], [5, 3], [0, 3]]) * 1e-4 + [-73.99, 40.75]
    around = pyproj.Geod(ellps="WGS84").line_length(*np.vstack([degrees, degrees[:1]]).T)
    there = pyproj.Transformer.from_crs("OGC:CRS84", code, always_xy=True).transform(*degrees.T)
    ring = np.column_stack([*there, [7.0, 8.0, 9.0, -1.0]]).tolist()
    told = {"type": "name", "properties": {"name": crs}} if isinstance(crs, str) else crs
    world = read(tmp_path, polygon(ring), crs=told)
    assert lengths(world.segments).sum() == pytest.approx(around, rel=1e-3)
    assert (world.place is not None) == flat


@pytest.mark.parametrize(
    ("crs", "said"),
    [
        ("EPSG:99999", "is not known"),
        ("EPSG:5773", "no system of places"),
        ("+proj=utm +zone=33 +nadgrids=/etc/passwd", "names a file"),
        (["EPSG:4326"], "expected a name"),
        ("EPSG:27700", "outside of where it is used"),
    ],
)
def test_a_system_that_does_not_fit_is_refused(crs, said, tmp_path):
    pytest.importorskip("pyproj")
    with pytest.raises(WorldError, match=rf"crs .*{said}"):
        read(tmp_path, polygon([[0, 0], [1e8, 0], [1e8, 1e8]]), crs=crs)


def test_without_pyproj_a_system_that_needs_it_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(MissingLibraryError, match=r"crs 'EPSG:2263' .*install .*geo"):
        read(tmp_path, polygon(rectangle(0, 0, 5, 5)), crs="EPSG:2263")
    assert len(read(tmp_path, polygon(rectangle(0, 0, 5, 5)), crs="EPSG:25831").segments) == 4


@pytest.mark.parametrize("crs", [None, "urn:ogc:def:crs:OGC:1.3:CRS84"])
@pytest.mark.parametrize("cut", [False, True])
def test_a_building_across_the_dateline_is_as_wide_as_it_is(crs, cut, tmp_path):
    def ring(west, east):
        return [[west, -17.0], [east, -17.0], [east, -16.9999], [west, -16.9999], [west, -17.0]]

    rings = [ring(179.9999, -179.9999)]
    if cut:
        rings = [ring(179.9999, 180.0), ring(-180.0, -179.9999)]
    told = {} if crs is None else {"crs": {"type": "name", "properties": {"name": crs}}}
    geometry = {"type": "MultiPolygon", "coordinates": [[each] for each in rings]}
    world = read(tmp_path, feature(geometry), **told)
    assert sorted(lengths(world.segments)) == pytest.approx([11.12, 11.12, 21.27, 21.27], abs=0.02)
    assert abs(world.place[0]) == pytest.approx(180.0) and world.place[1] < -16.0


def test_roads_water_and_land_are_no_walls(tmp_path):
    square = [[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]]
    far = (np.array(square) + 50).tolist()

    def line(y, **properties):
        return feature({"type": "LineString", "coordinates": [[0, y], [99, y]]}, **properties)

    features = [
        polygon(square, building="yes", landuse="retail"),
        line(20, barrier="wall"),
        line(30, highway="residential", building=None),
        line(40, tags={"waterway": "river"}),
        polygon(far, natural="water"),
    ]
    with pytest.warns(Lrf3dNote, match="3 features of roads, water and land"):
        assert len(read(tmp_path, *features, units="m").segments) == 5


def test_a_foreign_member_elements_makes_no_answer_of_overpass(tmp_path):
    assert len(read(tmp_path, polygon(rectangle(0, 0, 9, 9)), elements=[]).segments) == 4
