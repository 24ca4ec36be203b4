from pathlib import Path

import numpy as np
import pytest

from lrf3d.errors import WorldError
from lrf3d.world import load_world
from lrf3d.world.locate import lines_of_keys, nearest_line

HOUSE = """\
[[object]]
name = "house"
points = [[0, 0], [4, 0], [4, 3]]
closed = true
"""


GATE = """\
[[camera]]
name = "gate"
position = [1, 2, 3]
target = [9, 9, 1]
"""


def read(text: str, folder: Path):
    path = folder / "w.toml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def error_of(text: str, folder: Path) -> str:
    with pytest.raises(WorldError) as caught:
        read(text, folder)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix(f"{folder}/")


def test_objects_are_read_with_their_walls_heights_names_and_colours(tmp_path: Path) -> None:
    world = read(
        HOUSE + 'height = 7\ncolour = "#ff0080"\n[[object]]\npoints = [[9, 9], [9, 12]]\n', tmp_path
    )
    assert world.name == "w"
    assert world.segments.tolist() == [[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 0], [9, 9, 9, 12]]
    assert world.objects.tolist() == [0, 0, 0, 1]
    assert world.heights.tolist() == [7, 7, 7, 2.5]
    assert world.object_names == ("house", "")
    assert world.colours[0].tolist() == [1.0, 0.0, 128 / 255]
    assert np.isnan(world.colours[1]).all()


def test_an_object_may_be_made_of_several_lines(tmp_path: Path) -> None:
    text = "[[object]]\nlines = [[[0, 0], [1, 0]], [[5, 5], [6, 5], [6, 6]]]\nheight = [1, 2, 3]\n"
    world = read(text, tmp_path)
    assert world.segments.tolist() == [[0, 0, 1, 0], [5, 5, 6, 5], [6, 5, 6, 6]]
    assert world.objects.tolist() == [0, 0, 0]
    assert world.heights.tolist() == [1, 2, 3]


def test_objects_may_be_an_array_of_inline_tables(tmp_path: Path) -> None:
    text = "object = [\n  {points = [[0, 0], [1, 0]]},\n  {points = [[0, 0], [0, nan]]},\n]\n"
    assert error_of(text, tmp_path).startswith("w.toml:3: object[1].points[1]: expected a finite")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            HOUSE + "[robot]\nspede = 3\n",
            "w.toml:6: robot.spede: unknown key; did you mean 'speed'",
        ),
        (HOUSE + "hieght = 3\n", "w.toml:5: object[0].hieght: unknown key; did you mean 'height'"),
        ("roboot = 1\n" + HOUSE, "w.toml:1: roboot: unknown key; did you mean 'robot'"),
        ("qqq = 1\n" + HOUSE, "w.toml:1: qqq: unknown key; known are name, object, robot"),
        (
            HOUSE + "height = 'tall'\n",
            "w.toml:5: object[0].height: expected a number, found 'tall'",
        ),
        (HOUSE + "height = 0\n", "w.toml:5: object[0].height: expected a finite number above 0"),
        (HOUSE + "height = nan\n", "w.toml:5: object[0].height: expected a finite number above 0"),
        (HOUSE + "height = true\n", "w.toml:5: object[0].height: expected a number"),
        (HOUSE + "height = [1, 2]\n", "w.toml:5: object[0].height: 2 heights for 3 walls"),
        (HOUSE + "colour = 'mud'\n", "w.toml:5: object[0].colour: expected a colour such as"),
        (
            HOUSE + "material = 'glas'\n",
            "w.toml:5: object[0].material: there is no material 'glas'; did you mean 'glass'?",
        ),
        (HOUSE + "[[material]]\ndiffuse = 1\n", "w.toml:5: material[0]: expected a name"),
        (
            HOUSE + "[[material]]\nname = 'a'\ndiffuse = 2\n",
            "w.toml:7: material[0].diffuse: expected a finite number of at least 0 and at most 1",
        ),
        (
            HOUSE + "[[material]]\nname = 'a'\ndiffuse = 0.7\nspecular = 0.5\n",
            "w.toml:5: material[0]: material 'a': diffuse, specular and transmission are more",
        ),
        (HOUSE + 2 * "[[material]]\nname = 'a'\n", "w.toml:8: material[1].name: a second"),
        (HOUSE + "lines = []\n", "w.toml:1: object[0]: expected points"),
        ("[[object]]\nname = 'a'\n", "w.toml:1: object[0]: expected points"),
        ("[object]\nname = 'a'\n", "w.toml:1: object: expected at least one table [[object]]"),
        ("name = 'empty'\n", "w.toml:1: object: expected at least one table [[object]]"),
        ("", "w.toml:1: object: expected at least one table [[object]]"),
        ("robot = 3\n" + HOUSE, "w.toml:1: robot: expected a table [robot]"),
        ('"a\\nb" = 3\n' + HOUSE, "w.toml:1: 'a\\nb': unknown key"),
        ("name = 3\n" + HOUSE, "w.toml:1: name: expected a text in quotes, found 3"),
        (HOUSE + "[laser]\nbeams = 0\n", "w.toml:6: laser.beams: expected a whole number from 1"),
        (HOUSE + "[laser]\nbeams = 1.5\n", "w.toml:6: laser.beams: expected a whole number"),
        (HOUSE + "[noise]\nsigma = [0.1, -1]\n", "w.toml:6: noise.sigma[1]: expected a finite"),
        (HOUSE + "[noise]\nsigma = []\n", "w.toml:6: noise.sigma: expected a sigma or a list"),
        (HOUSE + "[mapper]\nmode = 'x'\n", "w.toml:6: mapper.mode: expected one of paper, robust"),
        (HOUSE + "[camera]\nview = 'x'\n", "w.toml:5: camera: expected tables [[camera]]"),
        (HOUSE + "[[camera]]\nnam = 'x'\n", "w.toml:6: camera[0].nam: unknown key; did you mean"),
        (HOUSE + "[[camera]]\nname = 'x'\n", "w.toml:5: camera[0]: expected a position"),
        (HOUSE + GATE.replace("2, 3]", "2]"), "w.toml:7: camera[0].position: expected [x, y, z]"),
        (HOUSE + GATE.replace("[9, 9, 1]", "[1, 2, 3]"), "w.toml:5: camera[0]: camera 'gate': pos"),
        (HOUSE + GATE.replace("gate", "top"), "w.toml:5: camera[0]: camera name 'top': expected"),
        (HOUSE + GATE + "field_deg = 0\n", "w.toml:9: camera[0].field_deg: expected a finite"),
        (HOUSE + 2 * GATE, "w.toml:10: camera[1].name: a second camera 'gate'"),
        (HOUSE + "[robot]\nstart = [1, 2]\n", "w.toml:6: robot.start: expected [x, y, degrees]"),
        (HOUSE + "name = 'b'\n", "w.toml:5: not TOML: Cannot overwrite a value"),
        (HOUSE + "x = \n", "w.toml:5: not TOML: Invalid value at column 5"),
        (HOUSE + "x = [1,", "w.toml:5: not TOML: "),
        ("a = " + "[" * 5000, "w.toml:1: "),
        (
            "[[object]]\npoints = [[0, 0]]\n",
            "w.toml:2: object[0].points: expected a list of [x, y]",
        ),
        (
            "[[object]]\npoints = 5\n",
            "w.toml:2: object[0].points: expected a list of [x, y], found",
        ),
        (
            "[[object]]\nclosed = true\npoints = [[0, 0], [1, 1]]\n",
            "w.toml:3: object[0].points: closed with 2 points, expected at least 3",
        ),
        (
            "[[object]]\npoints = [\n  [0, 0],\n  [1, 2, 3],\n]\n",
            "w.toml:4: object[0].points[1]: expected [x, y], found 3 values",
        ),
        (
            "[[object]]\npoints = [\n  [0, 0],\n  [1e400, 2],\n]\n",
            "w.toml:4: object[0].points[1]: expected a finite number",
        ),
        (
            "[[object]]\nname = 'G3'\npoints = [\n  [0, 0],\n  [1, 2],\n  [1, 2],\n]\n",
            "w.toml:6: object[0].points[2]: points 1 and 2 of object 'G3' are both (1, 2),"
            " a segment of no length; remove one",
        ),
        (
            "[[object]]\nclosed = true\npoints = [[0, 0], [1, 2], [3, 0], [0, 0]]\n",
            "w.toml:3: object[0].points[3]: points 3 and 0 are both (0, 0), a segment of no"
            " length; closed joins them already",
        ),
    ],
)
def test_a_mistake_gets_one_line_with_its_place(text: str, message: str, tmp_path: Path) -> None:
    assert error_of(text, tmp_path).startswith(message)


def test_lines_of_keys_are_found_in_every_corner_of_toml() -> None:
    text = '''\
# a = 1
"quoted key" = 1
deep.dotted = { x = 1, y = [1,
  2] }   # ] } comment
text = """
[not]
a = "table" """
raw = \'\'\'
x = 1\'\'\'
date = 1979-05-27T07:32:00Z

[[list]]
[list.inner]
value = "a # b"
[[list]]
  [[list.more]]
  k = 1
[list.inner]
value = -1.5e3
[last . "one"]
k = 'c:\\d'
'''
    lines = lines_of_keys(text)
    assert lines[("quoted key",)] == 2
    assert lines[("deep", "dotted", "y", 1)] == 4
    assert lines[("raw",)] == 8
    assert lines[("date",)] == 10
    assert lines[("list", 0, "inner", "value")] == 14
    assert lines[("list", 1, "more", 0, "k")] == 17
    assert lines[("list", 1, "inner", "value")] == 19
    assert lines[("last", "one", "k")] == 21
    assert nearest_line(lines, ("list", 1, "absent", 4)) == 15
