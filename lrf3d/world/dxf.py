"""Worlds from DXF drawings: lines, polylines, arcs, circles, ellipses, splines become walls.

``$INSUNITS`` gives the unit; a drawing without one is in metres. Blocks are inserted, multilines
become their lines. Curves become chords no farther from them than
:data:`~lrf3d.world.drawing.CURVE_ERROR`, or a two-thousandth of their size where that is less.
Walls that touch are one object. Layers that are off or frozen, paper space, hatches, texts and
dimensions are ignored, and so are heights (z).
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.files import opened
from lrf3d.geometry import Float
from lrf3d.world.drawing import CURVE_ERROR, MOST_WALLS, world_of_strokes
from lrf3d.world.model import World

LARGEST_DXF = 1 << 26
"""Largest drawing [bytes]."""

MOST_INSERTED = 20_000
"""Largest number of inserted entities: nested blocks could multiply them beyond all bounds."""

DEEPEST_BLOCK = 30
"""Largest nesting depth of blocks."""

CURVE_SHARE = 1.0 / 2000.0
"""Largest distance of chords from a curve, relative to its extent."""

CACHE_HOME = "XDG_CACHE_HOME"
"""The environment variable with the folder for caches."""

OUTLINES = frozenset("LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE SOLID TRACE".split())
"""Entities that are walls."""


def read_dxf(path: Path) -> World:
    """Read the outlines of a drawing as walls.

    Raises:
        WorldError: The file cannot be read, is not a DXF drawing or has no outline.
    """
    with _no_list_of_fonts():
        from ezdxf import units
    from ezdxf.enums import InsertUnits
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError

    with opened(path, what="a world file", largest=LARGEST_DXF, error=WorldError):
        pass
    try:
        drawing = readfile(path)
    except (DXFError, OSError) as error:
        raise WorldError(f"{path}: not a DXF drawing: {_first_line(error)}") from None
    code = drawing.header.get("$INSUNITS", 0)
    if code not in range(25):
        raise WorldError(f"{path}: $INSUNITS is {code!r}, expected 0 to 24")
    scale = units.conversion_factor(InsertUnits(code), InsertUnits.Meters) if code else 1.0
    shown = {
        layer.dxf.name.lower()
        for layer in drawing.layers
        if layer.is_on() and not layer.is_frozen()
    }
    hidden = {layer.dxf.name.lower() for layer in drawing.layers} - shown
    strokes: list[Float] = []
    count = 0
    for entity in _entities(drawing.modelspace(), path, hidden):
        for stroke in _strokes(entity, CURVE_ERROR / scale):
            strokes.append(stroke * scale)
            count += len(stroke)
        if count > MOST_WALLS:
            raise WorldError(f"{path}: holds more than {MOST_WALLS:,} walls; simplify the drawing")
    return world_of_strokes(strokes, path)


@contextmanager
def _no_list_of_fonts() -> Iterator[None]:
    """Keep ezdxf from looking for fonts, and from writing to the user's folders, when imported.

    When it is imported, it reads all fonts of the machine and keeps a list of them in
    ``~/.cache/ezdxf``. Texts are not walls, so an empty list in a temporary folder is enough.
    """
    before = os.environ.get(CACHE_HOME)
    with TemporaryDirectory(prefix="lrf3d-") as folder:
        (Path(folder) / "ezdxf").mkdir()
        fonts = Path(folder) / "ezdxf" / "font_manager_cache.json"
        fonts.write_text('{"version": null, "font-faces": []}')
        os.environ[CACHE_HOME] = folder
        try:
            yield
        finally:
            os.environ.pop(CACHE_HOME)
            if before is not None:
                os.environ[CACHE_HOME] = before


def _entities(layout: Any, path: Path, hidden: set[str]) -> Iterator[Any]:
    """The outlines of a layout, with those of inserted blocks."""
    waiting = [(iter(layout), 0)]
    inserted = 0
    while waiting:
        entities, depth = waiting[-1]
        entity = next(entities, None)
        if entity is None:
            waiting.pop()
            continue
        inserted += len(waiting) > 1
        if inserted > MOST_INSERTED:
            raise WorldError(
                f"{path}: inserts more than {MOST_INSERTED:,} entities by its blocks; simplify it"
            )
        if entity.dxf.get("layer", "0").lower() in hidden or entity.dxf.get("invisible", 0):
            continue
        if entity.dxftype() == "INSERT":
            if depth >= DEEPEST_BLOCK:
                name = entity.dxf.get("name", "")
                raise WorldError(f"{path}: block {name[:40]!r} nested over {DEEPEST_BLOCK} deep")
            if entity.mcount > 1:
                waiting.append((iter(entity.multi_insert()), depth))
            else:
                waiting.append((iter(entity.virtual_entities()), depth + 1))
        elif entity.dxftype() == "MLINE":
            waiting.append((iter(entity.virtual_entities()), depth))
        elif entity.dxftype() in OUTLINES:
            yield entity


def _strokes(entity: Any, tolerance: float) -> Iterator[Float]:
    """The polylines (k, 2) [units] of an entity."""
    from ezdxf.path import make_path

    if entity.dxftype() == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return
    outline = make_path(entity)
    if not len(outline):
        return
    corners = np.array([(point.x, point.y) for point in outline.control_vertices()])
    extent = float(np.ptp(corners, axis=0).max())
    if not np.isfinite(extent):
        raise WorldError("a curve that is not finite")
    # The number of chords grows with the root of this ratio: some ten thousand are enough.
    distance = max(min(tolerance, CURVE_SHARE * extent), 1e-9)
    if not extent / distance <= 1e8:
        raise WorldError("a curve that is too large to be cut into chords")
    for part in outline.sub_paths():
        yield np.array([(point.x, point.y) for point in part.flattening(distance, segments=4)])


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:120]
