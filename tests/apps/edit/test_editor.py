"""The editor without its page: what it keeps, sends and writes."""

import gzip
import json

import numpy as np
import pytest
from PIL import Image

from lrf3d import InputError, PlanarCaster, World, load_scenario, load_world, save_world
from lrf3d.apps.edit.editor import Editor
from lrf3d.plans.edits import read_edits
from lrf3d.world.free_cells import FreeCells

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")

KINDS = {"f4": np.float32, "u1": np.uint8, "u2": np.uint16}
ROOMS = {
    "wall": [
        {"points": [[0, 0], [8, 0], [8, 5], [0, 5]], "closed": True},
        {"points": [[4, 0], [4, 5]], "height": 2.0, "material": "mirror"},
    ],
    "doorway": [{"at": [4, 2.5], "width": 1.0}],
    "robot": {"start": [1, 1, 0], "route": [[7, 4]]},
}


def unpacked(message):
    size = int.from_bytes(message[:4], "little")
    header = json.loads(message[4 : 4 + size])
    arrays = {
        name: np.frombuffer(message, KINDS[kind], count, 4 + size + first)
        for name, (kind, first, count) in header["arrays"].items()
    }
    return header, arrays


def test_a_world_drawn_on_an_empty_sheet_is_kept_at_each_step_and_written(tmp_path):
    path = tmp_path / "new.toml"
    Editor(path).decide(ROOMS)
    # Another editor goes on where a killed one was.
    editor = Editor(path)
    header, arrays = unpacked(editor.message())
    assert header["edits"]["doorway"] == ROOMS["doorway"] and len(arrays["kinds"]) == 6
    header, arrays = unpacked(editor.rooms())
    assert [room["why"] for room in header["rooms"]] == ["", ""]
    assert set(arrays["cells"].tolist()) == {0, 1}
    assert unpacked(editor.route())[0]["route"][-1] == pytest.approx([7, 4], abs=0.1)
    assert editor.old_world() == "new.toml is not written yet: Ctrl+S"
    assert editor.save_world() == path and not editor.old_world()
    scenario = load_scenario(path)
    assert scenario.start[:2] == (1.0, 1.0) and scenario.goals.tolist() == [[7, 4]]
    assert np.array_equal(scenario.world.segments, editor.scenario.world.segments)
    # It stays one that was drawn: nothing is decided twice.
    assert Editor(path).empty and len(Editor(path).plan.segments) == 6


def test_a_sheet_in_metres_is_not_asked_for_its_scale(tmp_path):
    Editor(tmp_path / "new.toml").decide(ROOMS)
    header, _ = unpacked(Editor(tmp_path / "new.toml").message())
    assert header["scaled"] and header["empty"] and header["suggestions"] == []


def test_goals_and_rooms_that_are_not_reached_are_named_with_the_reason(tmp_path):
    editor = Editor(tmp_path / "new.toml")
    narrow = {"doorway": [{"at": [4, 2.5], "width": 0.6}]}
    robot = {"start": [1, 1, 0], "radius": 0.35, "route": [[3, 4], [0.02, 2.5], [7, 4]]}
    editor.decide({**ROOMS, **narrow, "robot": robot, "obstacle": [{"route": [[3, 1]] * 2}]})
    header, _ = unpacked(editor.rooms())
    assert ["too narrow" in room["why"] for room in header["rooms"]] == [False, True]
    here, wall, beyond = header["goals"]
    assert (here, beyond) == ("", "no way leads there") and "stops 0.4 m short" in wall
    # The notes of the planner say nothing of it again, nor of rooms that were not asked for.
    assert unpacked(editor.route())[0]["notes"] == []
    # An obstacle whose way is one place stands.
    assert np.ptp(editor.scenario.obstacles[0].path.at([0, 9]), axis=0).max() == 0.0


def test_a_goal_where_a_map_shows_no_ground_is_named_with_the_reason(tmp_path):
    free = FreeCells(np.pad(np.ones((50, 40), bool), ((0, 0), (0, 40))), 0.1)
    walls = [[0, 0, 4, 0], [4, 0, 4, 5], [4, 5, 0, 5], [0, 5, 0, 0]]
    save_world(World(walls, free=free), tmp_path / "map.geojson")
    editor = Editor(tmp_path / "map.geojson")
    editor.decide({"robot": {"start": [1, 1, 0], "route": [[3, 4], [6, 3]]}})
    assert unpacked(editor.rooms())[0]["goals"] == ["", "the map does not show that ground"]


def test_rooms_around_an_open_one_with_the_robot_lack_a_wall(tmp_path):
    editor = Editor(tmp_path / "new.toml")
    closed = [[[x, 0], [x + 4, 0], [x + 4, 5], [x, 5]] for x in (4, 8)]
    walls = [{"points": points, "closed": True} for points in closed]
    doors = [{"at": [x, 2.3577], "width": 0.6} for x in (4, 8)]
    start = {"start": [1, 1, 0], "radius": 0.2}
    editor.decide({
        "wall": [*walls, {"points": [[4, 0], [0, 0], [0, 5]]}],
        "doorway": doors,
        "robot": start,
    })  # fmt: skip
    header, _ = unpacked(editor.rooms())
    assert {room["why"][:17] for room in header["rooms"]} == {"a wall is missing"}
    assert "2.0577]" in editor.save_world().read_text(), "to a tenth of a millimetre"


def test_furniture_in_the_way_is_no_narrow_door(tmp_path):
    editor = Editor(tmp_path / "new.toml")
    box = {"points": [[4.3, 1], [5, 1], [5, 4], [4.3, 4]], "closed": True, "height": 0.8}
    robot = {"start": [1, 1, 0], "radius": 0.35}
    editor.decide({**ROOMS, "wall": [*ROOMS["wall"], box], "robot": robot})
    header, _ = unpacked(editor.rooms())
    here, beyond = (room["why"] for room in header["rooms"])
    assert not here and beyond.startswith("furniture is in the way of the robot")


def test_a_low_box_stands_against_a_wall_that_stays(tmp_path):
    editor = Editor(tmp_path / "new.toml")
    box = {"points": [[0, 2], [1, 2], [1, 3], [0, 3]], "closed": True, "height": 0.8}
    editor.decide({**ROOMS, "wall": [*ROOMS["wall"], box]})
    parts = editor.plan.parts
    assert [0, 5, 0, 0] in parts.segments[parts.kinds == "wall"].tolist()
    assert (parts.kinds == "furniture").sum() == 4


def test_the_doors_of_a_picture_are_found_and_check_its_scale(tmp_path):
    cells = np.full((420, 620), 255, np.uint8)
    for x1, y1, x2, y2 in ((20, 20, 600, 400), (310, 20, 322, 400), (20, 200, 322, 212)):
        cells[y1 : y2 + 1, [x1, x2]] = cells[[y1, y2], x1 : x2 + 1] = 0
    # Two doors of 44 pixels, each between the ends of two walls.
    cells[260:304, 308:325] = cells[198:215, 120:164] = 255
    cells[[259, 304], 310:323] = cells[200:213, [119, 164]] = 0
    Image.fromarray(cells).save(tmp_path / "a.png")
    editor = Editor(tmp_path / "a.png")
    header, _ = unpacked(editor.message())
    assert len(header["gaps"]) == 2 and header["suggestions"][0]["metres"] == 0.9
    editor.decide({"scale": {"between": [[20, 200], [600, 200]], "metres": 10.0}})
    header, _ = unpacked(editor.message())
    ((_, factor),) = header["check"]["offers"]
    assert factor == pytest.approx(0.9 / (45 * 10.0 / 580), rel=0.05)


def test_the_beams_under_the_mouse_are_those_of_the_planar_caster_also_behind_mirrors(tmp_path):
    editor = Editor(tmp_path / "new.toml")
    editor.decide(ROOMS)
    _, arrays = unpacked(editor.scan([1.0, 1.0, 0.3]))
    beams = arrays["beams"].reshape(-1, 4).astype(float)
    scan = PlanarCaster(editor.scenario.world).cast(editor.scenario.lrf, (1.0, 1.0, 0.3))
    first = np.hypot(*(beams[:, :2] - [1, 1]).T)
    beyond = np.hypot(*(beams[:, 2:] - beams[:, :2]).T)
    assert first + beyond == pytest.approx(scan.ranges, abs=1e-5)
    assert (beyond > 0.5).sum() > 20, "some are mirrored"
    ends = beams[beyond > 0.5, 2:]
    off = np.minimum(ends, [8, 5] - ends).min(axis=1)
    assert off == pytest.approx(0.0, abs=1e-5), "and end at a wall of the other room's mirror image"


def test_a_second_editor_only_reads_and_a_wrong_decision_changes_nothing(tmp_path):
    path = tmp_path / "new.toml"
    editor = Editor(path)
    editor.decide(ROOMS)
    kept = editor.journal.read_bytes()
    with pytest.raises(InputError, match="only reads"):
        Editor(path, read_only=True).decide({})
    with pytest.raises(InputError, match="wall\\[0\\]"):
        editor.decide({"wall": [{"points": [[0, 0]]}]})
    assert editor.journal.read_bytes() == kept and len(editor.plan.segments) == 6


def test_a_ros_map_is_cleaned_and_drawn_on_in_its_own_cells(tmp_path):
    cells = np.full((60, 80), 254, np.uint8)
    cells[5:55, [5, 74]] = cells[[5, 54], 5:75] = 0
    cells[20:24, 30:34] = 0
    cells[:, 75:] = 205
    cells[40:43, 76:79] = 0
    Image.fromarray(cells).save(tmp_path / "map.pgm")
    described = "image: map.pgm\nresolution: 0.1\norigin: [-1.2345678901234567, 7e-1, 0]\n"
    described += "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    (tmp_path / "map.yaml").write_text(described)
    editor = Editor(tmp_path / "map.yaml")
    x, y = -1.2345678901234567, 0.7
    speck = [[x + 2.8, y + 3.4], [x + 3.6, y + 3.4], [x + 3.6, y + 4.2], [x + 2.8, y + 4.2]]
    outside = [[x + 7.5, y + 1.6], [x + 8.0, y + 1.6], [x + 8.0, y + 2.1], [x + 7.5, y + 2.1]]
    wall = [[x + 0.55, y + 2.05], [x + 3.05, y + 2.05]]
    editor.decide({
        "class": [{"select": {"inside": each}, "as": "nothing"} for each in (speck, outside)],
        "wall": [{"points": wall}],
    })  # fmt: skip
    assert editor.save_map().read_text() == described.replace("map.pgm", '"map_edited.pgm"')
    new = np.asarray(Image.open(tmp_path / "map_edited.pgm"))
    changed = np.argwhere(new != cells)
    assert (new[20:24, 30:34] == 254).all() and (new[40:43, 76:79] == 205).all()
    assert len(changed) == 16 + 9 + 25 and (new[39, 6:31] == 0).all()
    # Commands obey the decisions about the map, too.
    assert len(load_world(tmp_path / "map.yaml").segments) == len(editor.plan.segments)


def test_decisions_about_a_world_keep_its_objects_and_are_saved_next_to_it(tmp_path):
    path = tmp_path / "w.toml"
    walls = [[0, 0, 4, 0], [4, 0, 4, 3], [0, 5, 3, 5]]
    save_world(World(walls, [0, 0, 1], object_names=["house", "fence"]), path)
    editor = Editor(path)
    editor.decide({"class": [{"select": {"layer": "fence"}, "as": "glass"}]})
    saved = load_world(editor.save_world())
    assert saved.object_names == ("house", "fence") and saved.materials[1].name == "glass"
    assert load_world(path).materials == () and read_edits(editor.journal).source == "w.toml"


def test_a_packed_picture_has_its_sheet_and_a_damaged_document_is_one_line(written, tmp_path):
    cells = np.full((60, 80), 255, np.uint8)
    cells[5:55, [5, 74]] = cells[[5, 54], 5:75] = 0
    Image.fromarray(cells).save(tmp_path / "a.png")
    editor = Editor(written("b.png.gz", gzip.compress((tmp_path / "a.png").read_bytes())))
    assert editor.sheet.size == (80.0, 60.0) and editor.plan.unit == pytest.approx(12.0 / 80.0)
    damaged = written("c.pdf", b"%PDF-1.4 nothing")
    with pytest.raises(InputError, match=r"c\.pdf: damaged"):
        Editor(damaged)
