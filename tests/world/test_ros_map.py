import pickle

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from lrf3d import Pose, World, WorldError, load_world, save_world
from lrf3d.geometry.lines import lengths
from lrf3d.world.grid_walls import walls_of_grid
from lrf3d.world.ros_map import rewrite_map, write_ros_map


def save_map(folder, pixels, name="map.png", **values):
    Image.fromarray(pixels.astype(np.uint8)).save(folder / name)
    told = {"image": name, "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0, **values}
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in told.items()))
    return path


def room():
    """A room of 40 by 30 cells, drawn from the top, with walls one cell thick."""
    pixels = np.full((50, 60), 254)
    pixels[[10, 39], 10:50] = 0
    pixels[10:40, [10, 49]] = 0
    return pixels


@settings(max_examples=100)
@given(st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.integers(3, 300), st.booleans())
def test_a_straight_wall_drawn_cell_by_cell_is_one_segment(slope, shift, length, upright):
    column = np.arange(length)
    row = np.floor(slope * (column + 0.5) + shift).astype(int)
    cells = np.zeros((np.ptp(row) + 7, length + 6), dtype=bool)
    cells[row - row.min() + 3, column + 3] = True
    assert len(walls_of_grid(cells.T if upright else cells)) == 1


@settings(max_examples=60)
@given(st.integers(1, 2), st.integers(5, 60), st.booleans())
def test_walls_of_one_or_two_cells_are_lines_along_their_middle(thick, length, upright):
    cells = np.zeros((12, length + 8), dtype=bool)
    cells[5 : 5 + thick, 4 : 4 + length] = True
    walls = walls_of_grid(cells.T if upright else cells)
    across, along = (0, 1) if upright else (1, 0)
    ends = walls.reshape(-1, 2)
    assert len(walls) == 1 and np.allclose(ends[:, across], 5 + thick / 2)
    assert np.abs(np.sort(ends[:, along]) - [4, 4 + length]).max() <= 1.5


@settings(max_examples=60)
@given(arrays(np.bool_, st.tuples(st.integers(2, 14), st.integers(2, 14))))
def test_every_occupied_cell_at_an_edge_is_near_a_wall(cells):
    edge = cells[1:-1, 1:-1] & ~(
        cells[2:, 1:-1] & cells[:-2, 1:-1] & cells[1:-1, 2:] & cells[1:-1, :-2]
    )
    walls = walls_of_grid(cells)
    if edge.any():
        lines = shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2)))
        row, column = np.nonzero(edge)
        points = shapely.points(np.column_stack([column, row]) + 1.5)
        assert shapely.distance(points, lines).max() <= 2.3


@pytest.mark.parametrize("thick", [1, 2, 3, 4])
def test_a_wall_that_ends_at_a_thick_part_or_at_another_wall_meets_it(thick):
    cells = np.zeros((40, 50), dtype=bool)
    cells[10:14, 5:45] = cells[14:30, 20 : 20 + thick] = True
    walls = walls_of_grid(cells)
    ends, owner = np.unique(np.round(walls.reshape(-1, 2), 6), axis=0, return_counts=True)
    lines = shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2)))
    assert len(shapely.get_parts(shapely.line_merge(lines))) <= 4 and lines.is_valid
    assert (ends[owner == 1][:, 1] > 25).all()


def test_walls_meet_where_they_join_and_holes_of_three_cells_are_closed():
    cells = np.zeros((40, 50), dtype=bool)
    cells[10, 5:45] = cells[10:35, 20] = True
    cells[10, 30:33] = False
    walls = walls_of_grid(cells)
    assert len(walls) == 3
    assert sorted(map(tuple, walls.reshape(-1, 2).tolist())).count((20.5, 10.5)) == 3


def test_a_room_is_four_walls_with_closed_corners(tmp_path):
    world = load_world(save_map(tmp_path, room()))
    assert len(world.segments) == 4 and world.object_count == 1
    # Along the middles of the cells; the picture begins at the top, the map at the bottom.
    assert world.bounds == pytest.approx(np.array([[1.05, 1.05], [4.95, 3.95]]))
    assert len(np.unique(np.round(world.segments.reshape(-1, 2), 9), axis=0)) == 4


def test_a_thick_block_is_its_outline(tmp_path):
    pixels = np.full((20, 30), 254)
    pixels[5:15, 5:25] = 0
    world = load_world(save_map(tmp_path, pixels))
    assert len(world.segments) == 4
    assert world.bounds == pytest.approx(np.array([[0.5, 0.5], [2.5, 1.5]]))


@pytest.mark.parametrize(
    ("mode", "negate", "high", "low", "occupied", "free"),
    [
        ("trinary", "0", "0.8", "0.2", (0, 51), (204, 255)),
        ("trinary", "true", "0.8", "0.2", (204, 255), (0, 51)),
        ("scale", "0", "1.0", "0.0", (0, 0), (255, 255)),
        ("scale", "no", "1.", "0", (0, 0), (255, 255)),
        ("scale", "1", "1e0", "0e-1", (255, 255), (0, 0)),
        ("raw", "0", "1.0", "0.0", (100, 100), (0, 0)),
        ("Raw", "1", "65e-2", ".2", (65, 100), (0, 20)),
    ],
)
def test_cells_are_as_for_the_map_server(
    mode, negate, high, low, occupied, free, written, tmp_path
):
    greys = np.array([0, 1, 19, 20, 21, 50, 51, 52, 64, 65, 100, 203, 204, 254, 255])
    blocks = np.full((9, 9 * len(greys)), 150, dtype=np.uint8)
    blocks.reshape(9, -1, 9)[3:6, :, 3:6] = greys[:, None]
    path = written(
        "map.yaml",
        f"image: map.png\nresolution: 5e-2\norigin: [-1e-05, +1., .5]\nnegate: {negate}\n"
        f"mode: {mode}\noccupied_thresh: {high}\nfree_thresh: {low}\n",
    )
    for alpha in (255, 128) if mode == "scale" else (255,):
        pixels = np.stack([blocks, np.full_like(blocks, alpha)], axis=-1)
        pixels[0, :9] = (255 if negate in ("1", "true") else 0, 255)
        Image.fromarray(pixels, "LA").save(tmp_path / "map.png")
        world = load_world(path)
        assert world.free is not None and world.free.origin == (-1e-05, 1.0, 0.5)
        columns = Pose(*world.free.origin).inverse().apply(world.segments.reshape(-1, 2))
        walled = {int(x) for x, y in columns / (9 * 0.05) if y < 0.4}
        within = greys[world.free.cells[4, 4::9]]
        for found, (first, last) in ((greys[sorted(walled)], occupied), (within, free)):
            expected = greys[(greys >= first) & (greys <= last) & (alpha == 255)]
            assert found.tolist() == expected.tolist()


def test_the_picture_of_a_map_may_lie_in_a_folder_beside_it(tmp_path):
    path = save_map(tmp_path, room())
    expected = load_world(path).segments
    (tmp_path / "images").mkdir()
    (tmp_path / "map.png").rename(tmp_path / "images" / "map.png")
    text = path.read_text()
    path.write_text(text.replace("map.png", "images/map.png"))
    assert load_world(path).segments.tobytes() == expected.tobytes()
    for elsewhere in ("/images/map.png", "images/../images/map.png"):
        path.write_text(text.replace("map.png", elsewhere))
        with pytest.raises(WorldError, match="put the picture next to this file"):
            load_world(path)


@pytest.mark.parametrize("name", ["map.pgm", "map.png", "map.bmp"])
@pytest.mark.parametrize("kind", ["L", "RGB", "RGBA", "P", "I;16"])
def test_colours_and_formats_make_no_difference(name, kind, tmp_path):
    path = save_map(tmp_path, room(), name)
    expected = load_world(path).segments
    if kind == "I;16" and not name.endswith("bmp"):
        Image.fromarray(room().astype(np.uint16) * 257).save(tmp_path / name)
    elif not name.endswith("pgm") and kind != "I;16":
        Image.fromarray(room().astype(np.uint8)).convert(kind).save(tmp_path / name)
    assert np.array_equal(load_world(path).segments, expected)


def test_a_bare_picture_is_read_with_a_resolution(tmp_path):
    described = load_world(yaml := save_map(tmp_path, room(), "plan.png"))
    yaml.rename(tmp_path / "plan.yaml")
    with pytest.raises(WorldError, match=r"plan\.png: .*; give plan\.yaml next to it, or --res"):
        load_world(tmp_path / "plan.png")
    (tmp_path / "plan.yaml").unlink()
    world = load_world(tmp_path / "plan.png", resolution=0.1)
    assert np.array_equal(world.segments, described.segments)
    assert world.free is None
    with pytest.raises(
        WorldError, match=r"plan\.png: .*--resolution.*plan\.yaml.*resolution: 0\.05"
    ):
        load_world(tmp_path / "plan.png")
    with pytest.raises(WorldError, match=r"resolution -1\.0: expected a finite number"):
        load_world(tmp_path / "plan.png", resolution=-1.0)
    with pytest.raises(WorldError, match=r"resolution is for .png, .pgm, .* files alone"):
        load_world("city", resolution=0.1)


@settings(max_examples=40)
@given(
    arrays(np.float64, 4, elements=st.floats(-6.0, 6.0)).filter(
        lambda ends: np.hypot(*(ends[2:] - ends[:2])) > 0.5
    )
)
def test_a_wall_written_to_a_map_comes_back_as_one_within_a_cell(tmp_path_factory, ends):
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    save_world(World([ends]), path)
    back = load_world(path).segments
    assert len(back) == 1
    along = (ends[2:] - ends[:2]) / np.hypot(*(ends[2:] - ends[:2]))
    off = back.reshape(2, 2) - ends[:2]
    # Sideways half a cell for the drawing and half a cell for the fit; an end is in its cell.
    assert np.abs(off @ [-along[1], along[0]]).max() <= 0.05
    there, here = shapely.LineString(ends.reshape(2, 2)), shapely.LineString(back.reshape(2, 2))
    assert shapely.hausdorff_distance(there, here) <= 0.075


def test_a_world_of_a_country_becomes_a_coarse_map_and_not_a_huge_one(tmp_path):
    path = tmp_path / "map.yaml"
    save_world(World([[0.0, 0.0, 50_000.0, 30_000.0]]), path)
    assert (tmp_path / "map.pgm").stat().st_size < 40e6
    with pytest.raises(OSError, match="choose larger"):
        write_ros_map(World([[0.0, 0.0, 50_000.0, 30_000.0]]), path, resolution=0.05)


@pytest.mark.parametrize("free_thresh", [0.196, 0.25])
def test_what_a_map_knows_to_be_free_is_kept(free_thresh, tmp_path):
    pixels = np.where(room() == 0, 0, 205)
    pixels[12:20, 12:20] = 254
    world = load_world(save_map(tmp_path, pixels, free_thresh=free_thresh, origin=[5.0, 1.0, 0.5]))
    assert world.free is not None and world.free.cells.sum() == 64
    turn = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    places = np.array([[1.5, 3.5], [1.1, 3.5], [3.0, 2.0], [-1.0, 1.0]]) @ turn + [5.0, 1.0]
    assert world.free.contain(places).tolist() == [True, False, False, False]
    again = pickle.loads(pickle.dumps(world)).scaled(2.0)
    assert again.free is not None and again.free.contain(2.0 * places).tolist()[:2] == [True, False]


def test_a_map_that_is_written_keeps_what_is_free(tmp_path):
    pixels = room()
    pixels[:, 50:] = 205
    world = load_world(save_map(tmp_path, pixels))
    write_ros_map(world, tmp_path / "again.yaml", resolution=0.1)
    again = load_world(tmp_path / "again.yaml")
    assert world.free is not None and again.free is not None
    places = np.random.default_rng(0).uniform([1.2, 1.2], [5.6, 3.8], (200, 2))
    places = places[np.abs(places[:, 0] - 4.95) > 0.2]
    assert (again.free.contain(places) == world.free.contain(places)).all()


def test_a_key_that_stands_twice_is_named(tmp_path):
    path = save_map(tmp_path, room())
    path.write_text(path.read_text() + "resolution: 0.5\n")
    with pytest.raises(WorldError, match=r"map\.yaml: line 5: .*'resolution' stands in line 2"):
        load_world(path)


@pytest.mark.parametrize("size", ["59 50", "60 49", "61 50"])
def test_a_picture_of_another_size_than_its_header_is_refused(size, tmp_path):
    path = save_map(tmp_path, room(), "map.pgm")
    data = (tmp_path / "map.pgm").read_bytes()
    (tmp_path / "map.pgm").write_bytes(data.replace(b"60 50", size.encode()))
    with pytest.raises(WorldError, match=r"map\.pgm"):
        load_world(path)
    (tmp_path / "map.pgm").write_bytes(data + b"\n")
    assert len(load_world(path).segments) == 4


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("gone", [[0], [1], [0, 2]])
def test_the_walls_that_stay_keep_their_lengths_when_others_are_erased(gone, yaw, tmp_path):
    path = save_map(tmp_path, room(), origin=[-1.25, 0.7, yaw])
    before = load_world(path).segments
    after = np.delete(before, gone, axis=0)
    rewrite_map(path, before, after, tmp_path / "new.yaml")
    found = load_world(tmp_path / "new.yaml").segments
    assert sorted(lengths(found)) == pytest.approx(sorted(lengths(after)))
