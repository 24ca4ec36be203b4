"""The estimate in the browser."""

import numpy as np
import pytest
from browser import needs_browser, number, opened, picture, served, started, until
from estimates import estimated
from test_render import city_run

from lrf3d.io import save_run
from lrf3d.view.page_data import pack_run


@pytest.mark.slow
@needs_browser
def test_the_page_shows_truth_and_estimate(tmp_path):
    save_run(estimated(city_run()), tmp_path / "run.npz")
    with served(tmp_path) as at, started() as browser, opened(browser, at) as page:
        until(lambda: number(page, "t") > 0.2)
        page.click("[aria-label=pause]")
        page.keyboard.press("End")
        until(lambda: "0.50 m off" in page.inner_text(".lrf3d-believed"))
        assert "truth" in page.inner_text(".lrf3d-truth")
        page.click(".lrf3d-view-top")
        until(lambda: pink(picture(page)).sum() > 60)


def pink(pixels):
    """Which pixels have the colour of the estimate."""
    red, green, blue = np.moveaxis(pixels.astype(int), -1, 0)
    return (red > green + 100) & (blue > green + 60)


def unpacked(run):
    block, told = pack_run(run)
    return {
        name: np.frombuffer(block, kind, length, begin)
        for name, (kind, begin, length) in told["layout"].items()
    }


def test_the_page_gets_what_the_robot_believed():
    run = estimated(city_run())
    arrays = unpacked(run)
    places = arrays["estimatePlaces"].reshape(-1, 2) + run.world.origin
    assert places == pytest.approx(run.estimate.poses[:, :2], abs=1e-4)
    shapes = arrays["ellipseShapes"].reshape(-1, 2, 2)
    assert shapes == pytest.approx(run.estimate.ellipses, rel=1e-5)
    assert len(arrays["ellipseTimes"]) == len(shapes)
    told = pack_run(run)[1]
    assert told["knowsTruth"] and told["legend"] == ["truth", "estimate, 95 %"]
    assert not pack_run(city_run())[1]["legend"]
