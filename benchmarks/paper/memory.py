"""What maps take to store: unions of segments, polylines and an occupancy grid (section 4)."""

from collections.abc import Mapping

from lrf3d.render.embedded import embed_figure
from lrf3d.render.map_benchmark_panels import StorePoint
from lrf3d.render.paper_figures import draw_storage
from lrf3d.study.paper.city import Drive
from lrf3d.study.paper.claim import MODES, Claim, Picture, Table


def grid_claim(city: dict[str, Drive], room: dict[str, Drive]) -> Claim:
    """Line segments take less memory than an occupancy grid."""
    places = {"room": room, "city": city}
    best = city["robust"].stored
    factor = best.grid_cells / max(best.union_numbers, 1)
    return Claim(
        "grid",
        "Line segments take far less memory than an occupancy grid",
        "Sections 1 and 4",
        "“Occupancy grids require a huge amount of computer memory and are therefore not"
        " appropriate when modelling a large environment.”",
        f"The map of the city in robust mode takes {best.union_numbers:,} numbers, five a segment"
        f" with the label of its union. A grid of 0.1 m over the same points has"
        f" {best.grid_cells:,} cells, {factor:,.0f} times as many.",
        "in both places the map takes at most a hundredth of the numbers of a grid",
        {
            mode: all(
                100 * drives[mode].stored.union_numbers <= drives[mode].stored.grid_cells
                for drives in places.values()
            )
            for mode in MODES
        },
        (_stored(places),),
        (
            Picture(
                embed_figure(draw_storage(_points(places), STORAGE_TITLES)),
                "What the maps take to store, on a logarithmic scale; red is robust mode, blue"
                " paper mode.",
            ),
        ),
        {
            name: {mode: drive.stored.as_dict() for mode, drive in drives.items()}
            for name, drives in places.items()
        },
    )


def polyline_claim(city: dict[str, Drive], room: dict[str, Drive]) -> Claim:
    """Unions of segments may take less memory than polylines."""
    counts = {"room": room["robust"].stored, "city": city["robust"].stored}
    return Claim(
        "polylines",
        "Polylines could take more memory than unions of segments",
        "Section 4",
        "G3, six lines as a union, would be fourteen lines in four polylines, as views from"
        " different sides cannot be joined.",
        f"In the city, which is seen from many sides, the {counts['city'].segments:,} segments"
        f" stand against {counts['city'].polyline_lines:,} lines in"
        f" {counts['city'].polylines:,} polylines: {counts['city'].union_numbers:,} numbers against"
        f" {counts['city'].polyline_numbers:,}. In the room, seen from three poses,"
        f" {counts['room'].segments} segments stand against {counts['room'].polyline_lines} lines"
        f" in {counts['room'].polylines} polylines, and as neighbours in a polyline share a vertex,"
        f" these take {counts['room'].polyline_numbers} numbers and the unions"
        f" {counts['room'].union_numbers}.",
        "unions take fewer numbers than the polylines of the same scans, in robust mode",
        {place: count.union_numbers < count.polyline_numbers for place, count in counts.items()},
        data={place: count.as_dict() for place, count in counts.items()},
    )


STORAGE_TITLES = (
    "Numbers to store",
    "a segment takes 5 with the label of its union, a vertex of a polyline 2, a cell of a grid 1",
)
"""Headline of the figure of storage, and the line below it."""


def _points(places: Mapping[str, Mapping[str, Drive]]) -> dict[str, list[StorePoint]]:
    counts = {
        place: [(mode, drives[mode].stored) for mode in MODES] for place, drives in places.items()
    }
    return {
        f"the {place}": [
            StorePoint(mode, c.union_numbers, c.polyline_numbers, c.grid_cells) for mode, c in some
        ]
        for place, some in counts.items()
    }


def _stored(places: Mapping[str, Mapping[str, Drive]]) -> Table:
    rows = []
    for place, drives in places.items():
        for mode in MODES:
            count = drives[mode].stored
            rows.append(
                (
                    place,
                    mode,
                    f"{count.segments:,} in {count.unions:,}",
                    f"{count.union_numbers:,}",
                    f"{count.polyline_lines:,} in {count.polylines:,}",
                    f"{count.polyline_numbers:,}",
                    f"{count.grid_cells:,}",
                )
            )
    head = (
        "place", "mode", "segments in unions", "numbers", "lines in polylines", "numbers",
        "cells of a grid",
    )  # fmt: skip
    return Table(head, tuple(rows))
