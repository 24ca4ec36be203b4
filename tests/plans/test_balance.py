"""Of all that a drawing or a picture holds, what is used and what is left out add up."""

from collections import Counter

import ezdxf
import numpy as np
import pytest
from drawn import dxf, pdf
from ezdxf import xref
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, PlanarCaster, load_world, read_plan
from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.plans import doubts
from lrf3d.plans.rules.doors import Door

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")
ROOM = '<rect width="6000" height="4000" fill="none" stroke="black"/>'
SHEET = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:o="urn:o" width="8m" height="6m"'
SHEET += ' viewBox="0 0 8000 6000">'


def added_up(plan):
    balance = plan.balance
    assert balance.missing == 0 and balance.used > 0, balance
    assert balance.used + sum(balance.left_out.values()) == balance.all
    return Counter(balance.left_out)


# Elements of SVG that paint, define, or that nobody knows.
ELEMENTS = st.recursive(
    st.sampled_from(
        [
            '<rect width="9" height="9" stroke="red"/>', '<path d="M0 0 H50" stroke="#fff"/>',
            "<text>a<tspan>b</tspan></text>", "<image/>", "<video/>", "<o:thing/>", "<title/>",
            '<rect width="9" height="9" visibility="hidden"/>', '<use href="#gone"/>',
            '<use href="http://a.b/c#d"/>', '<line x2="8" marker-end="url(#m)" stroke="red"/>',
            '<circle r="5" fill="url(#g)"/>', '<linearGradient id="g"/>', "<rect/>",
        ]
    ),
    lambda inner: st.tuples(
        st.sampled_from(
            ["g", "defs", "symbol", "switch", "svg", "marker", "flowRoot", "clipPath", "a"]
        ),
        st.sampled_from(["", ' display="none"', ' id="s"', ' opacity="0"']),
        st.lists(inner, max_size=3),
    ).map(lambda each: f"<{each[0]}{each[1]}>{''.join(each[2])}</{each[0]}>"),
    max_leaves=8,
)  # fmt: skip


@settings(
    max_examples=40,
    phases=[Phase.generate],
)
@given(st.lists(ELEMENTS, max_size=5))
def test_elements_of_svg_are_used_or_left_out(written, elements):
    added_up(read_plan(written("a.svg", f'{SHEET}{ROOM}{"".join(elements)}<use href="#s"/></svg>')))


def unknown(space, kind, layer):
    """Add an entity of an unknown kind, as other programs write them."""
    from ezdxf.entities import DXFTagStorage
    from ezdxf.lldxf.extendedtags import ExtendedTags

    tags = f"  0\n{kind}\n  5\n{space.doc.entitydb.next_handle()}\n100\nAcDbEntity\n  8\n{layer}\n"
    entity = DXFTagStorage.load(ExtendedTags.from_text(tags), space.doc)
    space.doc.entitydb.add(entity)
    space.add_entity(entity)


def filled(space, kinds):
    """Add entities of some kinds to a layout or a block."""
    add = {
        "line": lambda: space.add_line((1, 1), (1, 3)),
        "text": lambda: space.add_text("a"),
        "hatch": lambda: space.add_hatch().set_pattern_fill("ANSI31"),
        "wall": lambda: unknown(space, "AEC_WALL", "A-WALL"),
        "arcs": lambda: space.add_lwpolyline([(0, 0, 0, 0, 1), (1, 0)]),
        "circle": lambda: space.add_circle((2, 2), 0.5),
        "frozen": lambda: space.add_line((1, 1), (3, 1), dxfattribs={"invisible": 1}),
        "solid": lambda: space.add_3dface([(0, 0), (1, 0), (1, 1)]),
        "attribute": lambda: space.add_attdef("A", (0, 0)),
        "gone": lambda: space.add_blockref("NOSUCH", (0, 0)),
        "external": lambda: space.add_blockref("CORE", (0, 0)),
        "block": lambda: space.add_blockref("B", (1, 1)).grid((2, 2), (1, 1)),
        "stretched": lambda: space.add_blockref("B", (1, 1), {"xscale": 2.0, "rotation": 30}),
        "hidden": lambda: space.add_blockref("B", (1, 1), {"invisible": 1}),
        "table": lambda: space.add_mline([(0, 0), (1, 0)]),
        "mesh": lambda: space.add_mesh(),
    }
    for kind in kinds:
        add[kind]()


KINDS = "line text hatch wall arcs circle frozen solid attribute gone external table mesh".split()


@pytest.mark.slow
@settings(
    max_examples=40,
    phases=[Phase.generate],
)
@given(
    st.lists(st.sampled_from([*KINDS, "block", "stretched", "hidden"]), max_size=6),
    st.lists(st.sampled_from(KINDS), max_size=5),
    st.lists(st.sampled_from(KINDS), max_size=2),
)
def test_entities_of_dxf_are_used_or_left_out(tmp_path, top, inner, paper):
    file = ezdxf.new()
    xref.define(file, "CORE", "arch/core.dwg")
    filled(file.blocks.new("B"), inner)
    space = file.modelspace()
    space.add_lwpolyline([(0, 0), (6, 0), (6, 4), (0, 4)], close=True)
    filled(space, top)
    filled(file.paperspace(), paper)
    file.saveas(tmp_path / "a.dxf")
    left_out = added_up(read_plan(tmp_path / "a.dxf"))
    assert left_out["AEC_WALL: A-WALL"] >= top.count("wall")
    assert left_out["external reference: arch/core.dwg"] >= top.count("external")
    assert left_out["undefined block: NOSUCH"] >= top.count("gone")


def test_objects_of_pdf_are_used_or_left_out(tmp_path):
    layers = "/OCProperties<</OCGs[6 0 R 7 0 R]/D<</OFF[7 0 R]>>>>"
    content = "0 0 100 50 re S BT (a) Tj ET /OC /M BDC 0 0 m 9 9 l S /F Do EMC /F Do 9 9 m 9 9 l S"
    pdf(tmp_path, content, forms="0 18 m 90 18 l S 0 0 m 0 9 l S", root=layers)
    left_out = added_up(read_plan(tmp_path / "a.pdf", scale=100.0))
    assert left_out["hidden part"] >= 3


def test_a_wall_that_a_doorway_cuts_is_closed_there(tmp_path):
    # The square caps of walls reach into the doorway.
    wall = '<g id="walls" stroke="black" stroke-width="200"><path stroke-linecap="{}" d="M{}"/></g>'
    leaf = '<g id="doors"><path d="M5000 3000 H6000 A1000 1000 0 0 1 5000 4000" stroke="black"'
    seen = []
    for cap in ("butt", "square"):
        walls = wall.format(cap, "5000 0 V3000 M5000 4000 V6000")
        (tmp_path / "a.svg").write_text(f'{SHEET}{walls}{leaf} fill="none"/></g></svg>')
        world = read_plan(tmp_path / "a.svg").world(tmp_path / "a.svg")
        beam = LaserRangeFinder(-0.01, 0.01, 3, range_max=20)
        seen.append(PlanarCaster(world).cast(beam, (5, 2.5, np.pi / 2)).ranges[1])
    assert seen == pytest.approx([0.5, 0.5], abs=0.02)


def test_rooms_that_are_drawn_as_areas_have_walls_around_them(written):
    areas = [
        (0, 0, 4000, 4000, "#ccf"),
        (4000, 0, 4000, 4000, "#cfc"),
        (3950, 1500, 100, 900, "#f9a"),
    ]
    body = "".join(
        '<rect x="{}" y="{}" width="{}" height="{}" fill="{}"/>'.format(*a) for a in areas
    )
    plan = read_plan(written("a.svg", f"{SHEET}{body}</svg>"))
    assert (
        lengths(plan.segments).sum() == pytest.approx(28 - 0.9, abs=0.01) and added_up(plan) == {}
    )


def test_furniture_does_not_make_a_sheet_larger_than_a_house(written):
    rooms = row_of_rooms(5, open_=4)
    shelves = [[4 * n + 1, 1, 4 * n + 1.5, 1 + 0.1 * m] for n in range(5) for m in range(30)]
    lines = "".join(f"M{a} {b}L{c} {d}" for a, b, c, d in [*rooms, *shelves])
    sheet = '<svg width="20cm" height="4cm" viewBox="0 0 20 4" stroke="#000" stroke-width=".02">'
    assert "; --scale 100 if it is 1:100 (20 m by 4 m); " in str(
        read_plan(written("a.svg", f'{sheet}<path d="{lines}"/></svg>')).doubts[-1]
    )


def test_layers_are_advised_where_they_draw_walls(tmp_path):
    def draw(space):
        space.add_line((0, 0), (0.9, 0), {"layer": "DOORS"})
        space.add_arc((0, 0), 0.9, 0, 90, {"layer": "DOORS"})
        space.add_line((5, 0), (9, 0), {"layer": "TEXT"})

    with pytest.raises(WorldError, match="--layers takes layers as walls: TEXT;"):
        dxf(tmp_path, draw)


@pytest.mark.parametrize(
    ("unit", "scale"), [(0.01, "0.01"), (0.0254, "0.0254"), (0.3048, "0.3048"), (1.0, "")]
)
def test_the_unit_of_a_drawing_without_one_is_found_by_its_doors(unit, scale, tmp_path):
    def draw(space):
        space.add_lwpolyline(np.array([(0, 0), (12, 0), (12, 8), (0, 8), (0, 0)]) / unit)
        for x in (3, 6, 9):
            space.add_line((x / unit, 0), (x / unit, 3 / unit))
            space.add_line((x / unit, 3 / unit), ((x + 0.9) / unit, 3 / unit))
            space.add_arc((x / unit, 3 / unit), 0.9 / unit, 0, 90)

    dxf(tmp_path, draw, 0)
    doubt = " ".join(map(str, read_plan(tmp_path / "a.dxf").doubts))
    assert (
        (f"--scale {scale} " in doubt and "12 m by 8 m, 3 doors" in doubt) if scale else not doubt
    )


def row_of_rooms(count, open_):
    """The walls of rooms of 4 by 4 m in a row, of which the first few inner walls have a door."""
    sides = [[4 * n, y, 4 * n + 4, y] for n in range(count) for y in (0, 4)]
    inner = [[4 * n, 0, 4 * n, 3.0 if 0 < n <= open_ else 4] for n in range(count + 1)]
    return np.array(sides + inner, float)


@pytest.mark.parametrize(
    ("walls", "unit", "advice"),
    [
        (1e3 * np.array([[0, 0, 52, 0], [52, 0, 52, 30], [52, 30, 0, 30], [0, 30, 0, 0]]), 0,
         "--scale 0.001 if it is in millimetres (52 m by 30 m)"),
        (row_of_rooms(15, open_=14), 4, "?; --scale 1000 if it is in metres (60 m by 4 m); "),
    ],
    ids=["a hall in an unknown unit", "a long building"],
)  # fmt: skip
def test_a_drawing_gets_the_scales_that_make_it_a_building(walls, unit, advice, tmp_path):
    dxf(tmp_path, lambda space: [space.add_line(each[:2], each[2:]) for each in walls], unit)
    assert advice in str(read_plan(tmp_path / "a.dxf").doubts[-1])


@pytest.mark.parametrize("code", [0, 6])
def test_a_usual_size_is_doubted_by_its_doors_unless_the_drawing_names_its_unit(code, tmp_path):
    def draw(space):
        for x1, y1, x2, y2 in row_of_rooms(3, open_=2) / 0.3048:
            space.add_line((x1, y1), (x2, y2))
        for x in np.array([2, 6, 10]) / 0.3048:
            space.add_line((x, 0), (x, 3))
            space.add_arc((x, 0), 3, 0, 90)

    dxf(tmp_path, draw, code)
    doubt = " ".join(map(str, read_plan(tmp_path / "a.dxf").doubts))
    assert ("--scale 0.3048 if it is in feet" in doubt) == (code == 0)


@pytest.mark.parametrize(
    ("phrase", "doubt"),
    [
        (doubts.of_doors([Door(np.eye(3, 2), width) for width in (0.3, 0.9, 2.4)]), "2 doors of"),
        (doubts.of_doors([Door(np.eye(3, 2), 0.9)]), ""),
        (doubts.of_outside(30.0, 60.0), "a part of 30 m²"), (doubts.of_outside(3.0, 60.0), ""),
        (doubts.of_thick(np.array([True] * 8), np.array([True] * 4 + [False] * 4)), "50% of"),
        (doubts.of_rooms(np.array([[n, 0, n, 1] for n in range(20)], float)), doubts.NO_ROOM),
        (doubts.of_rooms(np.array([[0, 0, 9, 0]], float)), ""),
        # Rooms in a row; each has a door to the next, or the last of them has none.
        (doubts.of_rooms(row_of_rooms(4, open_=3)), ""),
        (doubts.of_rooms(row_of_rooms(4, open_=2)), "no door leads to 25% of the rooms"),
        (doubts.of_pictures(0.9), "a picture covers 90%"), (doubts.of_pictures(0.1), ""),
        (doubts.of_dark(0.6), "60% of what is dark"), (doubts.of_dark(0.4), ""),
    ],
)  # fmt: skip
def test_what_rules_cannot_settle_is_doubted(phrase, doubt):
    assert phrase.startswith(doubt) and bool(phrase) == bool(doubt)


@pytest.mark.parametrize(
    ("colours", "stroke"), [(3 * ["#d33"], "#000"), (["#d33", "#33d", "#3d3"], "none")]
)
def test_dark_rooms_with_outlines_or_of_several_colours_are_no_solid_blocks(
    colours, stroke, written
):
    rooms = [
        f'<rect x="{x}" y="1" width="4" height="5" fill="{colour}"/>'
        for x, colour in zip((1, 5, 9), colours, strict=True)
    ]
    sheet = f'<svg width="15m" height="8m" viewBox="0 0 15 8" stroke="{stroke}" stroke-width=".02">'
    assert lengths(
        read_plan(written("a.svg", f"{sheet}{''.join(rooms)}</svg>")).segments
    ).sum() == pytest.approx(44, abs=0.1)


def test_a_doubt_names_the_editor(tmp_path):
    dxf(tmp_path, lambda space: space.add_lwpolyline([(0, 0), (1200, 0), (1200, 800)]), 0)
    with pytest.warns(Lrf3dNote, match=r"--scale 0.01 .*`lrf3d edit .*a.dxf` settles it"):
        load_world(tmp_path / "a.dxf")
