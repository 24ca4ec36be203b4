"""Drawings in DXF, as ezdxf draws them: blocks, clips, wipeouts, layers, widths and hatches.

``$INSUNITS`` gives the unit; a drawing without one is in metres. Heights (z) and what is off or
frozen are ignored; paper space is read if model space is empty. Hatches with a pattern, texts,
dimensions, leaders, pictures and endless lines are not read, but counted.
"""

from collections.abc import Iterable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from lrf3d.base.errors import WorldError
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float
from lrf3d.plans.canvas import (
    CURVE_ERROR,
    PALEST,
    Canvas,
    Mark,
    contrast_to_white,
    scale_of,
)
from lrf3d.plans.rules.layers import rename

# On import, ezdxf prints a note where it cannot save its list of fonts, which no wall needs.
with redirect_stdout(StringIO()):
    from ezdxf import units
    from ezdxf.addons.drawing.backend import Backend
    from ezdxf.addons.drawing.config import BackgroundPolicy, Configuration, LinePolicy
    from ezdxf.addons.drawing.frontend import Frontend
    from ezdxf.addons.drawing.properties import RenderContext
    from ezdxf.enums import InsertUnits
    from ezdxf.filemanagement import readfile

# Colour of the paper: a white that no drawing uses, so that only wipeouts have it.
PAPER = "#fefdfb"

# Entities that are not walls, and the noun by which the note on the plan counts them.
LEFT_OUT = {
    **dict.fromkeys(("TEXT", "MTEXT", "ATTRIB", "ATTDEF", "RTEXT", "ARCALIGNEDTEXT"), "text"),
    **dict.fromkeys(("DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION"), "dimension"),
    **dict.fromkeys(("LEADER", "MULTILEADER", "MLEADER", "TOLERANCE"), "leader"),
    **dict.fromkeys(("IMAGE", "OLE2FRAME", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY"), "picture"),
    **dict.fromkeys(("XLINE", "RAY"), "endless line"),
    "ACAD_TABLE": "table",
    "POINT": "point",
    "VIEWPORT": "viewport",
}


def draw(path: Path, scale: float) -> Canvas:
    """The marks of a DXF drawing, enlarged by a scale."""
    file = readfile(path)
    # Do not draw the frames of clips: CAD shows them on the screen, but does not plot them.
    file.header["$XCLIPFRAME"] = 0
    code = file.header.get("$INSUNITS", 0)
    if code not in range(25):
        raise WorldError(f"$INSUNITS is {code!r}, expected 0 to 24")
    unit = units.conversion_factor(InsertUnits(code), InsertUnits.Meters) if code else 1.0
    scale = scale_of(scale, unit)
    canvas = Canvas(CURVE_ERROR / (unit * scale))
    canvas.unit = unit * scale
    config = Configuration(
        max_flattening_distance=canvas.tolerance,
        line_policy=LinePolicy.SOLID,
        background_policy=BackgroundPolicy.CUSTOM,
        custom_bg_color=PAPER,
    )
    # Take the first layout that holds entities: model space comes before paper space.
    filled = (layout for layout in file.layouts if any(e.dxftype() != "VIEWPORT" for e in layout))
    if (layout := next(filled, None)) is not None:
        with redirect_stdout(StringIO()):
            _EntityFilter(RenderContext(file), canvas, unit * scale, config).draw_layout(layout)
    rename(canvas, file.encoding)
    return canvas


class _EntityFilter(Frontend):
    """Walks the entities of a drawing: counts those that are not walls, and draws the others."""

    def __init__(
        self, context: RenderContext, canvas: Canvas, scale: float, config: Configuration
    ) -> None:
        self.painter = _EntityPainter(canvas, scale)
        super().__init__(context, self.painter, config)
        self.canvas = canvas

    def draw_entity(self, entity: Any, properties: Any) -> None:
        kind = entity.dxftype()
        canvas = self.canvas
        canvas.count(entity.mcount if kind == "INSERT" else 1)
        if kind in ("HATCH", "MPOLYGON") and not entity.has_solid_fill:
            canvas.left_out["hatching pattern"] += 1
        elif kind in LEFT_OUT:
            canvas.left_out[LEFT_OUT[kind]] += 1
        else:
            self.painter.dashed = bool(properties.linetype_pattern)
            super().draw_entity(entity, properties)

    def skip_entity(self, entity: Any, msg: str) -> None:
        self.canvas.count()
        self.canvas.left_out["hidden part" if msg == "invisible" else entity.dxftype()] += 1


class _EntityPainter(Backend):
    """Backend of ezdxf: paints the lines and areas that it is given on a canvas, in metres."""

    def __init__(self, canvas: Canvas, scale: float) -> None:
        super().__init__()
        self.canvas = canvas
        self.scale = scale
        self.dashed = False

    def _mark(self, properties: Any, contrast: float = 1.0) -> Mark:
        # The innermost block says most about what the entity is.
        names = (e.dxf.name for e, _ in reversed(self.entity_stack) if e.dxftype() == "INSERT")
        own = (properties.layer, next(names, ""))
        colour = properties.color[:7].lower()
        return Mark(
            None, properties.layer, own, contrast=contrast, dashed=self.dashed, colour=colour
        )

    def draw_line(self, start: Any, end: Any, properties: Any) -> None:
        self.canvas.line(np.array([tuple(start), tuple(end)]) * self.scale, self._mark(properties))

    def draw_path(self, path: Any, properties: Any) -> None:
        mark = self._mark(properties)
        for part in path.sub_paths():
            self.canvas.line(self._points(part), mark)

    def draw_filled_paths(self, paths: Iterable[Any], properties: Any) -> None:
        self._fill([self._points(part) for path in paths for part in path.sub_paths()], properties)

    def draw_filled_polygon(self, points: Any, properties: Any) -> None:
        self._fill([np.array(points.to_tuples()) * self.scale], properties)

    def _fill(self, rings: list[Float], properties: Any) -> None:
        # A white area is printed, too, so it counts as seen; only a wipeout has no contrast.
        seen = max(1.25 * PALEST, contrast_to_white(*bytes.fromhex(properties.color[1:7])))
        mark = self._mark(properties, 0.0 if properties.color == PAPER else seen)
        opaque = properties.color[7:].lower() in ("", "ff")
        self.canvas.area(rings, mark._replace(opaque=opaque))

    def _points(self, path: Any) -> Float:
        corners = np.array([tuple(point) for point in path.control_vertices()])
        extent = float(np.ptp(corners, axis=0).max())
        if not extent * self.scale <= LARGEST_COORDINATE:
            raise WorldError("holds a curve that is not finite, or far too large")
        if path.has_curves:
            distance = 0.5 * min(self.canvas.tolerance, max(extent / 200.0, 1e-12))
            corners = np.array([tuple(p) for p in path.flattening(distance, segments=4)])
            # Splines are flattened finer than the distance asks for: drop the points in excess.
            line = shapely.simplify(shapely.linestrings(corners), distance, preserve_topology=False)
            corners = shapely.get_coordinates(line)
        return corners * self.scale

    def _nothing(self, *_: Any, **__: Any) -> None:
        """Draw nothing: `_EntityFilter` counts points and pictures, and the paper has no colour."""

    draw_point = draw_image = set_background = clear = _nothing
