"""What of a drawing stands as a wall, and what is a door, furniture, text or a sheet's."""

import re
from itertools import pairwise

import ezdxf
import numpy as np
import pytest
import shapely
from drawn import dxf, svg
from ezdxf import units
from ezdxf.math import Vec2

from lrf3d import load_world, read_plan
from lrf3d.base.errors import Lrf3dNote, Lrf3dWarning, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.plans.rules.patterns import is_pattern
from lrf3d.plans.rules.strokes import RULES
from lrf3d.studio.figures.figures import draw_world

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")


def ring(x1, y1, x2, y2):
    return [(x1, y1), (x2, y1), (x2, y2), (x1, y2), (x1, y1)]


# A slanted stroke reaches over the frame.
FRAME = [
    *[ring(-5, -3, 14, 10.5), ring(-4.6, -2.6, 13.6, 10.1), ring(9, -2.6, 13.6, -1.5)],
    [(13.8, 4), (14.8, 4.5)],
]
SYMBOLS = {
    "frame line": FRAME,
    "pattern line": [
        *([(0.4 * x, 0.2), (0.4 * x, 3.0)] for x in range(1, 8)),
        *([(0.2, 0.4 * y), (3.0, 0.4 * y)] for y in range(1, 8)),
    ],
    "outside line": [
        *FRAME,
        [(12, 5), (12, 6)],
        [(11.7, 5.9), (12, 6)],
        [(12.4, 6.2), (12, 6)],
    ],
    "annotation line": [
        # Two dimensions side by side with ticks, one with arrows, and their extension lines.
        *([(x - 0.1, 7.9), (x + 0.1, 8.1)] for x in (0, 5, 10)),
        *([(x, 7.3), (x, 8.2)] for x in (0, 5, 10)),
        *[[(-0.2, 8), (5.1, 8)], [(4.9, 8), (10.2, 8)], [(-1, 0), (-1, 7)], [(-0.2, 7), (-1.2, 7)]],
        *[[(-0.9, 0.2), (-1, 0)], [(-1, 0), (-1.1, 0.2)], [(-0.9, 6.8), (-1, 7), (-1.1, 6.8)]],
        # One that is broken for its number, in lines that begin with their arrowheads.
        *[((0.2, 9.1), (0, 9), (4.5, 9)), ((9.8, 9.1), (10, 9), (5.5, 9))],
        *[[(0.2, 8.9), (0, 9)], [(9.8, 8.9), (10, 9)]],
        # An axis through the walls with its bubble.
        [(5, -2), (5, 10)],
        [(5 + 0.4 * np.cos(a), 10.4 + 0.4 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 25)],
    ],
}


@pytest.mark.parametrize("name", SYMBOLS)
def test_frames_patterns_and_arrows_are_not_walls(name, tmp_path):
    # Two rooms with walls of .2 m and a door of .9 m, tables, and a window of six lines.
    door = [(4.8, 0.2), (4.8, 2), (5.2, 2), (5.2, 0.2), (9.8, 0.2), (9.8, 6.8), (5.2, 6.8)]
    door += [(5.2, 2.9), (4.8, 2.9), (4.8, 6.8), (0.2, 6.8), (0.2, 0.2), (4.8, 0.2)]
    window = [[(1, 6.8 + 0.03 * number), (2, 6.8 + 0.03 * number)] for number in range(1, 7)]
    plain = [ring(0, 0, 10, 7), door, ring(7, 3, 8, 4), ring(2, 5, 3, 6), *window]

    def draw(space, lines):
        for line in lines:
            if len(line) > 20 or isinstance(line, tuple):
                space.add_lwpolyline(line)
                continue
            for one, two in pairwise(line):
                space.add_line(one, two)

    walls = dxf(tmp_path, lambda space: draw(space, plain)).segments
    assert len(walls) == sum(len(line) - 1 for line in plain)
    with pytest.warns(Lrf3dNote, match=name):
        world = dxf(tmp_path, lambda space: draw(space, [*plain, *SYMBOLS[name]]))
    assert np.array_equal(world.segments, walls)


def test_each_rule_has_a_name_and_a_sentence():
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert all(rule.what[0].isupper() and rule.what.endswith(".") for rule in RULES)


def test_what_each_rule_left_out_is_drawn_with_its_name(tmp_path):
    lines = [ring(0, 0, 10, 7), *SYMBOLS["frame line"], *SYMBOLS["pattern line"]]
    dxf(tmp_path, lambda space: [space.add_lwpolyline(line) for line in lines])
    plan = read_plan(tmp_path / "a.dxf")
    assert {name: len(strokes) for name, strokes in plan.removed.items()} == {
        "frame line": 13,
        "pattern line": 14,
    }
    assert np.array_equal(plan.scaled(2.0).removed["frame line"], 2.0 * plan.removed["frame line"])
    figure = draw_world(plan.world(tmp_path / "a.dxf"), plan=plan)
    names = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"left out: frame lines", "left out: pattern lines"} <= names


TWO_ROOMS = [ring(0, 0, 10, 7), ring(0.2, 0.2, 4.9, 6.8), ring(5.2, 0.2, 9.8, 6.8)]
JAMBS = [[(4.9, y), (5.2, y)] for y in (2, 2.9)]
TURN = [(np.cos(a), np.sin(a)) for a in np.linspace(0.0, np.pi / 2, 20)]


@pytest.mark.parametrize(
    ("lines", "opened"),
    [
        # A door through a wall, with the line of a tile along its face; through a wall that its
        # author did not break; and a shower in the corner of a room.
        ([*JAMBS, [(5.2, 0.2), (5.2, 6.8)]], 1),
        ([], 1),
        ([[(8.9, 0.2), (9.8, 0.2)], [(9.8, 1.1), (9.8, 0.2)]], 0),
    ],
)
def test_nothing_stands_in_a_doorway(lines, opened, tmp_path):
    place = np.array([5.2, 2.0] if opened else [9.8, 0.2])
    leaf = [[place, place + np.array([0.9, 0])]] if opened else []
    rooms = list(TWO_ROOMS)
    if len(lines) > 2:
        rooms[1:] = [[(4.9, 2), (4.9, 0.2), (0.2, 0.2), (0.2, 6.8), (4.9, 6.8), (4.9, 2.9)]]
        rooms += [[(5.2, 2), (5.2, 0.2), (9.8, 0.2), (9.8, 6.8), (5.2, 6.8), (5.2, 2.9)]]

    def draw(space):
        for line in [*rooms, *lines, *leaf]:
            space.add_lwpolyline(line)
        space.add_lwpolyline(place + 0.9 * np.array(TURN) * [opened or -1, 1])

    walls = shapely.union_all(shapely.linestrings(dxf(tmp_path, draw).segments.reshape(-1, 2, 2)))
    assert walls.intersects(shapely.box(4.8, 2.05, 5.3, 2.85)) == (not opened)
    # Of what encloses the rooms nothing else is missing.
    whole = shapely.union_all([shapely.linestrings(ring) for ring in TWO_ROOMS])
    missing = whole.difference(walls.buffer(1e-6)).length
    assert missing == pytest.approx(1.8 * opened, abs=0.05)


@pytest.mark.parametrize(
    ("left", "right", "high", "more", "opened"),
    # In the wall, next to it as a leaf that slides along it, across it; a column, and a window.
    [
        (4.9, 5.2, 0.9, [], 1), (5.2, 5.28, 0.9, [], 0), (4.0, 6.0, 0.9, [], 0),
        (4.9, 5.2, 0.45, [], 0), (4.9, 5.2, 0.9, [(5.05, 2), (5.05, 2.9)], 0),
    ],
)  # fmt: skip
def test_a_rectangle_in_a_wall_on_a_layer_of_doors_is_a_doorway(
    left, right, high, more, opened, tmp_path
):
    def draw(space):
        for line in TWO_ROOMS:
            space.add_lwpolyline(line)
        for line in (ring(left, 2, right, 2.0 + high), more):
            space.add_lwpolyline(line, dxfattribs={"layer": "DOORS"})

    # The walls are 79 m long; what is on other layers has a rule of its own.
    walls = dxf(tmp_path, draw).segments
    assert lengths(walls).sum() == pytest.approx(79.0 - 1.8 * opened, abs=0.05)
    plan = read_plan(tmp_path / "a.dxf")
    assert len(plan.removed["layer stroke"]) == 4 + bool(more)
    assert ("1 doorway opened where walls go on" in map(str, plan.said)) == opened


def test_a_door_with_leaf_arc_and_rectangle_is_one_door(tmp_path):
    def draw(space):
        for line in TWO_ROOMS:
            space.add_lwpolyline(line)
        on_doors = {"layer": "DOORS"}
        space.add_lwpolyline(ring(4.9, 3, 5.2, 3.9), dxfattribs=on_doors)
        space.add_line((5.2, 3), (6.1, 3), dxfattribs=on_doors)
        space.add_arc((5.2, 3), 0.9, 0, 90, dxfattribs=on_doors)

    dxf(tmp_path, draw)
    assert len(read_plan(tmp_path / "a.dxf").doors) == 1


def test_dashed_lines_are_left_out_but_for_walls(tmp_path):
    def draw(space):
        space.doc.linetypes.add("HIDDEN", [0.4, 0.25, -0.15])
        space.add_line((0, 0), (4, 0))
        space.add_line((0, 1), (4, 1), dxfattribs={"linetype": "HIDDEN"})
        space.add_line((0, 2), (4, 2), dxfattribs={"linetype": "HIDDEN", "layer": "A-WALL"})

    with pytest.warns(Lrf3dNote, match="left out: 1 dashed line"):
        assert dxf(tmp_path, draw).segments[:, 1].tolist() == [0, 2]
    pen = 'stroke="#000" stroke-width=".01"'
    body = f'<g {pen} stroke-dasharray="0.2 0.1"><path d="M1 1h8"/></g><path {pen} d="M1 2h8"/>'
    # Where a line ends in an arrowhead somebody goes, or something is meant.
    body += f'<path {pen} marker-end="url(#tip)" d="M1 3h8"/>'
    assert svg(tmp_path, body).segments[:, 1] == pytest.approx([0.8])


@pytest.mark.parametrize(("unit", "face"), [(1.0, 0), (0.001, 0), (1.0, 0.2)])
def test_a_leaf_and_its_arc_are_a_door_that_stands_open(unit, face, tmp_path):
    def draw(space):
        # A thick wall may cover the leaf up to its face.
        ends = [(0, 0), (2, 0)], [(2.9, 0), (6, 0)], [(2, face), (2, 0.9)]
        for one, two in ends:
            space.add_line(Vec2(one) / unit, Vec2(two) / unit)
        space.add_arc(Vec2(2, 0) / unit, 0.9 / unit, 0, 90)
        # A round corner has no leaf.
        space.add_arc(Vec2(6, 1) / unit, 1 / unit, 270, 360)

    dxf(tmp_path, draw, units.M if unit == 1.0 else units.MM)
    plan = read_plan(tmp_path / "a.dxf")
    (door,) = plan.doors
    assert door.width == pytest.approx(0.9, abs=1e-3)
    assert door.opening == pytest.approx(np.array([[2, 0], [2.9, 0]]), abs=1e-3)
    assert lengths(plan.segments).sum() == pytest.approx(5.1 + np.pi / 2, abs=0.01)


def test_layers_are_taken_by_their_names_or_as_chosen(tmp_path):
    def draw(space):
        for number, layer in enumerate(("A-WALL", "Türen", "Möbel", "A-ANNO-DIMS", "plan 7")):
            space.add_line((0, number), (1 + number / 4, number), dxfattribs={"layer": layer})
        # No leaf is that long.
        space.add_line((0, 9), (4, 9), dxfattribs={"layer": "Türen"})

    world = dxf(tmp_path, draw)
    assert world.segments[:, 2].tolist() == [1, 1.5, 2, 4]
    assert world.heights.tolist() == [2.5, 0.8, 2.5, 2.5]
    path = tmp_path / "a.dxf"
    assert load_world(path, layers=["a-*", "türen"]).segments[:, 2].tolist() == [1, 1.25, 1.75, 4]
    assert load_world(path, without=["möb*"]).segments[:, 2].tolist() == [1, 2, 4]
    with pytest.raises(WorldError, match=r"no layer is called A-GLAZ; .* A-WALL, Türen"):
        load_world(path, layers=["A-GLAZ"])


def test_words_drawn_as_lines_are_not_walls(tmp_path):
    letters = " M1 5v-.3h.2 M1.3 5v-.3 M1.4 5h.2v-.3h-.2z M1.7 5v-.3h.15v.15h-.15"
    columns = "".join(f"M{x} 8h.3v.3h-.3z" for x in (1, 1.4, 1.8, 2.2))
    looks = 'style="fill: none; stroke: red; stroke-width: .1"'
    # Others are written over a wall, or have upright strokes at one distance, as a pattern.
    letters += " M8.3 5v-.3h.2 M8.6 5v-.3 M8.75 5l.15 -.3l.15 .3 M9.1 4.7h.2l-.2 .3h.2"
    letters += "".join(f"M{1 + 0.17 * n} 2v-.3" for n in range(9)) + "h.12 M2.53 2v-.3h.12v.1"
    walls = f'<path d="M0 0h9v9h-9z{letters}{columns}" {looks}/>'
    world = svg(tmp_path, walls, 'width="10m" height="10m" viewBox="0 0 10 10"')
    assert lengths(world.segments).sum() == pytest.approx(36 + 4 * 1.2)


@pytest.mark.parametrize(
    ("page", "wall", "axis"),
    [
        ("cp932", "_0-9_壁", "_0-0_通り芯"),
        ("gbk", "墙体", "轴线标注"),
        ("cp949", "벽체", "치수"),
        ("cp1251", "Стены", "Размеры"),
        ("cp1250", "Stěny", "Kóty"),
        ("utf-8", "Stěny", "中心線寸法"),
    ],
)
def test_layer_names_in_an_undeclared_code_page_are_read_as_known_words(page, wall, axis, tmp_path):
    drawing = ezdxf.new("R2000")
    for number, layer in enumerate((wall, axis, "0")):
        space = drawing.modelspace()
        space.add_line((0, number), (1 + number, number), dxfattribs={"layer": layer})
    drawing.encoding = page
    path = tmp_path / "a.dxf"
    drawing.saveas(path, encoding=page)
    # Some programs declare the page of Western Europe whatever they write.
    path.write_bytes(re.sub(rb"ANSI_\d+", b"ANSI_1252", path.read_bytes()))
    with pytest.warns(Lrf3dNote, match=f"layer names read as {page}; left out: layers {axis}"):
        assert load_world(path).segments[:, 2].tolist() == [1, 3]


def test_plans_that_stand_apart_are_reported(tmp_path):
    def draw(space):
        for x in (0, 12):
            space.add_lwpolyline(ring(x, 0, x + 8, 6))
        space.add_lwpolyline(ring(22, 0, 23, 1))

    with pytest.warns(Lrf3dWarning, match=r"2 plans stand apart \(8 x 6 m at \(0.0, 0.0\), 8 x 6"):
        dxf(tmp_path, draw)
    # On a drawing of the size of its paper nothing does.
    dxf(tmp_path, draw, units.MM)


@pytest.mark.slow
def test_a_pattern_is_found_among_more_lines_than_can_be_compared():
    turns = np.linspace(0.0, np.pi, 2400, endpoint=False)
    ways = 0.2 * np.column_stack([np.cos(turns), np.sin(turns)])
    rungs = 0.1 * np.arange(12)
    tiles = np.column_stack([np.full(12, 5.0), rungs, np.full(12, 6.0), rungs])
    found = is_pattern(np.vstack([np.hstack([-ways, ways]), tiles]))
    assert found[2400:].all()
