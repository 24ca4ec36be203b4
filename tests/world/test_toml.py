import numpy as np
import pytest

from lrf3d import WorldError, load_world

HOUSE = """\
[[object]]
name = "house"
points = [[0, 0], [4, 0], [4, 3]]
closed = true
"""

ROUND_AND_SQUARE = """\
[[obstacle]]
route = [[5, 4], [9, 4]]
radius = 0.3
points = [[0, 0], [1, 0], [1, 1]]
"""

GATE = """\
[[camera]]
name = "gate"
position = [1, 2, 3]
target = [9, 9, 1]
"""


def read(text, folder):
    path = folder / "w.toml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def test_objects_are_read_with_their_walls_heights_names_and_colours(tmp_path):
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


def test_an_object_may_be_made_of_several_lines(tmp_path):
    text = "[[object]]\nlines = [[[0, 0], [1, 0]], [[5, 5], [6, 5], [6, 6]]]\nheight = [1, 2, 3]\n"
    world = read(text, tmp_path)
    assert world.segments.tolist() == [[0, 0, 1, 0], [5, 5, 6, 5], [6, 5, 6, 6]]
    assert world.objects.tolist() == [0, 0, 0]
    assert world.heights.tolist() == [1, 2, 3]


# Texts after that of a house, and the errors that they cause.
AFTER_HOUSE = [
    ("[robot]\nspede = 3\n", "robot: there is no 'spede'; did you mean 'speed'"),
    ("hieght = 3\n", "object[0]: there is no 'hieght'; did you mean 'height'"),
    (
        "height = 'tall'\n",
        "object[0].height 'tall': expected a finite number, above 0 and at most 1e+09",
    ),
    ("height = [1, 2]\n", "object[0].height: 2 heights for 3 walls"),
    ("colour = 'mud'\n", "object[0].colour: expected a colour such as"),
    ("material = 'glas'\n", "object[0].material: there is no 'glas'; did you mean 'glass'"),
    ("[[material]]\ndiffuse = 1\n", "material[0]: expected a name"),
    ("[[material]]\nname = 'a'\ndiffuse = 2\n", "material[0]: material 'a': diffuse 2: exp"),
    ("[noise]\nsigma = [0.1, -1]\n", "noise.sigma[1] -1: expected a finite"),
    ("[mapper]\nmode = 'x'\n", "mapper.mode: expected one of paper, robust"),
    ("lines = []\n", "object[0]: expected points"),
    ("[[obstacle]]\nradius = 1\n", "obstacle[0]: expected a route"),
    ("[[obstacle]]\nroute = [[5, 4]]\n", "obstacle[0].route: expected a list of at least 2"),
    (ROUND_AND_SQUARE, "obstacle[0]: expected a radius or points, found both"),
    ("[camera]\nview = 'x'\n", "camera: expected tables [[camera]]"),
    ("[[camera]]\nname = 'x'\n", "camera[0]: expected a position"),
    (GATE.replace("2, 3]", "2]"), "camera[0]: camera 'gate': position is [1, 2], expected x"),
    (GATE.replace("[9, 9, 1]", "[1, 2, 3]"), "camera[0]: camera 'gate': target is (1.0, 2.0"),
    (2 * GATE, "cameras: two of the name 'gate'"),
    (2 * "[[material]]\nname = 'a'\n", "material: two of the name 'a'"),
    (
        "[[object]]\nnumber = 0\nname = 'b'\npoints = [[0, 0], [0, 1]]\n",
        "object[1].name: stands with another object of the same number",
    ),
    ("[robot]\nstart = [1, 2]\n", "robot.start: expected [x, y, degrees] of finite"),
    ("name = 'b'\n", "not TOML: Cannot overwrite a value (at line 5"),
    (
        "[[object]]\npoints = [[0, 0], [0, nan]]\n",
        "object[1].points[1]: expected [x, y] of finite numbers up to",
    ),
    ("[[object]]\npoints = [[0, 0], [1, 2, 3]]\n", "object[1].points[1]: expected [x, y]"),
    (
        "[[object]]\nclosed = true\npoints = [[0, 0], [1, 1]]\n",
        "object[1].points: closed with 2 points, expected at least 3",
    ),
    (
        "[[object]]\nclosed = true\npoints = [[0, 0], [1, 2], [3, 0], [0, 0]]\n",
        "object[1].points[3]: the next point is (0, 0), too",
    ),
]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((HOUSE + text, message) for text, message in AFTER_HOUSE),
        ("roboot = 1\n", "there is no 'roboot'; did you mean 'robot'"),
        ("[robot]\nseed = 1\n", "robot: there is no 'seed'; known are start"),
        ("robot = 3\n" + HOUSE, "robot: expected a table [robot]"),
        ("name = 3\n" + HOUSE, "name: expected a text in quotes, found 3"),
        ("[object]\nname = 'a'\n", "object: expected tables [[object]]"),
        ("", "object: expected at least one table [[object]]"),
    ],
)
def test_a_mistake_gets_one_line_with_its_place(text, message, tmp_path):
    with pytest.raises(WorldError) as caught:
        read(text, tmp_path)
    said = str(caught.value)
    assert "\n" not in said and said.startswith(f"{tmp_path}/w.toml: {message}")
