"""The editor's page: a world is drawn and a drawing corrected by mouse and keyboard alone."""

from functools import partial

import numpy as np
import pytest
from browser import needs_browser, opened, served
from PIL import Image, ImageDraw, ImageOps
from waiting import until

from lrf3d.plans.edits import read_edits

DRAWING = """<svg width="10m" height="8m" viewBox="0 0 1000 800" fill="none" stroke="black">
<g id="walls"><rect x="100" y="100" width="800" height="600"/></g>
<g id="shelf"><path stroke="#ff0000" d="M300 300 h200 v100 h-200 z"/></g></svg>"""


def place(page, x, y):
    """Where a place [m] is on the page [pixels], once what was decided is drawn."""
    until(lambda: page.evaluate("!editor.pending"))
    box = page.locator(".lrf3d-top").bounding_box()
    across, down = page.evaluate("point => editor.sheet.toScreen(point)", [x, y])
    return box["x"] + across, box["y"] + down


def click(page, *point):
    page.mouse.move(*place(page, *point))
    page.mouse.click(*place(page, *point))


def drag(page, one, two):
    page.mouse.move(*place(page, *one))
    page.mouse.down()
    page.mouse.move(*place(page, *two), steps=3)
    page.mouse.up()


def kept(page, journal):
    """The decisions in the file, once the page says that they are saved."""
    until(lambda: page.inner_text(".lrf3d-saved").endswith(", saved"))
    return read_edits(journal).as_dict()


@pytest.mark.slow
@needs_browser
def test_a_world_is_drawn_from_nothing_by_mouse_and_keyboard(tmp_path, chromium):
    path = tmp_path / "new.toml"
    journal = tmp_path / "new.toml.edit.toml"
    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        page.keyboard.press("b")
        drag(page, (2, 2), (8, 6))
        (room,) = kept(page, journal)["wall"]
        assert room["closed"] and room["points"][2] == pytest.approx([8, 6], abs=0.03)
        # A wall from side to side: it begins on the lower wall, and is level with the sheet.
        page.keyboard.press("w")
        click(page, 5, 2.05)
        click(page, 5.03, 6.02)
        page.keyboard.press("Enter")
        until(lambda: len(read_edits(journal).as_dict()["wall"]) == 2)
        (x1, y1), (x2, y2) = read_edits(journal).as_dict()["wall"][1]["points"]
        assert (x1, y1) == pytest.approx((x2, room["points"][0][1]), abs=1e-3)
        assert y2 == pytest.approx(room["points"][2][1], abs=0.06)
        page.keyboard.press("d")
        click(page, 5, 4)
        until(lambda: "doorway" in read_edits(journal).as_dict())
        page.keyboard.press("Control+z")
        until(lambda: "doorway" not in read_edits(journal).as_dict())
        page.keyboard.press("Control+Shift+z")
        until(lambda: "doorway" in read_edits(journal).as_dict())
        page.keyboard.press("r")
        drag(page, (3, 3), (3.8, 3))
        # The words about a beam go when the plan with the robot comes.
        page.mouse.move(*place(page, 4, 3))
        until(lambda: "beams hit" in page.inner_text(".lrf3d-over"))
        page.keyboard.press("Control+s")
        until(lambda: path.exists() and not page.inner_text(".lrf3d-old"))
        page.keyboard.press("g")
        click(page, 7, 5)
        until(lambda: read_edits(journal).as_dict().get("robot", {}).get("route"))
        page.keyboard.press("k")
        # An area may be thin: its corners are not drawn into line.
        drag(page, (6.5, 2.5), (7.5, 2.62))
        until(lambda: read_edits(journal).as_dict().get("keep_out"))
        (area,) = read_edits(journal).as_dict()["keep_out"]
        assert np.ptp(area["points"], axis=0) == pytest.approx([1.0, 0.12], abs=0.04)
        until(lambda: page.inner_text(".lrf3d-rooms") == "2 rooms, 2 reached")
        until(lambda: page.evaluate("(editor.sheet.route ?? []).length > 1"))


@pytest.mark.slow
@needs_browser
def test_what_is_named_under_the_mouse_is_what_is_selected_and_erased(tmp_path, chromium):
    path = tmp_path / "new.toml"
    journal = tmp_path / "new.toml.edit.toml"

    def walls(count):
        """The walls that were decided, once there are as many."""
        until(lambda: journal.exists() and len(read_edits(journal).as_dict()["wall"]) == count)
        return read_edits(journal).as_dict()["wall"]

    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        drag(page, (2, 2), (8, 6))
        (room,) = walls(1)
        assert room["points"] == [[2, 2], [8, 2], [8, 6], [2, 6]], "on the grid"
        page.keyboard.press("v")
        click(page, 8, 4)
        assert "one side, 4.00 m" in page.inner_text(".lrf3d-picked")
        page.get_by_label("made of").select_option("mirror")
        assert walls(2)[1] == {"points": [[8, 2], [8, 6]], "material": "mirror"}
        page.keyboard.press("e")
        page.mouse.move(*place(page, 8, 3))
        until(lambda: "4.00 m: mirror" in page.inner_text(".lrf3d-over"))
        click(page, 8, 3)
        assert walls(1) == [room], "the wall behind it stays"
        # The mouse does not move: what is under it is named once it is another.
        until(lambda: page.inner_text(".lrf3d-over") == "one side, 4.00 m: wall (drawn)")
    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        until(lambda: page.inner_text(".lrf3d-rooms") == "1 room, 1 reached")
        assert page.locator(".lrf3d-ask").is_hidden()


@needs_browser
def test_a_drawing_is_scaled_and_what_was_misunderstood_is_corrected(written, tmp_path, chromium):
    path = written("room.svg", DRAWING)
    journal = tmp_path / "room.svg.edit.toml"
    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        page.keyboard.press("s")
        click(page, 1, 1)
        click(page, 9, 1)
        page.keyboard.type("far")
        page.keyboard.press("Enter")
        assert "such as 0.9" in page.inner_text(".lrf3d-ask")
        page.keyboard.press("Escape")
        assert page.locator(".lrf3d-ask").is_hidden()
        click(page, 1, 1)
        click(page, 9, 1)
        page.keyboard.type("4")
        page.keyboard.press("Enter")
        scale = kept(page, journal)["scale"]
        assert scale == {"between": [[100, 100], [900, 100]], "metres": 4.0}
        # The shelf is half as far away now. All of its colour is furniture.
        click(page, 1.5, 2.5)
        assert "on shelf" in page.inner_text(".lrf3d-picked")
        page.get_by_label("all of this colour").check()
        page.click("[data-kind=furniture]")
        until(lambda: read_edits(journal).as_dict().get("class"))
        chosen = read_edits(journal).as_dict()["class"]
        assert chosen == [{"select": {"colour": "#ff0000"}, "as": "furniture"}]
        # A second page only reads.
        with opened(chromium, address, (1000, 640)) as other:
            until(lambda: "only shows it" in other.inner_text(".lrf3d-notice"))
        path.write_text(DRAWING.replace("h200", "h210"))
        until(lambda: "has changed" in page.inner_text(".lrf3d-notice"))


@pytest.mark.slow
@needs_browser
def test_a_drag_of_the_threshold_is_one_step(tmp_path, chromium):
    path = tmp_path / "flat.png"
    ImageOps.expand(Image.new("L", (160, 120), 255), 4, 0).save(path)
    journal = tmp_path / "flat.png.edit.toml"

    def threshold_is(value):
        if not journal.exists():
            return False
        return read_edits(journal).as_dict().get("reading", {}).get("threshold") == value

    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        page.locator(".lrf3d-threshold").wait_for()
        box = page.locator(".lrf3d-threshold").bounding_box()
        across = box["y"] + box["height"] / 2
        page.mouse.move(box["x"] + box["width"] / 2, across)
        page.mouse.down()
        for share, threshold in ((0.6, 152), (0.7, 177)):
            page.mouse.move(box["x"] + share * box["width"], across)
            until(partial(threshold_is, pytest.approx(threshold, abs=9)))
        page.mouse.up()
        page.keyboard.press("Control+z")
        until(partial(threshold_is, None))


@needs_browser
def test_furniture_that_was_left_out_of_a_picture_is_made_solid_by_a_click_and_a_key(
    tmp_path, chromium
):
    path = tmp_path / "flat.png"
    picture = ImageOps.expand(Image.new("L", (160, 120), 255), 4, 0)
    ImageDraw.Draw(picture).rectangle((40, 40, 56, 50), 225)
    picture.save(path)
    journal = tmp_path / "flat.png.edit.toml"
    with served(path, command="edit") as address, opened(chromium, address, (1000, 640)) as page:
        # The page begins with the question of the scale.
        until(lambda: page.evaluate("Boolean(editor.sheet.picture)"))
        page.keyboard.press("v")
        click(page, *page.evaluate("[48, 83].map((pixels) => pixels * editor.sheet.plan.unit)"))
        page.keyboard.press("2")
        (box,) = kept(page, journal)["wall"]
        assert box["closed"] and box["height"] == 0.8 and len(box["points"]) == 4
