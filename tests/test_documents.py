"""The snippets of the README and the documentation run, and do what the text says."""

import os
import re
import subprocess
import sys
import zlib
from dataclasses import fields

import pytest
from program import ran
from snippets import PAGES, PARTS, ROOT, Workshop, snippets

import lrf3d
from lrf3d.apps.cli.commands import COMMANDS
from lrf3d.base.formats import FORMATS, by_name, endings
from lrf3d.simulation.tables import TABLES, keys_of_table
from lrf3d.studio.render import encode
from lrf3d.world import Material
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.schema import OBJECT, OBSTACLE

README = PAGES[0]

# Pages whose snippets take more than some seconds.
LONG = {
    *("casting.md", "crosscheck.md", "film.md", "localisation.md", "long-runs.md", "notebooks.md"),
    *("own-algorithms.md", "range-finder.md", "slam.md", "sweeps.md", "tour.md", "view.md"),
    "worlds.md",
}


EXAMPLES = {
    **{f"lrf3d {name}": text.rpartition("Example: ")[2] for name, text in COMMANDS.items()},
    **{f"scripts/bench {name}": example for name, example in PARTS.items()},
}


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    workshop = Workshop(tmp_path_factory.mktemp("workshop"))
    before = os.getcwd()
    os.chdir(workshop.folder)
    workshop.prepare()
    os.chdir(before)
    return workshop


@pytest.fixture
def workshop(shared, monkeypatch):
    """The working folder of all snippets; films are small in it."""
    monkeypatch.chdir(shared.folder)
    render = lrf3d.render_video

    def small(run, path, **_):
        render(run, path, size=(64, 64), fps=1.0, playback=100.0, workers=1)

    monkeypatch.setattr(lrf3d, "render_video", small)
    return shared


def format_row(row):
    """A format as a line of the list in docs/formats.md."""
    names = [f"`{ending}`" for ending in row.endings if ending]
    uses = ["read"] if row.read else []
    if row.kind == "export":
        uses.append(f"`--to {row.name}`")
    elif row.write:
        uses.append("written" if len(names) == 1 else f"written as {names[0]}")
    uses += [f"`--{option.replace('_', '-')}`" for option in row.options]
    uses += [f"extra `{row.extra}`"] if row.extra else []
    kind = row.kind if row.kind == "export" else f"{row.kind} {row.name}".strip()
    return f"- {' '.join(names) or 'any'}: {kind}; {', '.join(uses)}"


def test_the_list_of_formats_has_a_line_for_each():
    page = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    rows = [format_row(row) for row in FORMATS if row.kind != "other"]
    assert "\n".join(rows) in page


def test_help_pages_and_films_know_the_endings_of_the_table():
    assert set(endings("film")) == set(encode.FORMATS)
    for names in (endings("film"), endings("world", written=True), by_name("log", "bag").endings):
        assert any(all(name in text for name in names) for text in COMMANDS.values()), names


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.slow] if p.name in LONG else []) for p in PAGES[1:]],
    ids=[str(page.relative_to(ROOT)) for page in PAGES[1:]],
)
def test_every_snippet_runs(page, workshop):
    printed = workshop.run(page)
    if page.name == "localisation.md":
        # The robot that localises itself: mean errors of x, y and theta.
        errors = [float(word) for word in printed[-1].strip("[] \n").split()]
        assert len(errors) == 3 and max(errors) < 0.02


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in ("lrf3d render", "lrf3d share")))
        for name in EXAMPLES
    ],
)
def test_the_example_of_every_command_runs(name, workshop):
    assert EXAMPLES[name].startswith(f"{name} ")
    workshop.shell(EXAMPLES[name])


@pytest.mark.slow  # test_scenario_run runs its lines with fewer scans.
def test_the_readme_does_what_it_says(workshop):
    code = next(item.code for item in snippets(README) if item.language == "python")
    assert len(code.strip().splitlines()) <= 11
    printed = workshop.run(README)
    assert re.fullmatch(r"Run\('city', .*\)\n2\d\d segments in \d\d objects\n", printed[0])
    assert len(lrf3d.load_map("map.geojson")) > 200


@pytest.fixture(scope="module")
def city(tmp_path_factory):
    """The folder of a whole drive through the city, and what the command printed."""
    folder = tmp_path_factory.mktemp("city")
    return folder, ran("run", "city", "--no-video", "--out", folder).stdout


@pytest.mark.slow
def test_the_pictures_of_the_readme_are_of_moments_of_their_film(city):
    run = lrf3d.load_run(city[0])
    moments = re.findall(r"render out/city --at (\d+)", README.read_text(encoding="utf-8"))
    assert moments
    for moment in moments:
        run.frame(float(moment), size=(64, 36))


def test_every_picture_shows_in_a_clone():
    pages = [README, *(ROOT / "docs").rglob("*.md")]
    linked = [
        page.parent / picture
        for page in pages
        for picture in re.findall(r"!\[[^]]*\]\(([^)]*)\)", page.read_text(encoding="utf-8"))
    ]
    assert len(linked) > 30 and [link for link in linked if not link.is_file()] == []


@pytest.mark.slow
def test_the_sample_output_of_the_tour_is_what_the_command_prints(city):
    page = (ROOT / "docs/tour.md").read_text(encoding="utf-8")
    sample = re.search(r"```text\n(.*?)```", page, re.S)[1].splitlines()
    printed = city[1].splitlines()
    # All figures but those of time, and what a run without a film lacks.
    same = [line for line in printed if line.split()[0] in ("drive", "seen", "map")]
    assert same == sample[:3] and [line.split()[0] for line in printed] == [
        line.split()[0] for line in sample
    ]


def test_every_key_of_a_world_file_is_documented():
    text = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    keys = {key for table in (*map(keys_of_table, TABLES), OBJECT, OBSTACLE) for key in table}
    keys |= {field.name for kind in (FixedCamera, Material) for field in fields(kind)}
    assert [key for key in sorted(keys) if f"`{key}`" not in text] == []


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("material", reason="needs pip install 'lrf3d[docs]'")
    pytest.importorskip("mkdocstrings", reason="needs pip install 'lrf3d[docs]'")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "true", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


@pytest.mark.slow
def test_the_site_fetches_nothing_from_the_net(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(r"<(?:script|img|iframe|link)\b[^>]*(?:src|href)=\"?(https?://)", text)
        assert not fetched, page
    for sheet in site.rglob("*.css"):
        assert "url(http" not in sheet.read_text(encoding="utf-8")


@pytest.mark.slow
def test_every_equation_became_one(site):
    pages = {page: page.read_text(encoding="utf-8") for page in (site / "theory").glob("*.html")}
    assert sum(text.count("<math") for text in pages.values()) > 50
    assert not [page for page, text in pages.items() if "arithmatex" in text or "merror" in text]


@pytest.mark.slow
def test_every_public_name_and_every_command_has_its_place(site):
    lines = (site / "objects.inv").read_bytes().split(b"\n", 4)
    names = {line.split()[0] for line in zlib.decompress(lines[4]).decode().splitlines()}
    assert {f"lrf3d.{name}" for name in lrf3d.__all__} <= names
    for name in COMMANDS:
        name = name.replace(" ", "-")
        page = site / "commands" / f"{name}.html"
        assert f'<h1 id="lrf3d-{name}">' in page.read_text(encoding="utf-8")
