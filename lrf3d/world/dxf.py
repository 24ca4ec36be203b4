"""Worlds from DXF drawings: lines, polylines, arcs, circles, ellipses, splines become walls.

``$INSUNITS`` gives the unit; a drawing without one is in metres. Blocks are inserted, multilines
become their lines. Curves become chords no farther from them than
:data:`~lrf3d.world.pieces.CURVE_ERROR`, or a two-thousandth of their size where that is less.
Walls that touch are one object. Layers that are off or frozen, paper space, hatches, texts and
dimensions are ignored, and so are heights (z).
"""

from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import LARGEST_COORDINATE, Float
from lrf3d.world.model import World
from lrf3d.world.pieces import CURVE_ERROR, world_of_strokes

CURVE_SHARE = 1.0 / 2000.0
"""Largest distance of chords from a curve, relative to its extent."""

OUTLINES = frozenset("LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE SOLID TRACE".split())
"""Entities that are walls."""


def read_dxf(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file is not a DXF drawing or has no outline.
    """
    # It prints where it cannot keep a list of the fonts that it finds, which no wall needs.
    with redirect_stdout(StringIO()):
        from ezdxf import units
        from ezdxf.enums import InsertUnits
        from ezdxf.filemanagement import readfile

    drawing = readfile(path)
    code = drawing.header.get("$INSUNITS", 0)
    if code not in range(25):
        raise WorldError(f"$INSUNITS is {code!r}, expected 0 to 24")
    scale = units.conversion_factor(InsertUnits(code), InsertUnits.Meters) if code else 1.0
    hidden = {
        layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()
    }
    strokes = [
        stroke * scale
        for entity in _outlines(drawing.modelspace(), hidden)
        for stroke in _strokes(entity, CURVE_ERROR / scale)
    ]
    return world_of_strokes(strokes, path)


def _outlines(entities: Iterable[Any], hidden: set[str]) -> Iterator[Any]:
    """The visible outlines among entities, with those of inserted blocks."""
    for entity in entities:
        if entity.dxf.get("layer", "0").lower() in hidden or entity.dxf.get("invisible", 0):
            continue
        kind = entity.dxftype()
        if kind == "INSERT":
            for one in entity.multi_insert() if entity.mcount > 1 else (entity,):
                yield from _outlines(one.virtual_entities(), hidden)
        elif kind == "MLINE":
            yield from _outlines(entity.virtual_entities(), hidden)
        elif kind in OUTLINES:
            yield entity


def _strokes(entity: Any, tolerance: float) -> Iterator[Float]:
    """The polylines (k, 2) [units] of an entity."""
    from ezdxf.path import make_path

    if entity.dxftype() == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return
    outline = make_path(entity)
    corners = np.array([(point.x, point.y) for point in outline.control_vertices()])
    if len(corners) < 2:
        return
    extent = float(np.ptp(corners, axis=0).max())
    if not extent <= LARGEST_COORDINATE:
        raise WorldError("holds a curve that is not finite, or far too large")
    distance = min(tolerance, CURVE_SHARE * extent)
    for part in outline.sub_paths():
        yield np.array([(point.x, point.y) for point in part.flattening(distance, segments=4)])
