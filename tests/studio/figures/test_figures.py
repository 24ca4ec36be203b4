"""Pictures of worlds and maps."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from synthetic_run import around, box, make_run, make_world, ring, street

import lrf3d
from lrf3d import LaserRangeFinder, LineMap, OutputError, World
from lrf3d.mapping.tints import object_tints
from lrf3d.studio.figures.figures import draw_map, draw_noise_levels, draw_world
from lrf3d.studio.figures.plot import INSIDE, MOST_POINTS

AWAY = (85000.0, 447500.0)


@pytest.fixture(scope="module")
def run():
    poses = around(11, 3, 20, 12)
    return make_run(street(), poses, LaserRangeFinder(beams=91), sigma=0.3)


@pytest.fixture(scope="module")
def room_run():
    room = make_world(ring([(0, 0), (12, 0), (12, 8), (0, 8)]), box(5, 3, 2, 2), name="room")
    poses = np.array([[2.0, 2.0, 0.5], [10.0, 6.0, -2.5]])
    return make_run(room, poses, LaserRangeFinder(beams=91, range_max=14.0), sigma=0.1)


def pixels(figure):
    """What the figure looks like: (height, width, 3) in 0…1."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3] / 255.0  # type: ignore[attr-defined]


def shows(figure, colour, *, at_least):
    """Whether so many pixels have just about this colour."""
    near = np.abs(pixels(figure) - to_rgb(colour)).max(axis=-1) < 0.02  # type: ignore[arg-type]
    return int(near.sum()) >= at_least


def texts(figure):
    found = [text.get_text() for text in figure.findobj(Text)]
    return [line for text in found for line in text.split("\n") if line]


def test_walls_that_cross_and_touch_without_a_common_end_are_drawn():
    # Thick walls as drawings have them: closed lines that abut, and one that crosses another.
    corner = ring([(0, 0), (6, 0), (6, 0.3), (0.3, 0.3), (0.3, 8), (0, 8)])
    walls = corner, box(0.3, 3, 4, 0.3), box(0, 9, 0.3, 4), box(2, -1, 0.3, 5)
    world = World(make_world(*walls).segments, np.zeros(18, int))
    figure = draw_map(make_run(world, around(-2, -2, 9, 6), LaserRangeFinder(beams=19)))
    assert shows(figure, INSIDE, at_least=1000)


def test_an_object_has_one_label_and_one_colour_at_all_noises(room_run):
    numbered_anew = replace(
        room_run,
        maps=(LineMap(room_run.map.segments, 1 - room_run.map.objects, room_run.map.points),),
    )
    figure = draw_noise_levels([room_run, numbered_anew], [0.07, 0.42])
    first, second = (
        {
            text.get_text(): (to_hex(text.get_color()), text.get_position())
            for text in axes.findobj(Text)
            if text.get_text() in ("G1", "G2")
        }
        for axes in figure.axes[1:]
    )
    assert first == second and len(first) == 2


def test_legends_name_only_what_is_there(run):
    nothing = replace(run, ranges=np.full_like(run.ranges, np.inf), maps=(LineMap.empty(),))
    assert not {"returns", "map, a colour for each object"} & set(texts(draw_map(nothing)))
    seen = texts(draw_world(run.world, scan=nothing.scan(0)))
    assert not {"beams", "returns"} & set(seen)
    assert "beams" in texts(draw_world(run.world, scan=nothing.scan(0), lrf=run.lrf))
    assert "true walls" not in texts(draw_world(World(np.empty((0, 4))), poses=np.zeros((1, 3))))


def test_the_truth_frames_the_picture_and_not_the_images_behind_mirrors(room_run):
    images = np.array([[40.0, 4.0], [-30.0, 90.0]])
    figure = draw_map(room_run.map, points=images, world=room_run.world)
    (left, right), (low, high) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    assert -2.0 < left < 0.0 and 12.0 < right < 14.0
    assert -2.0 < low < 0.0 and 8.0 < high < 10.0


def test_glass_and_mirrors_have_marks_and_names_of_their_own(room_run):
    kinds = np.array(["glass", "mirror"] + ["wall"] * (len(room_run.map) - 2))
    objects = room_run.map.objects
    figure = draw_map(LineMap(room_run.map.segments, objects, room_run.map.points, kinds))
    named = {name for name in texts(figure) if name.endswith(", map")}
    assert named == {"glass, map", "mirror, map"}
    styles = [str(each.get_linestyle()) for each in figure.axes[0].findobj(LineCollection)]
    assert len(styles) == len(set(styles)) == 3


def test_the_headline_counts_what_is_drawn(run):
    points = sum(len(scan.points()) for scan in run.scans)
    assert f"8 segments in 2 objects  ·  12 scans  ·  {points:,} returns" in texts(draw_map(run))
    assert "street" in texts(draw_map(run))


def test_a_map_alone_and_no_map_at_all_are_drawn(run):
    assert shows(draw_map(run.map), object_tints(np.array([0]))[0], at_least=500)
    assert "0 segments in 0 objects" in texts(draw_map(LineMap.empty()))
    assert "1 wall  ·  5 returns" in texts(
        draw_map(LineMap.empty(), points=np.ones((5, 2)), world=World([[0, 0, 1, 1]]))
    )


def test_a_world_shows_beams_returns_route_and_robot(room_run):
    figure = draw_world(
        room_run.world,
        scan=room_run.scan(0),
        lrf=room_run.lrf,
        route=np.array([[2.0, 2.0], [9.0, 1.0]]),
        poses=room_run.trajectory.poses,
    )
    assert {"p1", "p2", "beams", "returns", "route", "robot"} <= set(texts(figure))
    assert shows(figure, "#d6361f", at_least=500)
    assert shows(figure, "#16324f", at_least=100)


def test_a_world_without_walls_or_with_a_gap_in_its_numbers_is_drawn():
    assert "0 walls of 0 objects" in texts(draw_world(World(np.empty((0, 4)))))
    gap = World(np.vstack([box(0, 0, 2, 2), box(4, 0, 2, 2)]), np.repeat([1, 5], 4))
    assert [len(each.get_paths()) for each in filled(draw_world(gap))] == [2]


def filled(figure):
    found = figure.axes[0].findobj(PathCollection)
    return [each for each in found if to_hex(each.get_facecolor()[0]) == INSIDE]


def test_buildings_are_filled_and_rooms_are_not(room_run):
    assert [len(each.get_paths()) for each in filled(draw_world(street()))] == [2]
    assert [len(each.get_paths()) for each in filled(draw_map(room_run))] == [1]


def test_a_courtyard_stays_white():
    block = np.vstack([box(0, 0, 20, 20), box(5, 5, 10, 10)])
    figure = draw_world(World(block))
    image, extent = pixels(figure), figure.axes[0].get_window_extent()
    middle = image[int(figure.bbox.height - extent.y0 - 0.53 * extent.height)]
    row = middle[int(extent.x0) : int(extent.x1)]
    yard, house = row[int(0.53 * len(row))], row[int(0.15 * len(row))]
    assert yard.min() == 1.0
    assert to_hex(house) == INSIDE


def test_a_drive_is_a_line_and_scattered_poses_are_dots(run):
    poses = run.trajectory.poses
    assert "path" in texts(draw_map(run.map, poses=np.repeat(poses, 5, axis=0)))
    scattered = draw_map(run.map, poses=poses[[0, 6, 2, 8, 4, 10, 1, 7]])
    assert "poses" in texts(scattered)
    assert "path" not in texts(scattered)


@pytest.mark.parametrize("away", [(0.0, 0.0), AWAY])
def test_a_metre_is_as_long_both_ways_and_ticks_stay_short(away, room_run):
    figure = draw_world(street(*away))
    figure.canvas.draw()
    axes = figure.axes[0]
    box_ = axes.get_window_extent()
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    assert box_.width / (right - left) == pytest.approx(box_.height / (high - low), rel=1e-6)
    assert all(len(label.get_text()) <= 5 for label in axes.get_xticklabels())
    assert axes.get_xlabel() == "x [m]"


def tower_run():
    tower = make_world(ring([(0, 0), (3, 0), (3, 60), (0, 60)]), box(1, 30, 1, 1), name="tower")
    poses = np.column_stack([np.full(20, 0.6), np.linspace(2, 50, 20), np.full(20, 1.5)])
    return make_run(tower, poses, LaserRangeFinder(beams=31), sigma=0.1)


@pytest.mark.parametrize("picture", ["map", "room", "noise", "long", "tall", "named"])
def test_no_text_leaves_the_sheet_or_overlaps_another(picture, run, room_run):
    poses = room_run.trajectory.poses
    figure = {
        "map": lambda: draw_map(run),
        "room": lambda: draw_world(room_run.world, scan=room_run.scan(0), poses=poses),
        "noise": lambda: draw_noise_levels([room_run] * 3, [0.07, 0.42, 0.63]),
        "long": lambda: draw_world(World(np.array([[0.0, 0.0, 100.0, 0.0]]))),
        "tall": lambda: draw_world(World(np.array([[0.0, 0.0, 0.0, 100.0]]))),
        "named": lambda: draw_map(tower_run(), title="a tall place with a long name " * 4),
    }[picture]()
    dark = pixels(figure).min(axis=-1)[::-1] < 0.7
    found = []
    for text in figure.findobj(Text):
        extent = text.get_window_extent()
        columns, rows = slice(int(extent.x0), int(extent.x1)), slice(int(extent.y0), int(extent.y1))
        # Labels of ticks beyond the ends of an axis have a place, but no ink.
        beyond = extent.x1 < 0.0 or extent.y1 < 0.0
        if text.get_text() and not beyond and dark[rows, columns].any():
            found.append((text.get_text(), *extent.extents))
    assert len(found) > 10
    corners = np.array([place for _, *place in found])
    assert corners.min() >= 0.0
    assert (corners[:, 2:] <= figure.bbox.size).all()
    meet = (corners[:, None, :2] < corners[None, :, 2:]).all(axis=-1)
    overlapping = np.argwhere(np.triu(meet & meet.T, 1))
    assert not [(found[first][0], found[second][0]) for first, second in overlapping]


def test_very_many_points_are_thinned():
    cloud = np.random.default_rng(0).uniform(0, 1, (3 * MOST_POINTS + 1, 2))
    shown = lrf3d.plot.points(cloud, Figure().add_subplot()).lines[0].get_xdata()
    assert MOST_POINTS // 2 < len(shown) <= MOST_POINTS


def test_pictures_are_written_whole_and_alike(tmp_path, run):
    first, second = tmp_path / "map.png", tmp_path / "again.png"
    draw_map(run, first)
    draw_map(run, second)
    assert first.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.png", "map.png"]


def test_a_figure_that_cannot_be_written_is_reported(tmp_path, run):
    with pytest.raises(OutputError, match="missing"):
        draw_map(run, tmp_path / "missing" / "map.png")
    with pytest.raises(OutputError, match=r"map\.bmx.*\.png"):
        draw_map(run, tmp_path / "map.bmx")
    assert not list(tmp_path.iterdir())


def test_object_tints_are_apart_and_belong_to_their_numbers():
    town = object_tints(np.arange(60))
    assert (town >= 0.0).all() and (town <= 1.0).all()
    assert np.linalg.norm(1.0 - town, axis=1).min() > 0.5
    # Of a town of sixty objects no two look alike, and the first ones less so.
    apart = np.linalg.norm(town[:, None] - town[None], axis=-1) + 9.0 * np.eye(60)
    assert apart.min() > 0.05 and apart[:6, :6].min() > 0.2 and apart[0, 21] > 0.15
    np.testing.assert_array_equal(object_tints(np.array([7, 2])), town[[7, 2]])
