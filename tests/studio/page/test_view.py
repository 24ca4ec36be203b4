"""Runs and worlds in the browser: the page is there, draws, plays and obeys."""

import re
import sys
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest
from browser import needs_browser, number, opened, picture, served
from PIL import Image
from test_glb import simulated
from test_render import city_run
from waiting import until
from yard import OBSTACLE, YARD

from lrf3d import (
    MissingLibraryError,
    OutputError,
    World,
    export_run,
    load_run,
    load_scenario,
    save_run,
)
from lrf3d.studio.page.hand_drive import HandDrive
from lrf3d.studio.page.page_file import page_file
from lrf3d.studio.page.server import bound, run_view, serve, world_view
from lrf3d.studio.scene.timeline import Timeline


@pytest.fixture
def yard(written):
    return written("yard.toml", YARD)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    run = simulated("paper_room", 1)
    save_run(run, folder / "run.npz")
    return run, folder


@pytest.fixture(scope="module")
def played(recorded):
    """The address where the run is shown."""
    with served(recorded[1]) as address:
        yield address


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The address where the yard is shown."""
    path = tmp_path_factory.mktemp("driven") / "yard.toml"
    path.write_text(YARD + OBSTACLE)
    with served(path) as address:
        yield address


def orange(pixels):
    """Which pixels have the robot's colour."""
    red, green, blue = np.moveaxis(pixels, -1, 0)
    return (red > 180) & (green > 70) & (green < 150) & (blue < 70)


# In the browser ---------------------------------------------------------------------------------


@needs_browser
def test_the_page_of_a_run_draws_plays_and_is_scrubbed(recorded, played, chromium):
    run, _ = recorded
    with opened(chromium, played) as page:
        # It plays by itself.
        until(lambda: number(page, "t") > 0.2)
        assert page.get_attribute("[data-view=story]", "aria-pressed") == "true"
        page.click("[data-view=follow]")
        # The robot is in the middle.
        middle = (slice(190, 310), slice(280, 380))
        until(lambda: orange(picture(page)[middle]).sum() > 35)
        assert picture(page).std(axis=(0, 1)).min() > 20.0
        # From the start again: on a busy machine the run is over by now.
        page.keyboard.press("Home")
        if page.get_attribute(".lrf3d-play", "aria-label") == "play":
            page.click("[aria-label=play]")
        page.click("[aria-label=pause]")
        assert page.get_attribute(".lrf3d-play", "aria-label") == "play"
        # The end of the run, with its map, as the file has them.
        page.keyboard.press("End")
        until(lambda: number(page, "t") == pytest.approx(page_end(run), abs=0.06))
        shown = page.inner_text(".lrf3d-map")
        assert shown == f"{len(run.map)} segments in {run.map.object_count} objects"
        x, y, theta = run.trajectory.poses[-1]
        assert (number(page, "x"), number(page, "y")) == pytest.approx((x, y), abs=0.006)
        assert np.cos(np.radians(number(page, "theta")) - theta) > 0.999
        # A click in the middle of the slider is the middle of the run.
        page.locator(".lrf3d-slider").click()
        until(lambda: number(page, "t") == pytest.approx(page_end(run) / 2, abs=0.3))
        page.keyboard.press("Home")
        until(lambda: number(page, "t") == 0.0)
        page.keyboard.press("Space")
        until(lambda: number(page, "t") > 0.0)


@pytest.mark.slow
@needs_browser
def test_the_page_lists_its_keys_and_saves_pictures(played, chromium):
    with opened(chromium, played) as page:
        until(lambda: number(page, "t") > 0.0)
        assert not page.is_visible(".lrf3d-keys")
        page.keyboard.press("h")
        until(lambda: page.is_visible(".lrf3d-keys"))
        assert "full screen" in page.inner_text(".lrf3d-keys")
        page.click("[data-do=list]")
        until(lambda: not page.is_visible(".lrf3d-keys"))
        with page.expect_download() as download:
            page.keyboard.press("p")
        assert re.fullmatch(r"paper_room.*_[\d.]+s\.png", download.value.suggested_filename)
        with Image.open(download.value.path()) as saved:
            assert np.asarray(saved.convert("RGB")).std() > 20.0
        page.keyboard.press("f")
        until(lambda: page.evaluate("Boolean(document.fullscreenElement)"))
        page.click("[data-do=full]")
        until(lambda: not page.evaluate("Boolean(document.fullscreenElement)"))


@pytest.mark.slow
@needs_browser
def test_a_run_as_one_file_shows_what_its_page_shows_without_a_server(
    recorded, played, chromium, tmp_path
):
    run, _ = recorded
    path = tmp_path / "run.html"
    export_run(run, "html", path)
    assert path.stat().st_size < 3e6
    seen = {}
    # The file needs no time to answer; what the server answers late is waited for.
    for address in (path.as_uri(), played):
        with opened(chromium, address) as page:
            # At its end it plays no more.
            for key, views in (("End", ["top", "follow"]), ("Home", ["first", "follow"])):
                page.keyboard.press(key)
                end = pytest.approx(page_end(run) if key == "End" else 0.0, abs=0.06)
                until(partial(lambda page, end: number(page, "t") == end, page, end))
                for view in views:
                    page.click(f"[data-view={view}]")
                    seen[key, view] = until(partial(still, page, seen.get((key, view))))
            # Turned by hand, upward too.
            page.mouse.move(330, 110)
            page.mouse.down()
            page.mouse.move(420, 150, steps=4)
            page.mouse.up()
            page.mouse.wheel(0, 200)
            seen["turned"] = until(partial(still, page, seen.get("turned")))
    assert min(pixels.std() for pixels in seen.values()) > 20.0


@pytest.mark.slow
def test_a_page_has_the_same_bytes_whenever_it_is_written(recorded, monkeypatch):
    written = set()
    for now in (1e9, 1.7e9):
        monkeypatch.setattr("time.time", lambda now=now: now)
        written.add(page_file(recorded[0], every=50))
    assert len(written) == 1


def page_end(run):
    """How long a run plays [s]."""
    timeline = Timeline(run, playback=1.0)
    return timeline.end - timeline.start


def still(page, like=None):
    """The page, once two pictures in a row are the same, and like another if one is given."""
    before = picture(page)
    after = picture(page)
    alike = like is None or np.abs(after - like).mean() < 2.0
    return after if alike and np.array_equal(before, after) else None


@pytest.mark.slow
@needs_browser
def test_the_name_of_a_world_is_escaped_in_the_page(tmp_path, chromium):
    run = city_run()
    name = "</title><script>seen = 1</script><img src=x onerror='seen = 2'>{{seen = 3}}`${1}`"
    walls = run.world
    save_run(
        replace(run, world=World(walls.segments, walls.objects, walls.heights, name)),
        tmp_path / "run.npz",
    )
    with served(tmp_path) as address, opened(chromium, address) as page:
        until(lambda: number(page, "t") > 0.0)
        assert page.inner_text(".lrf3d-title") == f"lrf3d {name}"
        assert page.title() == f"lrf3d {name}"
        assert page.evaluate("typeof seen") == "undefined"


@pytest.mark.slow
@needs_browser
def test_a_click_on_the_ground_sends_the_robot_there(driven, chromium):
    with opened(chromium, driven) as page:
        until(lambda: number(page, "x") == 2.0)
        page.click("[data-view=top]")
        until(lambda: page.get_attribute("[data-view=top]", "aria-pressed") == "true")
        # The robot, which the other view follows, is in the middle no more, but left of it.
        until(lambda: not orange(picture(page)[:240, 300:400]).any())
        page.mouse.click(330, 170)
        until(lambda: number(page, "x") > 2.3)
        page.click(".lrf3d-again")
        until(lambda: number(page, "x") == 2.0)


@pytest.mark.slow
@needs_browser
def test_keys_and_pads_drive_the_robot_through_a_world(driven, chromium):
    with opened(chromium, driven) as page:
        until(lambda: number(page, "x") == 2.0)
        until(lambda: picture(page).std(axis=(0, 1)).min() > 20.0)
        page.keyboard.down("ArrowUp")
        until(lambda: number(page, "x") > 3.5)
        page.keyboard.up("ArrowUp")
        until(lambda: number(page, "v") == 0.0)
        assert number(page, "y") == 3.0 and number(page, "theta") == 0.0
        assert re.search(r"^\d+ / 61 beams hit", page.inner_text(".lrf3d-beams"))
        assert re.search(r"^[1-9]\d* segments? in ", page.inner_text(".lrf3d-map"))
        page.keyboard.down("ArrowLeft")
        until(lambda: number(page, "theta") > 45.0)
        page.keyboard.up("ArrowLeft")
        page.keyboard.down("KeyS")
        until(lambda: number(page, "v") < -0.5 or page.is_visible(".lrf3d-stop"))
        # The wall behind it stops it.
        page.get_by_text("a wall is in the way").wait_for()
        page.keyboard.up("KeyS")
        assert number(page, "y") > 0.3
        page.click(".lrf3d-again")
        until(lambda: (number(page, "x"), number(page, "y")) == (2.0, 3.0))


@pytest.mark.parametrize("size", [(360, 740), pytest.param((740, 360), marks=pytest.mark.slow)])
@needs_browser
def test_the_page_fits_a_telephone(driven, chromium, size):
    wide, tall = size
    phone = {"has_touch": True, "is_mobile": True}
    with opened(chromium, driven, size, **phone) as page:
        until(lambda: number(page, "x") == 2.0)
        boxes = {
            name: page.locator(f".lrf3d-{name}").bounding_box()
            for name in ("hud", "inset", "bar", "pads")
        }
        for name, box in boxes.items():
            assert box["x"] >= 0 and box["x"] + box["width"] <= wide, name
            assert box["y"] >= 0 and box["y"] + box["height"] <= tall, name
        for one, other in combinations(boxes.values(), 2):
            apart = [
                max(one[at] - other[at] - other[size], other[at] - one[at] - one[size]) >= 0
                for at, size in (("x", "width"), ("y", "height"))
            ]
            assert any(apart)
        # The robot is over the pads; they are large enough, have names, and obey the keyboard.
        until(lambda: orange(picture(page)[150:]).sum() > 60)
        rows, columns = np.nonzero(orange(picture(page)[150:]))
        pads = boxes["pads"]
        assert not ((rows + 150 > pads["y"]) & (columns > pads["x"])).any()
        for button in page.locator("button:visible, select:visible").all():
            box = button.bounding_box()
            assert min(box["width"], box["height"]) >= 44
            assert button.get_attribute("aria-label") or button.inner_text()
        page.focus("[data-pad=ahead]")
        page.keyboard.down("Space")
        until(lambda: number(page, "v") > 0.2)
        page.keyboard.up("Space")
        until(lambda: number(page, "v") == 0.0)


# Without it -------------------------------------------------------------------------------------


def test_kernels_are_compiled_before_the_page_of_a_world_opens(yard, monkeypatch):
    steps = []
    step = HandDrive.step
    monkeypatch.setattr(HandDrive, "step", lambda *of: steps.append(of) or step(*of))
    shown = world_view(load_scenario(yard), seed=0)()
    assert len(steps) == 1 and shown.drive.robot.pose == (2.0, 3.0, 0.0)
    assert (shown.setup()["title"], shown.setup()["mode"]) == ("yard", "drives")


def test_the_page_of_a_run_is_that_of_its_world(recorded):
    run, folder = recorded
    setup = run_view(load_run(folder), None)().setup()
    assert setup["mode"] == "plays" and setup["end"] == pytest.approx(page_end(run))
    assert setup["speed"] == run.film.playback


def test_a_port_that_is_taken_is_named():
    with bound("127.0.0.1", None) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OutputError, match=f"--port {port}"):
            bound("127.0.0.1", port)


def test_without_the_server_library_the_error_names_the_extra(yard, monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets.asyncio.server", None)
    make = world_view(load_scenario(yard), seed=0)
    with bound("127.0.0.1", None) as door:
        with pytest.raises(MissingLibraryError, match=r"pip install -e .*\[view\]"):
            serve(make, door, host="127.0.0.1")
