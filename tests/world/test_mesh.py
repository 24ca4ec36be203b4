import warnings

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.world import Material, World, load_world, save_world

FAR = np.array([85_000.0, 447_500.0])


def ordered(segments):
    """Segments with their ends, and themselves, in an order that rounding does not change."""
    ends = np.round(segments, 3).reshape(-1, 2, 2)
    turned = (ends[:, 0, 0] > ends[:, 1, 0]) | (
        (ends[:, 0, 0] == ends[:, 1, 0]) & (ends[:, 0, 1] > ends[:, 1, 1])
    )
    ends = np.where(turned[:, None, None], ends[:, ::-1], ends).reshape(-1, 4)
    return ends[np.lexsort(ends.T)]


@st.composite
def towns(draw):
    """Houses of whole centimetres, apart from each other, of names, colours and heights."""
    count = draw(st.integers(1, 5))
    segments, heights = [], []
    for place in range(count):
        size = [draw(st.integers(100, 900)) / 100.0 for _ in range(2)]
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size + [12.0 * place, 0.0]
        segments.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
        heights += [draw(st.integers(6, 200)) / 8.0] * 4
    shift = FAR if draw(st.booleans()) else np.zeros(2)
    named = draw(st.booleans())
    return World(
        np.concatenate(segments) + np.tile(shift, 2),
        np.repeat(np.arange(count), 4),
        heights,
        object_names=tuple(f"house {n}" for n in range(count)) if named else (),
        colours=np.arange(3 * count).reshape(count, 3) * 5 / 255.0,
        materials=draw(
            st.just([])
            | st.lists(
                st.sampled_from(["glass", Material("foil", retro=50.0), None]),
                min_size=count,
                max_size=count,
            )
        ),
    )


def test_a_world_comes_back_from_a_glb_as_float32_has_it(tmp_path_factory):
    path = tmp_path_factory.mktemp("worlds") / "town.glb"

    @settings(max_examples=25)
    @given(towns())
    def check(world):
        save_world(world, path)
        back = load_world(path)
        assert ordered(back.segments) == pytest.approx(ordered(world.segments), abs=1.1e-3)
        for number in range(world.object_count):
            own, other = world.objects == number, back.objects == number
            assert ordered(back.segments[other]) == pytest.approx(
                ordered(world.segments[own]), abs=1.1e-3
            )
            assert (back.heights[other] == world.heights[own][0]).all()
        assert back.colours == pytest.approx(world.colours, abs=1 / 255)
        assert back.materials == world.materials
        if world.object_names:
            assert back.object_names == world.object_names

    check()


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "stl", "glb"])
def test_a_box_is_cut_into_four_walls_whatever_the_format(kind, tmp_path):
    box = trimesh.creation.box((4.0, 3.0, 2.0))
    box.apply_translation([1.0, 2.0, 1.0])
    if kind == "glb":
        # In glTF y is up.
        box.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    box.export(tmp_path / f"box.{kind}")
    world = load_world(tmp_path / f"box.{kind}")
    assert len(world.segments) == 4 and world.object_count == 1
    assert world.bounds == pytest.approx(np.array([[-1.0, 0.5], [3.0, 3.5]]), abs=1e-6)
    assert world.heights == pytest.approx([2.0] * 4)


def test_vertices_of_obj_are_counted_back_from_the_face_that_does(written):
    corners = [f"v {x} {y} {z}\n" for y in (0, 3) for x, z in ((0, 0), (4, 0), (4, 2), (0, 2))]
    text = "".join([*corners[:4], "f 1/1 2 -2 -1 # wall\n", *corners[4:], "f -4 \\\n-3 -2 -1\n"])
    world = load_world(written("a.obj", text))
    assert sorted(world.segments.tolist()) == [[0, 0, 4, 0], [0, 3, 4, 3]]


def test_a_round_tower_keeps_its_sides(tmp_path):
    trimesh.creation.cylinder(3.0, 5.0, sections=24).export(tmp_path / "tower.stl")
    world = load_world(tmp_path / "tower.stl")
    assert len(world.segments) == 24
    assert np.hypot(*world.segments.reshape(-1, 2).T) == pytest.approx([3.0] * 48, abs=1e-5)


def test_a_mesh_about_z_0_stands_on_its_lowest_large_level_area(tmp_path):
    trimesh.creation.box((4.0, 3.0, 2.6)).export(tmp_path / "room.stl")
    with pytest.warns(Lrf3dNote, match=r"found at z = -1\.3 m"):
        assert load_world(tmp_path / "room.stl").heights == pytest.approx([2.6] * 4)


def test_a_mesh_in_single_precision_far_from_the_origin_is_doubted(tmp_path):
    box = trimesh.creation.box((4.0, 2.0, 2.0)).apply_translation([5e5, 5.4e6, 1.0])
    box.export(tmp_path / "far.stl")
    with pytest.warns(Lrf3dNote, match=r"corners in steps of 0\.5 m\?"):
        load_world(tmp_path / "far.stl")
    # Texts may hold whole metres.
    box.export(tmp_path / "text.stl", file_type="stl_ascii")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_world(tmp_path / "text.stl")


def test_a_mesh_that_ends_below_the_cut_says_where_it_is(tmp_path):
    trimesh.creation.box((4.0, 3.0, 0.2)).export(tmp_path / "slab.stl")
    with pytest.raises(
        WorldError, match=r"0\.5 m above .* z = 0\.1 m; .* from -0\.1 to 0\.1 m; --cut -0\.1"
    ):
        load_world(tmp_path / "slab.stl")


def test_pieces_of_one_wall_are_merged_and_parallel_ones_stay_apart(tmp_path):
    segments = [[0, 0, 1, 0], [1, 0, 2, 0], [3, 0, 4, 0], [0, 0.1, 4, 0.1], [4, 0.1, 4, 3]]
    save_world(World(segments), tmp_path / "pieces.glb")
    back = load_world(tmp_path / "pieces.glb")
    whole = [[0, 0, 2, 0], [3, 0, 4, 0], [0, 0.1, 4, 0.1], [4, 0.1, 4, 3]]
    assert ordered(back.segments) == pytest.approx(ordered(np.array(whole)), abs=1e-6)


@pytest.mark.parametrize(
    ("blocks", "top"),
    [
        # Lower and upper edge [m] of boxes one above the other.
        ([(0.0, 0.52), (0.52, 2.4)], 2.4),
        ([(0.0, 0.52), (0.52, 1.3), (1.3, 2.4)], 2.4),
        ([(0.0, 0.7), (1.9, 2.4)], 0.7),
    ],
)
def test_a_wall_is_as_high_as_what_stands_on_it(blocks, top, tmp_path):
    boxes = [
        trimesh.creation.box((4.0, 0.2, high - low)).apply_translation([0, 0, (low + high) / 2])
        for low, high in blocks
    ]
    path = tmp_path / "wall.stl"
    trimesh.util.concatenate(boxes).export(path)
    assert load_world(path).heights == pytest.approx(top)


@pytest.mark.parametrize(
    ("panels", "top"),
    [
        # Both ends [m], lower and upper edge [m] of panels; the first one is asked for.
        ([(0, 0, 4, 0, 0.0, 1.2), (0, 0, 4, 0, 1.7, 3.0)], 1.2),  # A window.
        ([(0, 0, 10, 0, 0.0, 1.0), (0, 0, 10, 0, 14.0, 60.0)], 1.0),  # A house on posts.
        ([(0, 0, 10, 0, 0.0, 1.0), (2.5, -5, 2.5, 5, 0.0, 3.0)], 1.0),  # A wall across a fence.
        ([(0, 0, 4, 0, 0.0, 1.2), (0, 0, 4, 0, 1.2, 3.0)], 3.0),
    ],
)
def test_no_wall_is_raised_through_air_or_by_what_crosses_it(panels, top, tmp_path):
    corners = [
        [[a, b, low], [c, d, low], [c, d, high], [a, b, high]] for a, b, c, d, low, high in panels
    ]
    parts = [trimesh.Trimesh(each, [[0, 1, 2], [0, 2, 3]], process=False) for each in corners]
    floor = trimesh.creation.box((40.0, 40.0, 0.0))
    path = tmp_path / "wall.stl"
    trimesh.util.concatenate([floor, *parts]).export(path)
    world = load_world(path)
    first = (world.segments[:, [1, 3]] == 0.0).all(axis=1)
    assert world.heights[first] == pytest.approx(top) and first.any()
