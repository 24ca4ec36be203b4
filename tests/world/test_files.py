import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lrf3d.errors import InputError, OutputError, WorldError
from lrf3d.world import Material, World, load_world, save_world, world_names
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells


def same_bits(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


coordinates = st.one_of(
    st.floats(-1e9, 1e9, allow_subnormal=False),
    st.integers(-3, 3).map(float),
    st.just(-0.0),
    st.floats(447_000.0, 448_000.0),
)
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


places = st.tuples(coordinates, coordinates, st.floats(-10.0, 50.0))
cameras = st.lists(
    st.builds(
        lambda name, place, field: FixedCamera(f"c{name}", place, (*place[:2], 1e9), field),
        names,
        places,
        st.floats(0.1, 160.0),
    ),
    max_size=2,
    unique_by=lambda camera: camera.name,
).map(tuple)


@st.composite
def chains(draw):
    """Walls of which many join end to end, rings and lines and lone ones."""
    points = draw(arrays(np.float64, (draw(st.integers(2, 6)), 2), elements=coordinates))
    ends = np.vstack([points, points[:1]]) if draw(st.booleans()) else points
    segments = np.hstack([ends[:-1], ends[1:]])
    return segments[(segments[:, :2] != segments[:, 2:]).any(axis=1)]


@st.composite
def free_cells(draw):
    shape = draw(st.tuples(st.integers(1, 5), st.integers(1, 9)))
    origin = draw(st.tuples(coordinates, coordinates, st.floats(-3.0, 3.0)))
    return FreeCells(draw(arrays(np.bool_, shape)), draw(st.floats(0.01, 2.0)), origin)


def materials(count):
    """Built-in materials, own ones of unique names, and none, for so many objects."""
    own = [
        Material("frosted", diffuse=0.1, transmission=1 / 3),
        Material("glass", index=1.7, lobe_deg=0.1),
        Material('tab\t"foil"', retro=1e-3),
    ]
    some = st.sampled_from([None, "mirror", "dark cloth", *own])
    return st.just([]) | st.lists(some, min_size=count, max_size=count)


@st.composite
def worlds(draw):
    segments = np.concatenate(draw(st.lists(chains(), min_size=1, max_size=5)))
    keep = np.hypot(*(segments[:, 2:] - segments[:, :2]).T) > 0.0
    segments = segments[keep] if keep.any() else np.array([[0.0, 0.0, 1.0, 0.0]])
    count = len(segments)
    objects = draw(arrays(np.int64, count, elements=st.integers(0, 4)))
    if draw(st.booleans()):
        objects = np.sort(objects)
    heights = draw(
        st.one_of(
            st.just(np.full(count, 2.5)),
            arrays(np.float64, count, elements=st.floats(0.1, 300.0)),
        )
    )
    numbers = int(objects.max()) + 1
    colours = draw(
        arrays(
            np.float64,
            (numbers, 3),
            elements=st.one_of(st.floats(0.0, 1.0), st.integers(0, 255).map(lambda i: i / 255)),
        )
    )
    colours[draw(arrays(np.bool_, numbers))] = np.nan
    called = draw(st.lists(names, min_size=numbers, max_size=numbers))
    return World(
        segments,
        objects,
        heights,
        draw(names),
        object_names=tuple(called) if any(called) else (),
        colours=colours,
        cameras=draw(cameras),
        free=draw(st.none() | free_cells()),
        materials=draw(materials(numbers)),
        place=draw(st.none() | st.tuples(st.floats(-180.0, 180.0), st.floats(-90.0, 90.0))),
    )


@pytest.mark.parametrize("ending", [".toml", ".geojson"])
def test_a_world_comes_back_from_a_file_as_it_was(ending, tmp_path_factory):
    path = tmp_path_factory.mktemp("worlds") / f"world{ending}"

    @settings(max_examples=80, deadline=None)
    @given(worlds())
    def check(world):
        save_world(world, path)
        back = load_world(path)
        assert same_bits(back.segments, world.segments)
        assert same_bits(back.heights, world.heights)
        assert (back.objects == world.objects).all()
        assert np.array_equal(back.colours, world.colours, equal_nan=True)
        assert back.object_names == world.object_names
        assert back.materials == world.materials
        assert back.name == world.name
        assert back.cameras == world.cameras
        assert back.place == world.place
        assert (back.free is None) == (world.free is None)
        if world.free is not None:
            assert (back.free.cells == world.free.cells).all()
            assert back.free.resolution == world.free.resolution
            assert back.free.origin == world.free.origin

    check()


GRID = {"resolution": 0.5, "origin": [0.0, 0.0, 0.0], "rows": [[0, 2, 1], [1, 2]]}


@pytest.mark.parametrize("ending", [".toml", ".geojson"])
@pytest.mark.parametrize(
    "changes",
    [
        {"rows": [[0, 2, 1], [1, 1]]},
        {"rows": [[0, -2, 5]]},
        {"rows": [[10**30]]},
        {"rows": [["a"]]},
        {"resolution": 0.0},
        {"origin": [0.0, 0.0]},
        {"colour": "red"},
    ],
)
def test_free_cells_that_cannot_be_are_one_clear_error(ending, changes, tmp_path):
    grid = {**GRID, **changes}
    save_world(World([[0, 0, 1, 0]]), tmp_path / f"world{ending}")
    text = (tmp_path / f"world{ending}").read_text()
    if ending == ".toml":
        text += "\n[free]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in grid.items())
    else:
        text = json.dumps({**json.loads(text), "free": grid})
    (tmp_path / f"world{ending}").write_text(text)
    with pytest.raises(WorldError, match=rf"world{ending}.*free.*rows") as caught:
        load_world(tmp_path / f"world{ending}")
    assert "\n" not in str(caught.value)


def test_a_ring_is_written_as_one_closed_list_of_points(tmp_path):
    square = [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]]
    save_world(World(square), tmp_path / "square.toml")
    text = (tmp_path / "square.toml").read_text()
    assert "points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]\nclosed = true" in text


def test_every_built_in_world_can_be_read_by_its_name():
    assert {"city", "corridor", "paper_room"} <= set(world_names())
    for name in world_names():
        assert len(load_world(name).segments) > 0
        assert load_world(name).name == name


def test_an_unknown_world_is_told_the_worlds_there_are():
    with pytest.raises(WorldError, match=r"citty.*did you mean 'city'.*corridor.*paper_room"):
        load_world("citty")


def test_an_unknown_ending_is_told_the_endings_there_are(tmp_path):
    (tmp_path / "plan.xyz").touch()
    with pytest.raises(WorldError, match=r"plan\.xyz: unknown ending.*\.toml.*\.geojson"):
        load_world(tmp_path / "plan.xyz")
    with pytest.raises(OutputError, match=r"plan\.xyz: unknown ending.*\.toml, \.geojson"):
        save_world(World([[0, 0, 1, 0]]), tmp_path / "plan.xyz")


@pytest.mark.parametrize("name", ["none.toml", "none.geojson"])
def test_a_file_that_is_not_there_is_named(name, tmp_path):
    with pytest.raises(WorldError, match=rf"{name}: no such file"):
        load_world(tmp_path / name)


def test_a_file_that_is_no_text_is_named_with_the_line(tmp_path):
    (tmp_path / "bad.toml").write_bytes(b'name = "a"\nx = "\xff"\n')
    with pytest.raises(WorldError, match=r"^[^ ]*bad\.toml:2: not a text file"):
        load_world(tmp_path / "bad.toml")


def test_reading_a_world_leaves_heavy_libraries_alone():
    import subprocess
    import sys

    code = (
        "import sys, lrf3d; lrf3d.load_scenario('city');"
        "print([m for m in ('shapely', 'scipy', 'trimesh', 'numba') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"objects": [np.nan]}, "wall 0: object nan"),
        ({"objects": [0.5]}, "wall 0: object 0.5, expected whole"),
        ({"heights": [0.0]}, "wall 0: height 0.0, expected more than 0"),
        ({"heights": [np.nan]}, "wall 0: height nan, expected more than 0"),
        ({"heights": "tall"}, "heights: expected numbers"),
        ({"heights": 5}, r"heights of shape \(\): expected"),
        ({"object_names": ("a", "b")}, "2 names for 1 objects"),
        ({"object_names": "a"}, "object_names: expected a list"),
        ({"object_names": [5]}, "object_names: expected str, found 5"),
        ({"colours": [[0, 0, 0], [1, 1, 1]]}, r"colours of shape \(2, 3\): expected \(1, 3\)"),
        ({"colours": [[0, 0, 255]]}, "from 0 to 1"),
        ({"colours": [[0, 0, np.nan]]}, "three NaN"),
        ({"place": (np.nan, np.nan)}, "place: expected longitude and latitude"),
        ({"place": "ab"}, "place: expected"),
        ({"free": "abc"}, "free: expected .*FreeCells"),
        ({"cameras": ["abc"]}, "cameras: expected FixedCamera"),
        ({"cameras": 2 * [FixedCamera("c", (0, 0, 1), (1, 1, 1))]}, "two of the name 'c'"),
        ({"materials": 5}, "materials: expected a list"),
        ({"materials": [5]}, "materials: expected str"),
        ({"name": 5}, "name: expected str"),
        ({"segments": [[0, 0, 1.1e9, 0]]}, "wall 0: ends .*at most 1e"),
        ({"segments": [[0, 0, 0, 0]]}, "wall 0: ends .* two different points"),
        ({"segments": "walls"}, "segments: expected numbers"),
    ],
)
def test_a_world_refuses_what_does_not_fit(arguments, message):
    with pytest.raises(WorldError, match=message) as caught:
        World(**{"segments": [[0, 0, 1, 0]], **arguments})
    assert "\n" not in str(caught.value)


CAMERA = {"name": "c", "position": (0, 0, 1), "target": (1, 1, 1)}
GRID_OF = {"cells": np.ones((2, 2)), "resolution": 0.1}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FixedCamera(**{**CAMERA, "position": (0, 0, "z")}), "camera 'c': position"),
        (lambda: FixedCamera(**{**CAMERA, "position": (0, 0)}), "camera 'c': position"),
        (lambda: FixedCamera(**{**CAMERA, "position": 5}), "camera 'c': position"),
        (lambda: FixedCamera(**{**CAMERA, "position": (0, 0, 1e300)}), "camera 'c': position"),
        (lambda: FixedCamera(**{**CAMERA, "target": (1, 1, np.nan)}), "camera 'c': target"),
        (lambda: FixedCamera(**CAMERA, field_deg="wide"), "camera 'c': field_deg"),
        (lambda: FreeCells(**{**GRID_OF, "cells": []}), "free cells of shape"),
        (lambda: FreeCells(**{**GRID_OF, "cells": "abc"}), "free cells: expected numbers"),
        (lambda: FreeCells(**{**GRID_OF, "resolution": "fine"}), "free cells of 'fine' m"),
        (lambda: FreeCells(**GRID_OF, origin=(np.nan, 0.0, 0.0)), "pose"),
        (lambda: World([[0, 0, 1, 0]]).scaled("a"), "scale 'a'"),
        (lambda: World([[0, 0, 1, 0]]).scaled(np.nan), "scale nan"),
        (lambda: World([[0, 0, 1, 0]]).scaled(1e300), "scale 1e"),
    ],
)
def test_what_no_file_could_hold_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_world_with_the_name_of_any_file_can_be_saved(tmp_path):
    save_world(World([[0, 0, 1, 0]], name="a\udcff"), tmp_path / "w.toml")
    assert load_world(tmp_path / "w.toml").name == "a?"
