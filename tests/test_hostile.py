"""Files of strangers: small ones that crash, hang or fill the memory are refused in one line."""

import json

import numpy as np
import pytest
from PIL import Image

import lrf3d
from lrf3d.base.errors import shown

WALL = "[[object]]\npoints = [[0, 0], [4, 0], [4, 3]]\n"
FREE = "[free]\nresolution = 1.0\norigin = [0, 0, 0]\nrows = "
MAP = "image: a.png\nresolution: 1.0\norigin: [0, 0, 0]\n"
ALIASES = "a0: &a0 [1, 1]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12)
)


def collection(*rings, kind="Polygon", **more):
    """A GeoJSON file of a feature for each ring."""
    shapes = [{"type": kind, "coordinates": [ring]} for ring in rings]
    features = [{"type": "Feature", "properties": {}, "geometry": each} for each in shapes]
    return json.dumps({"type": "FeatureCollection", "units": "m", "features": features, **more})


def square(x):
    return [[x, x], [x + 9, x], [x + 9, x + 9], [x, x + 9], [x, x]]


SVG = '<svg xmlns="http://www.w3.org/2000/svg"><path d="{}" stroke="black"/></svg>'

WORLDS = {
    "wraps.toml": (WALL + FREE + f"[[{2**62}, {2**62}, {2**62}, {2**62 + 5}]]", "run lengths"),
    "negative.toml": (WALL + FREE + "[[5, -1]]", "run lengths"),
    "empty.toml": (WALL + FREE + "[[]]", "run lengths"),
    "texts.toml": (WALL + FREE + '[["5", "1"]]', "run lengths"),
    "aliases.yaml": (MAP + ALIASES + "negate: *a11\n", "negate: expected 0 or 1"),
    "keys.yaml": (MAP + ALIASES + "? *a11\n: 1\n", "."),
    "tag.yaml": (MAP + "negate: !!bool foo\n", "negate"),
    "empty_tag.yaml": ('image: a.png\nresolution: !!int ""\norigin: [0, 0, 0]\n', "resolution"),
    "type.geojson": ('{"type": [], "features": []}', "unknown geometry"),
    "deep.geojson": ('{"type": "Polygon", "coordinates": ' + "[" * 900 + "]" * 900 + "}", "."),
    "key.toml": (WALL + ".".join(["a"] * 3000) + " = 1\n", "nested too deeply"),
    "digits.svg": (SVG.format("M 0 0 L " + 50_000 * "1"), "digits"),
    "turned.svg": (
        SVG.format("M 0 0 L 1 1").replace("<path", f'<path transform="{20_000 * "scale("}"'),
        "brackets",
    ),
    "crs.geojson": (collection(square(0), crs="EPSG:" * 60_000).replace("units", "u"), "crs is"),
    "keys.geojson": (
        "{" + ", ".join(f'"k{n}": 1' for n in [*range(60_000), 59_999]) + "}",
        "twice",
    ),
}


@pytest.mark.parametrize("name", WORLDS)
def test_a_small_file_that_would_crash_or_hang_a_reader_is_an_error(name, tmp_path):
    text, said = WORLDS[name]
    (tmp_path / name).write_text(text)
    Image.new("L", (4, 4), 255).save(tmp_path / "a.png")
    with pytest.raises(lrf3d.WorldError, match=said) as caught:
        lrf3d.load_world(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name)) and len(str(caught.value)) < 700


def test_pictures_of_patterns_and_plans_of_stars_are_refused_by_what_they_would_cost(tmp_path):
    cells = np.indices((800, 800)).sum(axis=0) % 2 == 0
    Image.fromarray(cells).save(tmp_path / "checks.png")
    with pytest.raises(lrf3d.WorldError, match="1,278,400 borders between occupied cells"):
        lrf3d.load_world(tmp_path / "checks.png", resolution=0.05)


@pytest.mark.slow
def test_trees_at_one_place_are_one_and_others_all_stand(written):
    """Whatever their sizes are, the work grows as their number."""
    rng = np.random.default_rng(0)
    corners = [(0, 0), (1e-4, 0), (1e-4, 1e-4), (0, 1e-4)]
    same = [(0.001, 0.001, 10.0)] * 8000
    near = [(0.002 + 1e-6 * x, 0.001 + 1e-6 * y, h) for x, y, h in rng.random((8000, 3)) * 100]
    lines = [f'<node id="{n}" lon="{x}" lat="{y}"/>' for n, (x, y) in enumerate(corners)]
    lines += [
        f'<node id="{n}" lon="{x}" lat="{y}"><tag k="natural" v="tree"/>'
        f'<tag k="height" v="{h}"/></node>'
        for n, (x, y, h) in enumerate([*same, *near, (0.003, 0.001, 10.0)], 10)
    ]
    way = "".join(f'<nd ref="{n}"/>' for n in (0, 1, 2, 3, 0)) + '<tag k="building" v="yes"/>'
    world = lrf3d.load_world(
        written("a.osm", f"<osm>{''.join(lines)}<way id='1'>{way}</way></osm>"), trees=True
    )
    middles = world.segments[world.heights == 10.0].reshape(-1, 12, 2).mean(axis=1)
    assert len(middles) == 2 and 10 < world.object_count < 8000


NAMES = ",".join(map("r{}".format, range(50)))
COLUMNS = [pytest.param(each, marks=pytest.mark.slow) for each in ("a,", NAMES)]


@pytest.mark.parametrize("text", ["a", "[", " ", "time: 1\n", *COLUMNS])
def test_a_line_of_a_log_is_looked_at_once(text, tmp_path):
    # What is looked for from each place to the end takes minutes here.
    (tmp_path / "a.csv").write_text(f"{300_000 // len(text) * text}\n1,2\n")
    with pytest.raises(lrf3d.InputError, match=r"a.csv"):
        lrf3d.load_log(tmp_path / "a.csv")


def test_a_message_shows_no_more_of_a_value_than_it_can():
    value = [1]
    for _ in range(60):
        value = [value, value]
    assert len(shown(value)) == 40

    class Broken:
        def __repr__(self):
            raise KeyError

    assert shown(Broken()) == "a value of type Broken"
