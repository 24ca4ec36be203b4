"""Where panel and inset of a film go, and what is seen from above beside them."""

import numpy as np
import pytest
from test_render import city_run, room_run

from lrf3d.render.hud import font, hud_lines, panel_size, rounded, widest_lines
from lrf3d.render.layout import LEAST_SCALE, lay_out
from lrf3d.scene.camera import Top
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline

SIZES = [
    (390, 844), (1080, 1920), (320, 180), (64, 64), (16, 16), (640, 360), (500, 500), (200, 400),
    (1280, 720), (3840, 2160), (2000, 100), (100, 2000), (720, 720),
]  # fmt: skip
RUNS = {
    "short": room_run(),
    "long": city_run((85000.0, 447500.0)),
}


def boxes(size, lines):
    """Left, top, right and bottom of the panel and of the inset, where they are."""
    layout = lay_out(size, lines)
    found = []
    if layout.scale is not None:
        gap, (wide, high) = layout.gap, panel_size(lines, layout.scale)
        found.append((gap, gap, gap + wide, gap + high))
    if layout.inset is not None:
        left, top, side = layout.inset
        found.append((left, top, left + side, top + side))
    return layout, found


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@pytest.mark.parametrize("size", SIZES)
def test_panel_and_inset_lie_in_the_picture_and_never_over_each_other(size, run):
    layout, found = boxes(size, widest_lines(run))
    for left, top, right, bottom in found:
        assert 0 <= left < right <= size[0] and 0 <= top < bottom <= size[1]
    if len(found) == 2:
        (_, _, right, bottom), (left, top, _, _) = found
        assert right < left or bottom < top
    assert layout.scale is None or layout.scale >= LEAST_SCALE
    if size[0] >= 320 and size[1] >= 180:
        assert len(found) == 2


def test_a_wide_picture_is_laid_out_as_ever():
    layout, _ = boxes((1280, 720), widest_lines(RUNS["short"]))
    assert layout.scale == 1.0 and layout.inset == (1280 - 16 - 259, 16, 259)


@pytest.mark.parametrize("size", SIZES)
def test_from_above_the_whole_world_is_in_the_middle_and_beside_the_panel_if_it_can(size):
    run = room_run()
    timeline, structures = Timeline(run), Structures.from_run(run)
    layout = lay_out(size, widest_lines(run))
    aspect = size[0] / size[1]
    look = Top(timeline, structures, layout.covered).look(0.0, aspect)
    # Half the height of what is seen on the ground [m].
    half = look.eye[2] * np.tan(0.5 * look.field)
    right = np.cross(look.up, [0.0, 0.0, 1.0])
    ends = structures.segments.reshape(-1, 2) - look.target[:2]
    x, y = (ends @ way[:2] / half for way in (right, np.array(look.up)))
    assert (np.abs(x) <= aspect).all() and (np.abs(y) <= 1.0).all()
    assert x.max() == pytest.approx(-x.min()) and y.max() == pytest.approx(-y.min())
    wide, high = layout.covered
    fill = max(x.max() / aspect, y.max())
    freed = ((x > -aspect + 2.0 * wide) | (y < 1.0 - 2.0 * high)).all()
    # Where the panel's corner cannot be freed, the world is hardly smaller than the picture.
    assert freed or fill == pytest.approx(1.0 / Top.SMALLER, rel=0.03)


def test_a_large_world_is_followed_with_as_much_to_the_shorter_side_in_portrait():
    run = room_run()
    top = Top(Timeline(run), Structures.from_run(run))
    top.WHOLE = 1.0
    wide, tall = (top.look(0.0, aspect) for aspect in (16 / 9, 9 / 16))
    assert tall.eye[2] - 2.5 == pytest.approx((wide.eye[2] - 2.5) * 16 / 9)


def test_no_number_of_the_panel_is_minus_zero():
    assert rounded(-0.004, 2) == "0.00" and rounded(-0.006, 2) == "-0.01"
    run = room_run()
    moment = Timeline(run).moment(0.0)
    moment.pose[:] = [-0.001, 0.0, -1e-4]
    lines = hud_lines(run, moment, run.scan(0), run.map.counts, 4.0)
    words = [text for line in lines for _, text in line.ends]
    assert words.count("0.00") == 2 and "0.0°" in words and "-0.00" not in words


def test_numbers_of_the_panel_stand_under_each_other_and_it_says_how_fast_it_plays():
    run = city_run()
    time, pose = (
        next(line for line in hud_lines(run, moment, run.scan(3), "9 segments in 3 objects", 4.0)
             if line.words[0][1] == first)
        for first, moment in (("t", Timeline(run).moment(1.0)), ("x", Timeline(run).moment(3.0)))
    )  # fmt: skip
    assert [end for end, _ in time.ends] == [end for end, _ in pose.ends][:2]
    words = [
        text
        for line in hud_lines(run, Timeline(run).moment(1.0), run.scan(3), "9 segments", 4.0)
        for _, text in (*line.words, *line.ends)
    ]
    assert "4 ×" in words and "9 segments" in words


def test_a_world_with_a_long_name_keeps_the_panel_short():
    run = room_run()
    object.__setattr__(run.world, "name", "a" * 300)
    assert panel_size(widest_lines(run), 1.0)[0] < 600


@pytest.mark.parametrize("name", ["a", "freiburg-079-odometry", "W" * 24, "a" * 300, "两" * 30])
def test_the_name_of_a_world_ends_before_how_fast_it_plays(name):
    run = room_run()
    object.__setattr__(run.world, "name", name)
    title = widest_lines(run, 12.5)[0]
    (begin, words), (next_begin, _) = title.placed(26)
    assert begin + font(26, bold=True).getlength(words) < next_begin
    assert words.startswith(f"lrf3d  {name[:3]}")
