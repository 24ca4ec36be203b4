import pickle
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from lrf3d.errors import WorldError
from lrf3d.world import World, load_world, outlines, save_world
from lrf3d.world.grid_walls import walls_of_grid
from lrf3d.world.outlines import chains_of
from lrf3d.world.ros_map import write_ros_map
from lrf3d.world.straight_runs import cut_into_runs, is_straight


def save_map(folder: Path, pixels: np.ndarray, name: str = "map.png", **values: object) -> Path:
    Image.fromarray(pixels.astype(np.uint8)).save(folder / name)
    told = {"image": name, "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0, **values}
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in told.items()))
    return path


def room() -> np.ndarray:
    """A room of 40 by 30 cells, drawn from the top, with walls one cell thick."""
    pixels = np.full((50, 60), 254)
    pixels[[10, 39], 10:50] = 0
    pixels[10:40, [10, 49]] = 0
    return pixels


def width(points: np.ndarray) -> float:
    """Width of the narrowest strip that holds points, over all directions of pairs of them."""
    best = np.inf
    for one, other in product(points, points):
        delta = (other - one).astype(float)
        if delta.any():
            normal = np.array([-delta[1], delta[0]]) / np.hypot(*delta)
            best = min(best, np.ptp(points @ normal))
    return float(best) if np.isfinite(best) else 0.0


@pytest.mark.parametrize("kind", ["RGBA", "LA", "P"])
def test_the_opacity_of_a_picture_is_read_as_map_server_reads_it(kind: str, tmp_path: Path) -> None:
    # A post that shows through, within the room: its colour alone is dark enough.
    opaque, grey = np.full((50, 60), 255), room()
    grey[20:30, 20:30], opaque[20:30, 20:30] = 60, 100
    picture = Image.merge("LA", [Image.fromarray(p.astype(np.uint8)) for p in (grey, opaque)])
    if kind == "P":
        picture = picture.convert("RGBA").quantize(8)
    elif kind == "RGBA":
        picture = picture.convert("RGBA")
    path = save_map(tmp_path, grey)
    picture.save(tmp_path / "map.png")
    objects, text = {}, path.read_text()
    for mode in ("trinary", "scale"):
        path.write_text(text + f"mode: {mode}\n")
        objects[mode] = load_world(path).object_count
    # Opacity is one of four colours: (3 · 60 + 100) / 4 = 70 is still dark enough.
    assert objects == {"trinary": 2, "scale": 1}
    path.write_text(text + "mode: trinary\noccupied_thresh: 0.74\n")
    assert load_world(path).object_count == 1


points_of_grids = arrays(
    np.int64, st.tuples(st.integers(1, 9), st.just(2)), elements=st.integers(0, 8)
)


@settings(max_examples=150, deadline=None)
@given(points_of_grids)
def test_points_are_straight_when_the_strip_around_them_is_narrow(points: np.ndarray) -> None:
    exact = width(points)
    if abs(exact - 2.0) > 1e-9:
        assert is_straight(points, 2) == (exact < 2.0)


@settings(max_examples=60, deadline=None)
@given(points_of_grids)
def test_the_runs_of_a_chain_are_the_fewest_that_are_straight(points: np.ndarray) -> None:
    cuts = cut_into_runs(points, 2)
    bounds = [*cuts.tolist(), len(points)]
    assert all(is_straight(points[a:b], 2) for a, b in pairwise(bounds))
    fewest = [0] + [len(points)] * len(points)
    for end in range(1, len(points) + 1):
        fewest[end] = min(
            fewest[start] + 1 for start in range(end) if is_straight(points[start:end], 2)
        )
    assert len(cuts) == fewest[-1]


@settings(max_examples=100, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.integers(3, 300), st.booleans())
def test_a_straight_wall_drawn_cell_by_cell_is_one_segment(
    slope: float, shift: float, length: int, upright: bool
) -> None:
    column = np.arange(length)
    row = np.floor(slope * (column + 0.5) + shift).astype(int)
    cells = np.zeros((np.ptp(row) + 7, length + 6), dtype=bool)
    cells[row - row.min() + 3, column + 3] = True
    assert len(walls_of_grid(cells.T if upright else cells)) == 1


@settings(max_examples=60, deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(2, 14), st.integers(2, 14))))
def test_every_point_of_an_outline_is_within_half_a_cell_of_a_wall(cells: np.ndarray) -> None:
    chains, lone = chains_of(cells)
    points = np.concatenate([lone, *(chain.points for chain in chains)]) / 2.0
    walls = walls_of_grid(cells)
    assert bool(len(walls)) == bool(len(points))
    if len(points):
        lines = shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2)))
        assert shapely.distance(shapely.points(points), lines).max() <= 0.5 + 1e-6


@settings(max_examples=60, deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9))), st.integers(1, 40))
def test_the_bands_that_a_grid_is_looked_at_in_make_no_difference(
    cells: np.ndarray, band: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outlines, "BAND", 1 << 30)
        whole = walls_of_grid(cells)
        patch.setattr(outlines, "BAND", band)
        assert np.array_equal(walls_of_grid(cells), whole)


def test_a_room_is_four_walls_with_closed_corners(tmp_path: Path) -> None:
    world = load_world(save_map(tmp_path, room()))
    assert len(world.segments) == 4 and world.object_count == 1
    # Along the middles of the cells; the picture begins at the top, the map at the bottom.
    assert world.bounds == pytest.approx(np.array([[1.05, 1.05], [4.95, 3.95]]))
    ends = world.segments.reshape(-1, 2)
    assert len(np.unique(np.round(ends, 9), axis=0)) == 4


def test_a_thick_block_is_its_outline(tmp_path: Path) -> None:
    pixels = np.full((20, 30), 254)
    pixels[5:15, 5:25] = 0
    world = load_world(save_map(tmp_path, pixels))
    assert len(world.segments) == 4
    assert world.bounds == pytest.approx(np.array([[0.5, 0.5], [2.5, 1.5]]))


def test_origin_and_yaw_place_the_map(tmp_path: Path) -> None:
    plain = load_world(save_map(tmp_path, room()))
    turned = load_world(save_map(tmp_path, room(), origin=[3.0, -1.0, np.pi / 2]))
    x1, y1, x2, y2 = plain.segments.T
    expected = np.column_stack([3.0 - y1, -1.0 + x1, 3.0 - y2, -1.0 + x2])
    assert turned.segments == pytest.approx(expected)


def test_thresholds_and_negate_tell_what_is_occupied(tmp_path: Path) -> None:
    grey = np.where(room() == 0, 100, 254)  # occupied to (255 − 100) / 255 = 0.61
    assert len(load_world(save_map(tmp_path, grey, occupied_thresh=0.6)).segments) == 4
    with pytest.raises(ValueError, match="no wall: all cells are alike"):
        load_world(save_map(tmp_path, grey, occupied_thresh=0.65))
    assert len(load_world(save_map(tmp_path, 255 - room(), negate=1)).segments) == 4


@pytest.mark.parametrize("name", ["map.pgm", "map.png", "map.bmp"])
def test_colours_and_formats_make_no_difference(name: str, tmp_path: Path) -> None:
    grey = load_world(save_map(tmp_path, room(), name))
    assert len(grey.segments) == 4
    if not name.endswith("pgm"):
        coloured = load_world(save_map(tmp_path, np.dstack([room()] * 3), name))
        assert (coloured.segments == grey.segments).all()


@settings(max_examples=40, deadline=None)
@given(
    arrays(np.float64, 4, elements=st.floats(-6.0, 6.0)).filter(
        lambda ends: np.hypot(*(ends[2:] - ends[:2])) > 0.5
    )
)
def test_a_wall_written_to_a_map_comes_back_as_one_within_a_cell(
    tmp_path_factory: pytest.TempPathFactory, ends: np.ndarray
) -> None:
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


def test_a_map_is_written_in_the_resolution_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    write_ros_map(World([[0.0, 0.0, 4.0, 0.0]]), path, resolution=0.2)
    assert "resolution: 0.2\n" in path.read_text()
    with Image.open(tmp_path / "map.pgm") as image:
        assert image.size == (30, 10)


def test_a_world_of_a_country_becomes_a_coarse_map_and_not_a_huge_one(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    save_world(World([[0.0, 0.0, 50_000.0, 30_000.0]]), path)
    assert (tmp_path / "map.pgm").stat().st_size < 40e6
    with pytest.raises(OSError, match="choose larger"):
        write_ros_map(World([[0.0, 0.0, 50_000.0, 30_000.0]]), path, resolution=0.05)


@pytest.mark.parametrize("free_thresh", [0.196, 0.25])
def test_what_a_map_knows_to_be_free_is_kept(free_thresh: float, tmp_path: Path) -> None:
    pixels = np.where(room() == 0, 0, 205)
    pixels[12:20, 12:20] = 254
    world = load_world(save_map(tmp_path, pixels, free_thresh=free_thresh, origin=[5.0, 1.0, 0.5]))
    assert world.free is not None and world.free.cells.sum() == 64
    turn = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    places = np.array([[1.5, 3.5], [1.1, 3.5], [3.0, 2.0], [-1.0, 1.0]]) @ turn + [5.0, 1.0]
    assert world.free.contain(places).tolist() == [True, False, False, False]
    again = pickle.loads(pickle.dumps(world)).scaled(2.0)
    assert again.free is not None and again.free.contain(2.0 * places).tolist()[:2] == [True, False]


def test_a_map_that_is_written_keeps_what_is_free(tmp_path: Path) -> None:
    pixels = room()
    pixels[:, 50:] = 205
    world = load_world(save_map(tmp_path, pixels))
    write_ros_map(world, tmp_path / "again.yaml", resolution=0.1)
    again = load_world(tmp_path / "again.yaml")
    assert world.free is not None and again.free is not None
    places = np.random.default_rng(0).uniform([1.2, 1.2], [5.6, 3.8], (200, 2))
    places = places[np.abs(places[:, 0] - 4.95) > 0.2]
    assert (again.free.contain(places) == world.free.contain(places)).all()


def test_a_key_that_stands_twice_is_named(tmp_path: Path) -> None:
    path = save_map(tmp_path, room())
    path.write_text(path.read_text() + "resolution: 0.5\n")
    with pytest.raises(WorldError, match=r"map\.yaml:5: .*'resolution' stands in line 2"):
        load_world(path)


@pytest.mark.parametrize("size", ["59 50", "60 49", "61 50"])
def test_a_picture_of_another_size_than_its_header_is_refused(size: str, tmp_path: Path) -> None:
    path = save_map(tmp_path, room(), "map.pgm")
    data = (tmp_path / "map.pgm").read_bytes()
    (tmp_path / "map.pgm").write_bytes(data.replace(b"60 50", size.encode()))
    with pytest.raises(WorldError, match=r"map\.pgm"):
        load_world(path)
    (tmp_path / "map.pgm").write_bytes(data + b"\n")
    assert len(load_world(path).segments) == 4
