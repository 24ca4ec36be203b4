"""Decisions about plans: they are values, are kept in a file, and are obeyed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from lrf3d import World, load_scenario, load_world, read_plan, save_world
from lrf3d.base.errors import Lrf3dWarning, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.plans.decisions import (
    Class,
    Doorway,
    DrawnWall,
    KeepOut,
    Move,
    Obstacle,
    PlacedRobot,
    Reading,
    Remove,
    Scale,
)
from lrf3d.plans.edits import PlanEdits, read_edits

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")

ROOM = """<svg width="8m" height="6m" viewBox="0 0 800 600" fill="none" stroke="black">
<g id="walls"><rect x="100" y="100" width="600" height="400"/></g>
<g id="shelf"><path stroke="red" d="M200 200 h100 v50 h-100 z"/></g></svg>"""


@pytest.fixture
def room(written):
    return written("room.svg", ROOM)


coordinates = st.floats(-1e3, 1e3, allow_subnormal=False)
places = st.tuples(coordinates, coordinates)
lines = st.lists(places, min_size=2, max_size=4)
areas = st.lists(places, min_size=3, max_size=5)
sizes = st.floats(0.01, 100.0)
decisions = st.lists(
    st.one_of(
        st.builds(DrawnWall, lines, sizes, st.sampled_from([None, "glass", "brick"])),
        st.builds(Doorway, places, sizes),
        st.builds(Remove, lines),
        st.builds(Move, places, places),
        st.builds(KeepOut, areas),
        st.builds(Obstacle, lines, sizes),
        st.builds(
            Class,
            st.fixed_dictionaries(
                {}, optional={"layer": st.text(), "near": places, "inside": areas}
            ),
            st.sampled_from(["wall", "door", "furniture", "glass", "mirror", "nothing"]),
        ),
    ),
    max_size=5,
)
singles = st.tuples(
    st.builds(Reading, sizes),
    st.builds(Scale, st.tuples(places, places), sizes),
    st.builds(PlacedRobot, st.tuples(coordinates, coordinates, coordinates)),
)


@settings(max_examples=50)
@given(decisions, singles)
def test_decisions_are_read_from_their_file_as_they_were_written(tmp_path_factory, several, single):
    path = tmp_path_factory.getbasetemp() / "a.svg.edit.toml"
    edits = PlanEdits([*single, *several], "a.svg", "sha256:0")
    edits.write(path)
    kinds = [type(each).__name__ for each in edits.decisions]
    read = read_edits(path)
    assert sorted(map(repr, read.decisions)) == sorted(map(repr, edits.decisions)), kinds
    assert read.as_dict() == edits.as_dict() == PlanEdits.of(edits.as_dict()).as_dict()


def test_a_file_next_to_a_drawing_is_obeyed_and_a_list_gives_the_same_plan(room):
    edits = [
        Scale([[100, 100], [700, 100]], 12.0),
        Class({"layer": "shelf"}, "nothing"),
        Class({"colour": "#ff0000", "inside": [[0, 0], [400, 0], [400, 600], [0, 600]]}, "mirror"),
        DrawnWall([[8, 2], [8, 10]], 1.5, "glass"),
        Doorway([8.1, 6], 1.0),
        PlacedRobot([4, 4, 90], [[12, 4]]),
        Obstacle([[3, 3], [3, 5]], radius=0.2),
    ]
    plan = read_plan(room, edits)
    PlanEdits(edits, room.name).write(f"{room}.edit.toml")
    scenario = load_scenario(room)
    world = scenario.world
    assert np.array_equal(plan.world(room).segments, world.segments)
    assert np.array_equal(load_world(room).segments, read_plan(room).world(room).segments)
    # The room is 12 m by 8 m; the shelf is a mirror, the last class wins; glass of 8 m has a door.
    assert np.ptp(world.bounds, axis=0) == pytest.approx([12.0, 8.0])
    made = [world.materials[each].name if world.materials[each] else "" for each in world.objects]
    assert [made.count(name) for name in ("", "mirror", "glass")] == [4, 4, 2]
    glass = world.segments[[name == "glass" for name in made]]
    assert sorted(glass[:, [1, 3]].ravel()) == pytest.approx([2, 5.5, 6.5, 10])
    assert world.heights[[name == "glass" for name in made]] == pytest.approx(1.5)
    assert scenario.start == pytest.approx((4, 4, np.pi / 2))
    assert len(scenario.obstacles) == 1
    route = scenario.with_route().route
    assert np.hypot(*(route - [8.0, 6.0]).T).min() < 1.5, "it goes through the door"
    assert route[-1] == pytest.approx([12, 4], abs=0.2)
    assert len(read_plan(room, ()).segments) == 8


def test_walls_are_moved_and_cut_and_a_wall_of_two_faces_gets_a_doorway_with_jambs(tmp_path):
    leaf = [2.5, 0, 3.4, -0.25]
    crossing = [3, 4.5, 3, 6]
    walls = [[0, 0, 8, 0], [0, 0.2, 8, 0.2], [0, 4, 8, 4], [0, 5, 8, 5], leaf, crossing]
    save_world(World(walls, [0, 0, 1, 2, 3, 4]), tmp_path / "w.geojson")
    plan = read_plan(tmp_path / "w.geojson", [
        Doorway([3, 0.05], 1.0), Move([8, 4], [9, 4.5]), Remove([[1, 5], [3, 5]]),
        DrawnWall([[6, 5], [7, 5]], material="mirror"),
    ])  # fmt: skip
    found = {tuple(row) for row in plan.segments.round(6).tolist()}
    assert found == {
        (0, 0, 2.5, 0), (3.5, 0, 8, 0), (0, 0.2, 2.5, 0.2), (3.5, 0.2, 8, 0.2),
        (2.5, 0, 2.5, 0.2), (3.5, 0, 3.5, 0.2), (0, 4, 9, 4.5), (0, 5, 1, 5), (3, 5, 6, 5),
        (6, 5, 7, 5), (7, 5, 8, 5), (*crossing,),
    }  # fmt: skip
    assert [door.width for door in plan.doors] == [1.0]
    assert plan.world(tmp_path / "w.geojson").object_count == 5


@pytest.mark.parametrize(
    ("walls", "lines"),
    [
        ([[0, 0, 8, 0], [0, 0.35, 8, 0.35]], 3),
        ([[0, 0, 8, 0], [0, 0.1, 8, 0.1], [0, 0.2, 8, 0.2]], 8),
        # The third line ends at the sides of the doorway.
        ([[0, 0, 8, 0], [0, -0.15, 8, -0.15], [0, 0.14, 2.5, 0.14], [3.5, 0.14, 8, 0.14]], 8),
    ],
)
def test_a_doorway_goes_through_all_lines_of_a_wall_but_not_through_a_cupboard(
    tmp_path, walls, lines
):
    save_world(World(walls), tmp_path / "w.geojson")
    plan = read_plan(tmp_path / "w.geojson", [Doorway([3, 0.05], 1.0)])
    assert len(plan.segments) == lines


def test_a_picture_is_read_by_the_scale_that_was_pointed_out(tmp_path):
    pixels = np.full((400, 500), 255, np.uint8)
    pixels[50:350, 60:440] = 0
    pixels[60:340, 70:430] = 255
    Image.fromarray(pixels).save(tmp_path / "a.png")
    plan = read_plan(tmp_path / "a.png", [Scale([[60, 200], [440, 200]], 7.6)])
    assert np.ptp(plan.segments.reshape(-1, 2), axis=0) == pytest.approx([7.6, 6.0], abs=0.05)


def test_a_route_avoids_an_area_that_is_kept_out_of(room):
    edits = [PlacedRobot([2, 3, 0], [[6, 3]]), Class({"layer": "shelf"}, "nothing")]
    area = [[3.5, 0.9], [4.5, 0.9], [4.5, 3.6], [3.5, 3.6]]
    for extra in ([], [KeepOut(area)]):
        PlanEdits([*edits, *extra], room.name).write(f"{room}.edit.toml")
        route = load_scenario(room).with_route().route
        assert (route[:, 1].max() > 3.9) == bool(extra)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 2", "newer lrf3d"),
        ('source = "other.svg"', "another drawing, other.svg"),
        ("[[class]]\nselect = {}", "class.0.: class: expected a as"),
        ('[[class]]\nselect = {layr = "a"}\nas = "wall"', "did you mean 'layer'"),
        ('[[class]]\nselect = {layer = "a"}\nas = "wal"', "expected one of wall, furniture"),
        ("[wall]\npoints = [[0, 0], [1, 1]]", r"wall: expected \[\[wall\]\]"),
        ("[[wall]]\npoints = [[0, 0]]", "at least 2"),
        ("[scale]\nbetween = [[1, 1], [1, 1]]\nmetres = 1", "one; choose others"),
        ("walls = 3", "did you mean 'wall'"),
        ("wall = 3 3", "not TOML"),
        ('[[remove]]\nbetween = [[90, 1], [91, 1]]\n[[class]]\nselect = {layer = "x"}\nas = "wall"',
         "none of its 2 selections is in this drawing"),
    ],
)  # fmt: skip
def test_what_a_file_of_decisions_may_not_hold_is_said_in_one_line(room, text, message):
    room.with_name("room.svg.edit.toml").write_text(text)
    with pytest.raises(WorldError, match=message) as error:
        load_world(room)
    assert str(room) in str(error.value)


def test_what_fits_a_new_revision_is_kept_and_what_does_not_is_named(room):
    edits = [Class({"layer": "shelf"}, "nothing"), Class({"layer": "sofa"}, "nothing")]
    PlanEdits(edits, room.name, "sha256:0").write(f"{room}.edit.toml")
    assert "room.svg has changed since it was edited" in read_plan(room).said[0].fact
    with pytest.warns(Lrf3dWarning, match=r"not found any more: class\[1\] .*sofa"):
        assert len(load_world(room).segments) == 4


@pytest.mark.parametrize(
    ("place", "ends"), [({}, [1, 1, 2, 4.5]), ({"near": [400, 100]}, [1, 1, 1, 7])]
)
def test_glass_in_an_area_ends_at_its_edge_but_is_a_whole_stroke_at_a_place(place, ends, room):
    area = [[200, 50], [450, 50], [450, 150], [200, 150]]
    parts = read_plan(room, [Class({"inside": area, **place}, "glass")]).parts
    glass = parts.segments[parts.kinds == "glass"]
    assert np.sort(glass, axis=1) == pytest.approx(np.array([ends]))


@pytest.mark.parametrize(
    ("box", "glass"), [((3, 1, 7, 3), 2.0), ((-1, 2, 3, 4), 2.0), ((3, 0, 7, 5), 7.0)]
)
def test_a_wall_along_the_edge_of_an_area_of_glass_stays(box, glass, tmp_path):
    walls = [[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0], [3, 0, 3, 4]]
    save_world(World(walls), tmp_path / "w.geojson")
    x1, y1, x2, y2 = box
    area = [[x1, y1], [x2, y1], [x2, y2], [x1, y2]]
    parts = read_plan(tmp_path / "w.geojson", [Class({"inside": area}, "glass")]).parts
    assert lengths(parts.segments).sum() == pytest.approx(24.0)
    assert lengths(parts.segments[parts.kinds == "glass"]).sum() == pytest.approx(glass)


@pytest.mark.parametrize(
    ("place", "gone"), [([400, 100], 6.0), ([300, 100], 4.0), ([600, 100], 2.0)]
)
def test_a_place_finds_a_wall_that_glass_has_cut_as_a_whole_or_its_pieces(place, gone, room):
    glass = Class({"inside": [[50, 50], [500, 50], [500, 150], [50, 150]]}, "glass")
    walls, left = (
        read_plan(room, edits) for edits in ([glass], [glass, Class({"near": place}, "nothing")])
    )
    assert not left.lost
    assert lengths(walls.segments).sum() - lengths(left.segments).sum() == pytest.approx(gone)
