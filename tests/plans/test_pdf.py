"""Worlds from pages of PDF files."""

import numpy as np
import pytest
import shapely
from drawn import pdf

from lrf3d import WorldError, load_world

pytestmark = pytest.mark.filterwarnings("ignore::lrf3d.base.errors.Lrf3dNote")


INCH = 2.54
"""An inch of a drawing of 1:100 [m]."""


@pytest.mark.parametrize(
    ("content", "page", "low", "high"),
    [
        ("0 0 m 72 36 l S", "", (0, 0), (1, 0.5)),
        ("q 2 0 0 1 72 0 cm 0 0 m 36 36 l S Q", "", (1, 0), (2, 0.5)),
        ("0 0 m 72 36 l S", "/Rotate 90", (0, 1), (0.5, 2)),
        ("0 0 m 72 36 l S", "/Rotate 270", (0.5, 0), (1, 1)),
        ("0 36 m 144 36 l S", "/CropBox[36 18 108 72]", (0, 0.25), (1, 0.25)),
        ("0 0 m 72 36 l S", "/UserUnit 2", (0, 0), (2, 1)),
        ("0 0 36 72 re W n 0 36 m 144 36 l S", "", (0, 0.5), (0.5, 0.5)),
        ("q 1 0 0 1 36 0 cm /F Do Q", "", (0.5, 0.25), (0.5 + 50 / 72, 0.25)),
        ("0 36 m 144 36 l S 1 g 72 0 72 72 re f", "", (0, 0.5), (1, 0.5)),
        ("/OC /M BDC 0 0 m 144 72 l S EMC /OC /L BDC 36 0 m 36 72 l S EMC", "", (0.5, 0), (0.5, 1)),
    ],
)
def test_a_page_of_pdf_is_read_as_it_is_shown(content, page, low, high, tmp_path):
    layers = "/OCProperties<</OCGs[6 0 R 7 0 R]/D<</OFF[7 0 R]>>>>"
    world = pdf(tmp_path, content, page, forms="0 18 m 100 18 l S", root=layers)
    assert world.bounds / INCH == pytest.approx(np.array([low, high]), abs=1e-3)


@pytest.mark.parametrize("layer", ["<FEFF5C3A5BF8>", "<B3DFB4E7>"])
def test_names_of_layers_are_read_in_any_encoding(layer, tmp_path):
    content = "/OC /L BDC 0 0 m 144 72 l S EMC 36 0 m 36 72 l S"
    world = pdf(tmp_path, content, layer=layer)
    assert world.bounds / INCH == pytest.approx(np.array([[0.5, 0], [0.5, 1]]), abs=1e-3)


def test_a_scanned_page_is_read_as_a_picture(tmp_path):
    # Four pixels of 36 points: the first is black, the last one grey.
    world = pdf(tmp_path, "q 72 0 0 72 0 0 cm BI /W 2 /H 2 /BPC 8 /CS /G /F /AHx ID 00FFFF60> EI Q")
    black = np.array([[0, 0.5], [0.5, 1]])
    assert world.bounds / INCH == pytest.approx(black, abs=0.02)
    world = load_world(tmp_path / "a.pdf", scale=100.0, threshold=200)
    assert world.bounds / INCH == pytest.approx(np.array([[0, 0], [1, 1]]), abs=0.02)
    picture = "q 144 0 0 72 0 0 cm BI /W 2 /H 2 /BPC 8 /CS /G /F /AHx ID 00FFFFFF> EI Q"
    bordered = pdf(tmp_path, f"1 g 0 0 144 72 re f {picture} 1 w 2 2 140 68 re S")
    assert bordered.bounds / INCH == pytest.approx(black * [2, 1], abs=0.02)
    labels = " ".join(f"{x} {y} 9 5 re S" for x in range(9, 135, 12) for y in (9, 40))
    assert pdf(tmp_path, f"{picture} {labels}").bounds == pytest.approx(bordered.bounds, abs=0.02)
    with pytest.raises(WorldError, match="has no page 2; --page is 1 to 1"):
        load_world(tmp_path / "a.pdf", page=2)
    pdf(tmp_path, "0 0 m 72 36 l S")
    with pytest.raises(WorldError, match="is no scanned page"):
        load_world(tmp_path / "a.pdf", threshold=40)


def test_a_pale_area_that_divides_a_dark_wall_is_a_doorway(tmp_path):
    # Two floors and two walls; in the first a door with its leaf and an open passage, in the second
    # a window.
    floors = ".95 g 0 0 144 33 re f .8 g 0 39 144 27 re f 0 g 0 33 144 6 re f 0 66 144 6 re f"
    doors = " .87 g 40 33.2 26 5.6 re f 90 33 30 6 re f 20 66 30 6 re f"
    leaf = " 40 36 m 46 58 l S 46 58 m 66 36 l S"
    world = pdf(tmp_path, floors + doors + leaf)
    walls = shapely.union_all(shapely.linestrings(world.segments.reshape(-1, 2, 2) * 72 / INCH))
    assert not walls.intersects(shapely.box(42, 30, 64, 65))
    assert not walls.intersects(shapely.box(92, 30, 118, 65))
    assert walls.intersects(shapely.box(22, 60, 48, 68))
    # The ends of the walls are closed.
    assert walls.distance(shapely.Point(40, 36)) < 1.5 and walls.distance(shapely.Point(30, 39)) < 1
