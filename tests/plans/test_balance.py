"""Of all that a drawing or a picture holds, what is used and what is left out add up."""

from collections import Counter

import ezdxf
import pytest
from ezdxf import xref
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from lrf3d.plans.reading import read_plan

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
    deadline=None,
    max_examples=40,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.lists(ELEMENTS, max_size=5))
def test_elements_of_svg_are_used_or_left_out(tmp_path, elements):
    (tmp_path / "a.svg").write_text(f'{SHEET}{ROOM}{"".join(elements)}<use href="#s"/></svg>')
    added_up(read_plan(tmp_path / "a.svg"))


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


@settings(
    deadline=None,
    max_examples=40,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
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
