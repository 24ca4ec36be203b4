"""A run as one page to send to others."""

import re

import pytest

import lrf3d
from lrf3d.apps import export


@pytest.fixture(scope="module")
def run():
    return lrf3d.load_scenario("paper_room").run(rng=0)


@pytest.mark.slow
def test_a_shared_page_is_small_whole_and_has_a_picture_for_previews(run, tmp_path):
    every = export.share_run(run, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text()
    assert every == 1 and len(page) < 3e6
    assert re.search(r'<meta property="og:image" content="data:image/png;base64,\w', page)
    assert "src=" not in re.sub(r'(href|src)="data:[^"]*"', "", page.split("<body")[0])


@pytest.mark.slow
def test_a_page_that_would_be_too_large_keeps_fewer_moments(run, tmp_path, monkeypatch):
    monkeypatch.setattr(export, "_LARGEST_PAGE", 100_000)
    assert export.share_run(run, tmp_path / "run.html") == 32
    with pytest.raises(lrf3d.InputError, match=r"ends in \.html"):
        export.share_run(run, tmp_path / "run.htm")
