"""Worlds from DXF and SVG drawings, and the objects that their walls are."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from drawn import dxf, svg
from ezdxf.xclip import XClip

from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.plans.canvas import CURVE_ERROR
from lrf3d.world import World
from lrf3d.world.pieces import connected, joined_objects, without_repeats

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")


@pytest.mark.parametrize(
    ("unit", "metres"),
    [(0, 1.0), (1, 0.0254), (2, 0.3048), (4, 0.001), (6, 1.0), (7, 1000.0), (21, 1200 / 3937)],
)
def test_the_unit_of_a_dxf_drawing_is_honoured(unit, metres, tmp_path):
    world = dxf(tmp_path, lambda space: space.add_line((0, 0), (10, 20)), unit)
    assert world.segments == pytest.approx(np.array([[0, 0, 10, 20]]) * metres)


@pytest.mark.parametrize(
    ("length", "metres"),
    [("300mm", 0.3), ("30cm", 0.3), ("10in", 0.254), ("96px", 0.0254), ("96", 0.0254),
     ("72pt", 0.0254)],
)  # fmt: skip
def test_the_unit_of_an_svg_drawing_is_honoured(length, metres, tmp_path):
    line = '<line x1="0" y1="50" x2="100" y2="50"/>'
    head = f'width="{length}" height="{length}" viewBox="0 0 100 100"'
    world = svg(tmp_path, line, head)
    assert world.segments == pytest.approx(np.array([[0, 0.5, 1, 0.5]]) * metres, abs=1e-12)


def test_transforms_uses_and_the_view_box_are_followed_and_y_points_up(tmp_path):
    body = (
        '<defs><rect id="r" width="1" height="2"/></defs>'
        '<use href="#r" x="3"/><g transform="translate(5 5) rotate(90)"><path d="M0 0h2"/></g>'
        '<g display="none"><path d="M0 0h9"/></g><path visibility="hidden" d="M0 0h9"/>'
        "<text>a</text>"
    )
    world = svg(tmp_path, body, 'width="10cm" height="10cm" viewBox="0 0 10 10"')
    assert len(world.segments) == 5 and world.object_count == 2
    assert world.bounds == pytest.approx(np.array([[0.03, 0.03], [0.05, 0.1]]))


@pytest.mark.parametrize(
    ("body", "low", "high"),
    [
        # Shapes that are turned, alone, in a group or by a use.
        ('<rect transform="rotate(90)" width="2" height="1"/>', (-1, 0), (0, 2)),
        ('<g transform="translate(5 5) rotate(180)"><rect width="2" height="1"/></g>',
         (3, 4), (5, 5)),
        ('<ellipse transform="rotate(90)" rx="2" ry="1"/>', (-1, -2), (1, 2)),
        ('<defs><rect id="r" width="2" height="1"/></defs><use href="#r" transform="rotate(90)"/>',
         (-1, 0), (0, 2)),
        # Viewports within the drawing have a frame of their own.
        ('<svg x="1" y="1" width="5" height="2" viewBox="10 0 10 4"><path d="M10 0h10v4"/></svg>',
         (1, 1), (6, 3)),
        ('<svg x="1" y="2"><path d="M0 0h3v4"/></svg>', (1, 2), (4, 6)),
        ('<symbol id="s"><path d="M0 0h4v4"/></symbol><use href="#s" x="1" y="2"/>',
         (1, 2), (5, 6)),
        # Symbols are fitted into their use, and clip what is outside of it.
        ('<symbol id="s" viewBox="0 0 4 4"><path d="M0 0h4v8" stroke="red" fill="none"/></symbol>'
         '<use href="#s" x="1" y="2" width="2" height="2"/>', (1, 2), (3, 4)),
        # Style sheets, also those of groups, and origins of transforms.
        ('<style>.a .b {display: none} rect.c {fill: none; stroke: none}</style>'
         '<g class="a"><rect class="b" width="9" height="9"/></g><rect class="c" width="9"'
         ' height="9"/><rect x="1" y="1" width="2" height="1"/>', (1, 1), (3, 2)),
        ('<rect style="transform: rotate(90deg); transform-origin: 3px 3px" x="1" y="1" width="4"'
         ' height="1"/>', (4, 1), (5, 5)),
        ('<rect style="transform: rotate(90deg); transform-origin: center" x="4" y="1" width="2"'
         ' height="1"/>', (8, 4), (9, 6)),
        # Numbers of colours may stand apart, and an opacity alone fills a shape.
        ('<rect width="9" height="9" fill="rgb(0 0 0 / 0)"/><rect width="9" height="9"'
         ' fill-opacity="0"/><path d="M1 1h3v2" fill="none" stroke="#000"/>', (1, 0.5), (4.5, 3)),
        ('<rect width="9" height="9" fill="rgb(0 0 0 / 5%)"/><path d="M1 1h3v2" fill="none"'
         ' stroke="rgb(9.5 2.5e1 .5)"/>', (1, 0.5), (4.5, 3)),
        # An opacity around shapes fills none: their outlines are walls.
        ('<g fill-opacity="1"><path d="M1 1h3v2z"/></g>', (1, 1), (4, 3)),
        # What is important overrules a style, but not what is important, too.
        ('<style>.a {display: none !important} .b {stroke: #000 !important} g .b {stroke: none}'
         '</style><path class="a" style="display: inline" d="M0 0h9v9"/><g><path class="b"'
         ' style="stroke: none; fill: none" d="M1 1h3v2"/></g>', (1, 0.5), (4.5, 3)),
        # A line on the edge of a clip is seen.
        ('<svg x=".7" y=".7" width="1.1" height="1.1" viewBox="0 0 7 7"><path d="M0 7h7v-7h-7"/>'
         '</svg>', (0.7, 0.7), (1.8, 1.8)),
        # The paper may be dark.
        ('<rect width="10" height="10" fill="#123"/><path d="M1 1h4v4" fill="none" stroke="#fff"'
         ' stroke-width=".1"/>', (1, 1), (5, 5)),
        ('<path d="M1 1h4v4" fill="none" stroke="#fff" stroke-width=".1"/>', (1, 1), (5, 5)),
        # What later areas cover is not seen, nor is what a clip or a mask cuts off.
        ('<path d="M0 1h9" stroke="#000" stroke-width=".1"/>'
         '<rect x="5" width="5" height="5" fill="white"/>',
         (0, 1), (5, 1)),
        # Other programs write colours for light and dark pages, by variables, and of three shares.
        ('<path d="M0 1h9" stroke="var(--page)" stroke-width=".1"/><g style="--paper: var(--Own);'
         ' --Own: color(display-p3 1 100% 1)"><rect x="3" width="3" height="5" fill="var(--paper)"'
         '/></g><rect x="6" width="4" height="5" fill="#000" style="fill: light-dark(rgb(255, 255,'
         ' 255), var(--dark, #121212))"/><path d="M0 2h9" stroke="var(--grid, none)"/>',
         (0, 1), (3, 1)),
        ('<clipPath id="c"><rect width="3" height="9"/></clipPath>'
         '<g clip-path="url(#c)"><path d="M1 1h8" stroke="#000" stroke-width=".1"/></g>',
         (1, 1), (3, 1)),
        ('<mask id="m"><rect width="9" height="9" fill="#fff"/><rect x="4" width="5" height="9"/>'
         '</mask><path mask="url(#m)" d="M1 1h8" stroke="#000" stroke-width=".1"/>',
         (1, 1), (4, 1)),
        # Of a switch the first choice that suits is drawn; some strokes keep their width.
        ('<switch><path systemLanguage="xx" d="M0 0h9v9"/><path d="M0 0h3v2"/><path d="M0 0h9v9"/>'
         '</switch>', (0, 0), (3, 2)),
        ('<g transform="scale(2)"><path vector-effect="non-scaling-stroke" d="M0 0h3v2" fill="none"'
         ' stroke="#000" stroke-width="9"/></g>', (0, 0), (6, 4)),
        # Only styles move by such properties.
        ('<rect scale="1:50" rotate="90" style="translate:unset" width="1" height="1"/>',
         (0, 0), (1, 1)),
        # What clips, masks, fills and marks is no outline.
        ('<clipPath id="c"><path d="M0 0h9v9"/></clipPath><mask><path d="M0 0h9v9"/></mask>'
         '<pattern><path d="M0 0h9v9"/></pattern><marker><path d="M0 0h9v9"/></marker>'
         '<rect clip-path="url(#c)" width="3" height="2"/>', (0, 0), (3, 2)),
    ],
)  # fmt: skip
def test_an_svg_drawing_is_read_as_browsers_draw_it(body, low, high, tmp_path):
    world = svg(tmp_path, body, 'width="10m" height="10m" viewBox="0 0 10 10"')
    drawn = np.array([[low[0], 10 - high[1]], [high[0], 10 - low[1]]])
    assert world.bounds == pytest.approx(drawn, abs=0.01)


@pytest.mark.parametrize(
    ("body", "length"),
    [
        # A white line through a dark mass is a doorway between white rooms.
        ('<rect width="10" height="8" fill="#000"/><g fill="#fff"><rect x=".2" y=".2" width="4.7"'
         ' height="7"/><rect x="5" y=".2" width="4.7" height="7"/></g><path d="M4.95 3v1"'
         ' stroke="#fff" stroke-width=".1"/>', 46.8 - 2 + 0.2),
        # Zones of several colours in one room have no wall in between.
        ('<rect x="1" y="1" width="4" height="6" fill="#d33"/><rect x="5" y="1" width="4" height='
         '"6" fill="#33d"/><path d="M1 1h8v6h-8z" fill="none" stroke="#000" stroke-width=".02"/>',
         28),
    ],
)  # fmt: skip
def test_dark_areas_of_an_svg_drawing_are_open_where_it_draws_no_wall(body, length, tmp_path):
    world = svg(tmp_path, body, 'width="10m" height="8m" viewBox="0 0 10 8"')
    assert lengths(world.segments).sum() == pytest.approx(length, abs=0.05)


def test_a_sheet_without_a_height_keeps_its_proportions(tmp_path):
    world = svg(tmp_path, '<rect width="10" height="20"/>', 'width="1in" viewBox="0 0 10 20"')
    assert world.bounds == pytest.approx(np.array([[0, 0], [0.0254, 0.0508]]))


CURVES = {
    "circle": ('<circle cx="5" cy="5" r="4"/>', shapely.Point(5, 5).buffer(4, 2000).exterior),
    "cubic": ('<path d="M0 0C5 20 8 -20 10 10"/>', [(0, 0), (5, 20), (8, -20), (10, 10)]),
    "quadratic": ('<path d="M0 0Q5 20 10 0"/>', [(0, 0), (5, 20), (10, 0)]),
}


@pytest.mark.parametrize("name", CURVES)
def test_curves_of_an_svg_drawing_are_chords_within_the_stated_error(name, tmp_path):
    body, curve = CURVES[name]
    if isinstance(curve, list):
        share = np.linspace(0.0, 1.0, 5001)[:, None]
        points = [np.array([point], dtype=float) for point in curve]
        while len(points) > 1:
            points = [a + share * (b - a) for a, b in pairwise(points)]
        curve = shapely.LineString(points[0])
    # A unit of this sheet is 100 m, so that 5 mm are what counts.
    world = svg(tmp_path, body, 'width="1000m" height="1000m" viewBox="0 0 10 10"')
    lines = shapely.union_all(shapely.linestrings(world.segments.reshape(-1, 2, 2)))
    true = shapely.transform(curve, lambda xy: [0, 1000] + xy * [100, -100])
    samples = shapely.points(shapely.get_coordinates(true))
    assert shapely.distance(samples, lines).max() <= CURVE_ERROR + 1e-6
    assert len(world.segments) < 4000


def test_curves_blocks_and_layers_of_a_dxf_drawing(tmp_path):
    def draw(space):
        space.add_circle((0, 0), 3)
        space.add_arc((20, 0), 3, 0, 90)
        block = space.doc.blocks.new("chair")
        space.doc.blocks.new("seat").add_line((0, 0), (1, 0))
        block.add_blockref("seat", (0, 0))
        chair = space.add_blockref("chair", (50, 50), dxfattribs={"xscale": 2, "rotation": 90})
        # Programs without heights write 0, which ezdxf would not.
        chair.dxf.__dict__["zscale"] = 0.0
        space.doc.layers.add("hidden").off()
        space.add_line((0, 0), (99, 99), dxfattribs={"layer": "hidden"})
        space.add_text("a room")
        space.add_lwpolyline([(30, 0), (32, 0), (32, 2)], close=True)

    world = dxf(tmp_path, draw)
    assert world.object_count == 4
    assert world.bounds == pytest.approx(np.array([[-3, -3], [50, 52]]), abs=0.01)
    radii = np.hypot(*(0.5 * (world.segments[:, :2] + world.segments[:, 2:])).T)
    assert 3.0 - radii[radii < 4].min() <= CURVE_ERROR


def test_the_lines_of_a_multiline_are_walls(tmp_path):
    world = dxf(tmp_path, lambda space: space.add_mline([(0, 0), (10, 0), (10, 5)]))
    assert len(world.segments) == 4
    assert world.bounds == pytest.approx(np.array([[0, -1], [11, 5]]))


def test_hidden_parts_of_a_dxf_drawing_are_not_walls(tmp_path):
    def draw(space):
        doc = space.doc
        block = doc.blocks.new("hall")
        block.add_line((0, 0), (10, 0))
        block.add_line((8, -1), (8, 1))
        XClip(space.add_blockref("hall", (0, 0))).set_block_clipping_path([(-1, -1), (6, 2)])
        space.add_line((0, 5), (10, 5))
        space.add_wipeout([(4, 4), (5, 6)])
        space.add_text("hall")
        space.add_linear_dim((0, 7), (0, 0), (10, 0)).render()
        doc.layers.add("OFF").off()
        doc.layers.add("GUIDE").dxf.plot = 0
        space.add_line((0, 6), (10, 6), dxfattribs={"layer": "GUIDE"})
        hidden = doc.blocks.new("hidden")
        hidden.add_line((0, 30), (1, 30), dxfattribs={"layer": "OFF"})
        space.add_blockref("hidden", (0, 0))
        # A block on a frozen layer shows nothing, one on a layer that is off its other layers.
        doc.layers.add("FROZEN").freeze()
        doc.blocks.new("frozen").add_line((0, 40), (1, 40), dxfattribs={"layer": "SHOWN"})
        space.add_blockref("frozen", (0, 0), dxfattribs={"layer": "FROZEN"})

    with pytest.warns(Lrf3dNote, match=r"2 hidden parts, 1 text, 1 unplotted stroke \(GUIDE\)"):
        world = dxf(tmp_path, draw)
    assert sorted(np.round(lengths(world.segments), 2)) == [4.0, 5.0, 6.0]


def test_walls_with_a_thickness_have_two_faces(tmp_path):
    def draw(space):
        space.add_lwpolyline([(0, 0), (10, 0), (10, 6), (0, 6)], close=True).dxf.const_width = 0.3
        hatch = space.add_hatch()
        hatch.paths.add_polyline_path([(20, 0), (24, 0), (24, 0.2), (20, 0.2)])
        hatch.paths.add_polyline_path([(20.1, 0.05), (23.9, 0.05), (23.9, 0.15), (20.1, 0.15)])
        space.add_lwpolyline([(20, 0), (24, 0), (24, 0.2), (20, 0.2)], close=True)

    world = dxf(tmp_path, draw)
    # The outline of the hatch counts once, with its hole.
    total = 2 * (9.7 + 5.7 + 10.3 + 6.3 + 4.2 + 3.9)
    assert lengths(world.segments).sum() == pytest.approx(total, abs=1e-3)
    assert world.bounds == pytest.approx(np.array([[-0.15, -0.15], [24, 6.15]]))
    thick = '<path d="M1 1h8v8h-8z" fill="none" stroke="#222" stroke-width=".3"/>'
    faces = svg(tmp_path, thick, 'width="10m" height="10m" viewBox="0 0 10 10"')
    assert lengths(faces.segments).sum() == pytest.approx(4 * (7.7 + 8.3))


@pytest.mark.parametrize("kind", ["dxf", "svg"])
def test_the_work_for_a_drawing_is_bounded(kind, tmp_path, monkeypatch):
    monkeypatch.setattr("lrf3d.plans.canvas.MOST_MARKS", 2000)

    def draw(space):
        for level in range(9):
            block = space.doc.blocks.new(f"b{level}")
            for number in range(10):
                if level:
                    block.add_blockref(f"b{level - 1}", (number, 0))
        space.add_blockref("b8", (0, 0))

    groups = "".join(f'<g id="b{n}">{10 * f"""<use href="#b{n - 1}"/>"""}</g>' for n in range(1, 9))
    with pytest.raises(WorldError, match="draws more than 2,000 lines"):
        if kind == "dxf":
            dxf(tmp_path, draw)
        else:
            svg(tmp_path, f'<defs><g id="b0"/>{groups}</defs><use href="#b8"/>')


def test_lines_drawn_twice_count_once():
    segments = np.array([[0, 0, 1, 1], [1, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]], dtype=float)
    assert without_repeats(segments).tolist() == [0, 3]


def test_walls_that_touch_are_one_object_also_far_from_the_origin():
    segments = np.array([[0, 0, 4, 0], [2, 0, 2, 3], [2, 3.1, 2, 5], [9, 9, 8, 9]]) + 1e6
    assert connected(segments).tolist() == [0, 0, 1, 2]


def test_objects_that_touch_count_as_one_by_their_lowest_number():
    # 3 and 1 touch; 2 lies apart, in two pieces of which one touches nothing; 4 touches 2.
    segments = [[0, 0, 4, 0], [2, 0, 2, 3], [9, 9, 8, 9], [20, 0, 21, 0], [8, 9, 8, 5]]
    world = World(segments, objects=[3, 1, 2, 2, 4])
    assert joined_objects(world).tolist() == [1, 1, 2, 2, 2]
