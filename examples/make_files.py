"""Makes the files that the README's table names: a flat, a town and a drive, as people have them.

    .venv/bin/python examples/make_files.py

The flat is 10 m by 7 m, in three formats: lines of a drawing in metres, strokes on paper at 1:100,
and a picture of 2 cm a pixel.
"""

import json
from pathlib import Path

import ezdxf
import numpy as np
from PIL import Image, ImageDraw

import lrf3d
from lrf3d.slam import SlamMapper

FOLDER = Path(__file__).parent

FLAT = [
    [(0, 0), (10, 0), (10, 7), (0, 7), (0, 0)],
    # A hall in the middle, with a door of 1 m to each room.
    [(0, 3), (1.5, 3)], [(2.5, 3), (4.5, 3)], [(4.5, 3), (4.5, 0)],
    [(4.5, 3), (6.5, 3)], [(7.5, 3), (10, 3)],
    [(0, 4.6), (3.2, 4.6)], [(4.2, 4.6), (6, 4.6)], [(6, 4.6), (6, 7)],
    [(6, 4.6), (7.6, 4.6)], [(8.6, 4.6), (10, 4.6)],
    # A kitchen block and a cupboard.
    [(0.8, 5.6), (2.4, 5.6), (2.4, 6.2), (0.8, 6.2), (0.8, 5.6)],
    [(8.6, 0.9), (9.3, 0.9), (9.3, 2.1), (8.6, 2.1), (8.6, 0.9)],
]  # fmt: skip
"""Walls [m]: lines from corner to corner."""

PIXELS, UNITS, THICK = 50, 100, 0.1
"""Pixels of the picture and units of the drawing in a metre, and the width of walls [m]."""

TOWN = (46.05, 14.5)
"""Latitude and longitude [degrees] of the town."""


def flat() -> None:
    """Write the flat as a DXF, an SVG and a PNG."""
    drawing = ezdxf.new(units=6)
    drawing.layers.add("WALLS")
    for line in FLAT:
        drawing.modelspace().add_lwpolyline(line, dxfattribs={"layer": "WALLS"})
    drawing.saveas(FOLDER / "flat.dxf")
    paths = [" ".join(f"{UNITS * x:g},{UNITS * (7 - y):g}" for x, y in line) for line in FLAT]
    sheet = f"{-UNITS / 2:g} {-UNITS / 2:g} {11 * UNITS} {8 * UNITS}"
    strokes = f'fill="none" stroke="black" stroke-width="{THICK * UNITS:g}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="110mm" height="80mm" viewBox="{sheet}">',
        f"<g {strokes}>",
        *(f'  <polyline points="{path}"/>' for path in paths),
        "</g>",
        "</svg>",
    ]
    (FOLDER / "flat.svg").write_text("\n".join(lines) + "\n")
    picture = Image.new("L", (11 * PIXELS, 8 * PIXELS), 255)
    draw = ImageDraw.Draw(picture)
    for line in FLAT:
        places = [(PIXELS * (x + 0.5), PIXELS * (7.5 - y)) for x, y in line]
        draw.line(places, fill=0, width=round(THICK * PIXELS), joint="curve")
    picture.save(FOLDER / "flat.png", optimize=True)


def town() -> None:
    """Write the footprints of a town of three streets as GeoJSON."""
    rng, features = np.random.default_rng(5), []
    metre = np.array([1.0 / np.cos(np.radians(TOWN[0])), 1.0]) / 111_320.0
    for column in range(5):
        for row in range(4):
            middle = np.array([22.0 * column, 20.0 * row]) + rng.uniform(-1.5, 1.5, 2)
            half, turn = rng.uniform([5.0, 4.0], [7.5, 6.0]), rng.uniform(-0.12, 0.12)
            axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * half
            places = (middle + corners @ axes) * metre + [TOWN[1], TOWN[0]]
            features.append({
                "type": "Feature",
                "properties": {"building": "yes", "building:levels": int(rng.integers(1, 5))},
                "geometry": {"type": "Polygon", "coordinates": [np.round(places, 7).tolist()]},
            })  # fmt: skip
    text = json.dumps({"type": "FeatureCollection", "features": features}, indent=1)
    (FOLDER / "town.geojson").write_text(text + "\n")


def drive() -> None:
    """Write a drive through the corridor, with wheels that slip, as a CARMEN log."""
    corridor = lrf3d.load_scenario("corridor")
    laser = lrf3d.LaserRangeFinder(beams=91, range_max=corridor.lrf.range_max)
    run = corridor.run(rng=1, scans=80, lrf=laser, mapper=SlamMapper(rng=1), snapshots=1)
    lrf3d.export_run(run, "carmen", FOLDER / "drive.log.gz")


if __name__ == "__main__":
    flat()
    town()
    drive()
