"""The page of the paper holds every figure and claim, and needs no other file."""

import base64
import io
import json
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from typer.testing import CliRunner

from benchmarks.page import embed_figure
from benchmarks.paper import report as report_module
from benchmarks.paper.__main__ import app
from benchmarks.paper.city import drive_through, film_claim, speed_claim
from benchmarks.paper.claim import Claim, Extent, Picture
from benchmarks.paper.report import STEPS, PaperReport, page_text, redo_paper
from benchmarks.paper.use import grid_claim, polyline_claim
from benchmarks.result import Table
from lrf3d.errors import MissingLibraryError
from lrf3d.render import video

TINY = Extent(seeds=2, city_seeds=2, every=200, scans=8, towns=(100,), robots=1, film=(320, 180))


class Page(HTMLParser):
    """What a page refers to, and what it says."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.references, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        names = {"src", "href", "srcset", "data", "poster", "action"}
        self.references += [value for name, value in attributes if name in names]

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def paper():
    """A tiny report, and the steps that it reported."""
    heard = []
    frame = np.zeros((180, 320, 3), dtype=np.uint8)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(video, "frame", lambda run, time, *, size: frame)
        report = redo_paper(TINY, progress=lambda *step: heard.append(step))
    return report, heard


@pytest.mark.slow
def test_every_figure_of_the_paper_is_on_the_page_and_nothing_outside(paper):
    report, heard = paper
    text = page_text(report)
    page = Page(text)
    pictures = [picture for claim in report.claims for picture in claim.pictures]
    embedded = [each for each in page.references if each.startswith("data:image/")]
    assert embedded == [picture.data for picture in pictures]
    links = [each for each in page.references if not each.startswith("data:image/")]
    assert set(links) == {f"#{claim.name}" for claim in report.claims}
    assert not {"script", "link", "iframe", "object", "base"} & set(page.tags)
    assert not re.search(r"url\(|@import|https?://", re.sub(r'src="data:[^"]*"', "", text))
    captions = " ".join(picture.caption for picture in pictures)
    for figure in (
        "Fig. 5 a redone", "Fig. 5 redone in robust mode", "Fig. 5 redone in paper mode",
        "Fig. 6 redone", "Fig. 7 redone in robust mode", "Fig. 7 redone in paper mode",
    ):  # fmt: skip
        assert figure in captions
    assert heard == [(step, STEPS) for step in range(1, STEPS + 1)]


@pytest.mark.slow
def test_every_picture_opens(paper):
    for claim in paper[0].claims:
        for picture in claim.pictures:
            kind, content = re.fullmatch(
                r"data:image/(svg\+xml|png|jpeg);base64,(.*)", picture.data
            ).groups()
            data = base64.b64decode(content)
            if kind == "svg+xml":
                tree = ElementTree.fromstring(data)
                assert tree.tag.endswith("svg") and len(list(tree.iter())) > 50
                hrefs = [v for e in tree.iter() for n, v in e.items() if n.endswith("href")]
                assert all(value.startswith(("#", "data:")) for value in hrefs)
            else:
                Image.open(io.BytesIO(data)).verify()


@pytest.mark.slow
def test_every_claim_has_what_was_said_measured_and_when_it_holds(paper):
    report, _ = paper
    names = [claim.name for claim in report.claims]
    assert names == [
        "scan", "maps", "robustness", "grid", "polylines", "film", "city", "search",
        "localisation", "speed",
    ]  # fmt: skip
    found = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    text = " ".join(Page(page_text(report)).words)
    for claim, told in zip(report.claims, found["claims"], strict=True):
        assert claim.said in text and claim.found in text and claim.criterion in text
        assert told["verdict"] == claim.verdict and told["measured"]
    by_name = dict(zip(names, report.claims, strict=True))
    assert by_name["scan"].data["beams_that_differ"] == 0
    assert by_name["maps"].holds["robust"]
    assert by_name["grid"].verdict == "holds"


@pytest.mark.parametrize(
    ("holds", "verdict"),
    [
        ({"lrf3d": True}, "holds"),
        ({"robust": True, "paper": True}, "holds"),
        ({"robust": True, "paper": False}, "holds in robust mode"),
        ({"room": False, "city": True}, "holds in the city"),
        ({"robust": False, "paper": False}, "does not hold"),
        ({"robust": None, "paper": None}, "not measured"),
        ({"robust": True, "paper": None}, "holds"),
    ],
)
def test_verdicts_say_where_a_claim_holds(holds, verdict):
    assert Claim("n", "t", "p", "s", "f", "c", holds).verdict == verdict


def test_what_is_said_is_text_and_no_markup():
    table = Table("table", {"words": "a < b"}), [{"words": "<script>"}]
    claim = Claim("n", "a & b", "p", "s", "f", "c", {}, [table], [Picture("data:,", '"q"')])
    text = page_text(PaperReport((claim,), {"system": "<x>", "cores": 1}, 1.0))
    assert "<script>" not in text and "a &amp; b" in text and "<x>" not in text
    assert "&quot;q&quot;" in text and "a &lt; b" in text


def test_a_machine_that_cannot_draw_says_so_and_measures_the_rest(monkeypatch):
    def refused(*_, **__):
        raise MissingLibraryError("no OpenGL library on this machine")

    monkeypatch.setattr(video, "frame", refused)
    claim = film_claim(drive_through("paper_room", "robust"), TINY)
    assert claim.verdict == "not measured" and not claim.pictures
    assert "no OpenGL library" in claim.found


def test_storage_and_speed_are_told_by_mode():
    drives = {mode: drive_through("paper_room", mode) for mode in ("robust", "paper")}
    assert grid_claim(drives, drives).holds == {"robust": True, "paper": True}
    count = drives["robust"].stored
    places = polyline_claim(drives, drives).holds
    assert places["room"] == (count.union_numbers < count.polyline_numbers)
    told = speed_claim(drives).data
    assert told["paper"]["median_s"] <= told["paper"]["largest_s"]
    assert len(drives["paper"].updates) == 3


def test_the_same_figure_gives_the_same_text():
    def drawn():
        figure = Figure()
        figure.add_subplot().plot([0, 1], [1, 0])
        return embed_figure(figure)

    assert drawn() == drawn()


def test_the_command_writes_the_page_and_prints_one_object(monkeypatch, tmp_path):
    asked = []

    def measured(extent, progress):
        asked.append(extent)
        return PaperReport((), {"system": "here", "cores": 4}, 1.0)

    monkeypatch.setattr(report_module, "redo_paper", measured)
    done = CliRunner().invoke(app, ["--json", "--seeds", "3", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0 and json.loads(done.stdout)["claims"] == []
    assert asked == [Extent(seeds=3)]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"paper.html", "paper.json"}
