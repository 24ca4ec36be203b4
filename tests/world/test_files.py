import json

import numpy as np
import pytest

from lrf3d.base.errors import InputError, Lrf3dNote, OutputError, WorldError
from lrf3d.world import Material, World, load_world, save_world, world_names
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells


def same_bits(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


NAMES = ["", "Lab 3", 'a"b\\c', "\u2028", "Straße\n7", "\x7f\t", "[[object]]", "'''", "名"]
MATERIALS = [
    None, "mirror", "dark cloth", Material("frosted", diffuse=0.1, transmission=1 / 3),
    Material("glass", index=1.7, lobe_deg=0.1), Material('tab\t"foil"', retro=1e-3),
]  # fmt: skip


def coordinates(rng, *shape):
    """Any within the bounds, on whole metres, negative zeros, and those of a land's grid."""
    anywhere, grid = rng.uniform(-1e9, 1e9, shape), rng.uniform(447e3, 448e3, shape)
    kinds = [anywhere, rng.integers(-3, 4, shape) * 1.0, np.full(shape, -0.0), grid]
    return np.choose(rng.integers(0, 4, shape), kinds)


def some_world(seed):
    """Walls of which many join end to end, rings and lines and lone ones, with all that is kept."""
    rng = np.random.default_rng(seed)
    chains = []
    for count in rng.integers(2, 7, rng.integers(1, 6)):
        ends = coordinates(rng, count, 2)
        chains.append(np.hstack([ends, np.roll(ends, -1, axis=0)])[: count - rng.integers(2)])
    segments = np.concatenate([*chains, [[0.0, 0.0, 1.0, 0.0]]])
    segments = segments[(segments[:, :2] != segments[:, 2:]).any(axis=1)]
    objects = rng.integers(0, 5, len(segments))
    objects = np.sort(objects) if rng.random() < 0.5 else objects
    heights = rng.choice([2.5, 7.1, rng.uniform(0.1, 300.0)], len(segments))
    numbers = objects.max() + 1
    colours = rng.choice([rng.random(), rng.integers(256) / 255], (numbers, 3))
    colours[rng.random(numbers) < 0.3] = np.nan
    x, y = coordinates(rng, 2)
    cells = FreeCells(rng.random(rng.integers(1, 9, 2)) < 0.5, rng.uniform(0.01, 2.0), (x, y, 0.3))
    cameras = [FixedCamera(f"c{n}", (x, y, 4.0), (x, y, 1e9), rng.uniform(1, 160)) for n in NAMES]
    return World(
        segments, objects, heights, rng.choice(NAMES),
        object_names=tuple(rng.choice(NAMES, numbers).tolist()) if rng.random() < 0.5 else (),
        colours=colours,
        cameras=tuple(cameras[: rng.integers(3)]),
        free=rng.choice([None, cells]),
        materials=rng.choice([*MATERIALS], numbers).tolist() if rng.random() < 0.5 else [],
        place=(rng.uniform(-180, 180), rng.uniform(-90, 90)) if rng.random() < 0.5 else None,
    )  # fmt: skip


@pytest.mark.parametrize("ending", [".toml", ".geojson"])
def test_a_world_comes_back_from_a_file_as_it_was(ending, tmp_path):
    path = tmp_path / f"world{ending}"
    for seed in range(80):
        world = some_world(seed)
        save_world(world, path)
        back = load_world(path)
        assert same_bits(back.segments, world.segments)
        assert same_bits(back.heights, world.heights)
        assert (back.objects == world.objects).all()
        assert np.array_equal(back.colours, world.colours, equal_nan=True)
        for name in ("object_names", "materials", "name", "cameras", "place"):
            assert getattr(back, name) == getattr(world, name), (seed, name)
        assert (back.free is None) == (world.free is None)
        if world.free is not None:
            assert (back.free.cells == world.free.cells).all()
            assert back.free.resolution == world.free.resolution
            assert back.free.origin == world.free.origin


GRID = {"resolution": 0.5, "origin": [0.0, 0.0, 0.0], "rows": [[0, 2, 1], [1, 2]]}


@pytest.mark.parametrize("ending", [".toml", ".geojson"])
def test_free_cells_that_cannot_be_are_one_clear_error(ending, tmp_path):
    path = tmp_path / f"world{ending}"
    save_world(World([[0, 0, 1, 0]]), path)
    whole = path.read_text()
    wrong = [{"rows": rows} for rows in ([[0, 2, 1], [1, 1]], [[0, -2, 5]], [[10**30]], [["a"]])]
    for changes in [*wrong, {"resolution": 0.0}, {"origin": [0.0, 0.0]}, {"colour": "red"}]:
        grid = {**GRID, **changes}
        if ending == ".toml":
            lines = "".join(f"{k} = {json.dumps(v)}\n" for k, v in grid.items())
            path.write_text(f"{whole}\n[free]\n{lines}")
        else:
            path.write_text(json.dumps({**json.loads(whole), "free": grid}))
        with pytest.raises(WorldError, match=rf"world{ending}.*free.*rows") as caught:
            load_world(path)
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


@pytest.mark.parametrize(
    ("name", "there", "message"),
    [
        ("citty", False, r"citty.*did you mean 'city'.*corridor.*paper_room"),
        ("none.toml", False, r"none\.toml: no such file"),
        ("none.geojson", False, r"none\.geojson: no such file"),
        ("plan.xyz", True, r"plan\.xyz: unknown ending.*\.toml.*\.geojson"),
        ("drive.log.gz", True, r"drive\.log\.gz: .*logs are read by `lrf3d slam`"),
    ],
)
def test_what_is_no_world_is_named_with_what_is(name, there, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if there:
        (tmp_path / name).touch()
    with pytest.raises(WorldError, match=message):
        load_world(name)


def test_a_world_is_not_written_with_an_unknown_ending(tmp_path):
    with pytest.raises(OutputError, match=r"plan\.xyz: unknown ending.*\.toml, \.geojson"):
        save_world(World([[0, 0, 1, 0]]), tmp_path / "plan.xyz")


TWINS = {
    "segments": [[0, 0, 4, 0], [4, 0, 4, 3]],
    "objects": [0, 1],
    "materials": [Material("own", diffuse=0.1), Material("own", diffuse=0.2)],
}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"objects": [np.nan]}, "wall 0: object nan"),
        ({"objects": [0.5]}, "wall 0: object 0.5, expected whole"),
        ({"heights": [0.0]}, "wall 0: height 0.0, expected more than 0"),
        ({"heights": "tall"}, "heights: expected numbers"),
        ({"heights": 5}, r"heights of shape \(\): expected"),
        ({"object_names": ("a", "b")}, "2 names for 1 objects"),
        ({"object_names": [5]}, "object_names: expected str, found 5"),
        ({"object_names": "a"}, "object_names: expected a list"),
        ({"colours": [[0, 0, 0], [1, 1, 1]]}, r"colours of shape \(2, 3\): expected \(1, 3\)"),
        ({"colours": [[0, 0, 255]]}, "from 0 to 1"),
        ({"place": (np.nan, np.nan)}, "place: expected longitude and latitude"),
        ({"free": "abc"}, "free: expected .*FreeCells"),
        ({"cameras": ["abc"]}, "cameras: expected FixedCamera"),
        ({"cameras": 2 * [FixedCamera("c", (0, 0, 1), (1, 1, 1))]}, "two of the name 'c'"),
        ({"materials": [5]}, "materials: expected str"),
        ({"materials": ["glass", "brick"]}, "2 materials for 1 objects"),
        ({"materials": ["glas"]}, r"there is no 'glas'; did you mean 'glass'\?"),
        (TWINS, "materials: two of the name 'own'"),
        ({"name": 5}, "name: expected str"),
        ({"segments": [[0, 0, 1.1e9, 0]]}, "wall 0: ends .*at most 1e"),
        ({"segments": [[0, 0, 0, 0]]}, "wall 0: ends .* two different points"),
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
        (lambda: FixedCamera(**{**CAMERA, "target": (1, 1, np.nan)}), "camera 'c': target"),
        (lambda: FixedCamera(**CAMERA, field_deg="wide"), "camera 'c': field_deg"),
        (lambda: FreeCells(**{**GRID_OF, "cells": []}), "free cells of shape"),
        (lambda: FreeCells(**{**GRID_OF, "resolution": "fine"}), "free cells: resolution 'fine'"),
        (lambda: FreeCells(**GRID_OF, origin=(np.nan, 0.0, 0.0)), "pose"),
        (lambda: World([[0, 0, 1, 0]]).scaled(np.nan), "scale nan"),
    ],
)
def test_what_no_file_could_hold_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_world_with_the_name_of_any_file_can_be_saved(tmp_path):
    save_world(World([[0, 0, 1, 0]], name="a\udcff"), tmp_path / "w.toml")
    assert load_world(tmp_path / "w.toml").name == "a?"


def test_a_layer_of_which_only_a_part_is_left_out_is_not_reported(tmp_path):
    stroke = '<path d="M{0} 0v4" stroke="#000" stroke-width=".01"/>'
    text = f'<g id="text_1">{stroke.format(1)}{stroke.format(2)}</g>'
    head = '<svg xmlns="http://www.w3.org/2000/svg" width="9m" height="9m" viewBox="0 0 9 9">'
    whole = f'{head}<g id="figure_1">{text}{stroke.format(5)}</g></svg>'
    (tmp_path / "a.svg").write_text(whole)
    with pytest.warns(Lrf3dNote, match="left out: 2 annotation marks$|marks;") as notes:
        assert len(load_world(tmp_path / "a.svg", scale=1.0).segments) == 1
    assert not any("figure_1" in str(note.message) for note in notes)
