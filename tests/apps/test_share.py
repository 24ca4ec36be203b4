"""A run as one page to send to others."""

import re

import pytest

import lrf3d
from lrf3d.apps import export
from lrf3d.studio.page import page_file


@pytest.fixture(scope="module")
def run():
    return lrf3d.load_scenario("paper_room").run(rng=0)


@pytest.mark.slow
def test_a_shared_page_is_small_whole_and_has_a_picture_for_previews(run, tmp_path):
    every = export.share_run(run, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text()
    assert every == 1 and len(page) < 3e6
    assert len(page_file.page_file(run, every=32)) < 0.5 * len(page)
    assert re.search(r'<meta property="og:image" content="data:image/png;base64,\w', page)
    assert "src=" not in re.sub(r'(href|src)="data:[^"]*"', "", page.split("<body")[0])


def test_a_page_that_would_be_too_large_keeps_fewer_moments(run, tmp_path, monkeypatch):
    def page_of(size):
        return lambda run, *, every=1, preview: bytes(size // every)

    monkeypatch.setattr(export, "_LARGEST_PAGE", 300)
    for size, every in ((300, 1), (2000, 8), (90_000, 32)):
        monkeypatch.setattr(page_file, "page_file", page_of(size))
        assert export.share_run(run, tmp_path / "run.html") == every
    with pytest.raises(lrf3d.InputError, match=r"ends in \.html"):
        export.share_run(run, tmp_path / "run.htm")
