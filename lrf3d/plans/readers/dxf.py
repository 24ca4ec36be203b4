"""Drawings in DXF, as ezdxf draws them: blocks, clips, wipeouts, layers, widths and hatches.

``$INSUNITS`` gives the unit; a drawing without one is in metres. Heights (z) and what is off or
frozen are ignored; paper space is read if model space is empty. Hatches with a pattern, texts,
dimensions, leaders, pictures, endless lines, external references and objects of other programs are
not read, but counted. An item is an entity of a layout or of a block, however often it is placed.
"""

from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from lrf3d.base.errors import WorldError
from lrf3d.geometry.lines import LARGEST_COORDINATE, ROUNDING, Float
from lrf3d.plans.canvas import (
    CURVE_ERROR,
    PALEST,
    Canvas,
    Mark,
    PerUnit,
    contrast_to_white,
    scale_of,
)
from lrf3d.plans.rules.layers import rename
from lrf3d.plans.scale import unit_scales

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
}

# Entities that are left out if they have a pattern and no solid fill.
PATTERNED = dict.fromkeys(("HATCH", "MPOLYGON"), "hatching pattern")

# Feet of the survey of the United States [m], with its inches, yards and miles, by their codes.
SURVEY_FOOT = 1200 / 3937
SURVEY = {21: SURVEY_FOOT, 22: SURVEY_FOOT / 12, 23: 3 * SURVEY_FOOT, 24: 5280 * SURVEY_FOOT}

# Bit of the flags of a block that is an external reference.
EXTERNAL = 4


def draw(path: Path, scale: float | PerUnit) -> Canvas:
    """The marks of a DXF drawing, enlarged by a scale."""
    file = readfile(path)
    # Do not draw the frames of clips: CAD shows them on the screen, but does not plot them.
    file.header["$XCLIPFRAME"] = 0
    # Programs without heights squeeze blocks flat, and ezdxf cannot place these.
    for entity in file.entitydb.values():
        if entity.dxftype() == "INSERT":
            entity.dxf.zscale = entity.dxf.zscale or 1.0
    code = file.header.get("$INSUNITS", 0)
    if code not in range(25):
        raise WorldError(f"$INSUNITS is {code!r}, expected 0 to 24")
    unit = SURVEY.get(code, 1.0)
    if 0 < code <= 20:
        unit = units.conversion_factor(InsertUnits(code), InsertUnits.Meters)
    scale = scale_of(scale, unit)
    canvas = Canvas(CURVE_ERROR / (unit * scale))
    canvas.unit = unit * scale
    canvas.scale = scale
    canvas.scales = unit_scales(unit)
    canvas.declared = code != 0
    config = Configuration(
        max_flattening_distance=canvas.tolerance,
        line_policy=LinePolicy.SOLID,
        background_policy=BackgroundPolicy.CUSTOM,
        custom_bg_color=PAPER,
    )
    # Take the first layout that holds entities: model space comes before paper space.
    read = next((layout for layout in file.layouts if any(map(_is_content, layout))), None)
    items = set[Any]()
    for layout in file.layouts:
        items.update(_items(layout, {}) if layout is read else layout)
        if layout is read:
            with redirect_stdout(StringIO()):
                painter = _EntityFilter(RenderContext(file), canvas, unit * scale, config)
                painter.unplotted = {e.dxf.name.casefold() for e in file.layers if not e.dxf.plot}
                painter.frozen = {e.dxf.name.casefold() for e in file.layers if e.is_frozen()}
                painter.draw_layout(layout)
        for entity in layout:
            if layout is not read or not _is_content(entity):
                canvas.leave("viewport" if layout is read else "entity of another layout", entity)
    canvas.held = len(items)
    rename(canvas, file.encoding)
    return canvas


def _is_content(entity: Any) -> bool:
    return bool(entity.dxftype() != "VIEWPORT")


def _items(entities: Iterable[Any], blocks: dict[str, Any]) -> Iterator[Any]:
    """The entities in a layout and in the blocks that are placed in it, each block once."""
    for entity in entities:
        block = _content(entity)
        if block is None:
            yield entity
            continue
        yield from entity.attribs
        if block.name not in blocks:
            blocks[block.name] = block
            yield from _items(block, blocks)


def _content(entity: Any) -> Any:
    """The block that an entity places; None for other entities, and where there is no block."""
    block = entity.block() if entity.dxftype() == "INSERT" else None
    return None if block is None or block.block.dxf.flags & EXTERNAL else block


class _EntityFilter(Frontend):
    """Walks the entities of a drawing: counts those that are not walls, and draws the others."""

    def __init__(
        self, context: RenderContext, canvas: Canvas, scale: float, config: Configuration
    ) -> None:
        self.painter = _EntityPainter(canvas, scale)
        super().__init__(context, self.painter, config)
        self.canvas = canvas
        # Names of the layers that CAD shows on the screen but does not plot.
        self.unplotted = set[str]()
        # Names of the layers on which no block shows anything.
        self.frozen = set[str]()
        # Whether an entity is drawn as its parts, which are not items themselves.
        self.in_parts = False

    def draw_entity(self, entity: Any, properties: Any) -> None:
        canvas = self.canvas
        kind = entity.dxftype()
        canvas.count(entity.mcount if kind == "INSERT" else 1)
        self.painter.dashed = bool(properties.linetype_pattern)
        if kind == "INSERT":
            self._place(entity, properties)
            return
        if self.in_parts:
            super().draw_entity(entity, properties)
            return
        if kind in LEFT_OUT or (kind in PATTERNED and not entity.has_solid_fill):
            canvas.leave(_kind(entity), _source(entity))
            return
        if properties.layer.casefold() in self.unplotted:
            canvas.leave(f"unplotted stroke: {properties.layer}", _source(entity))
            return
        items = _sources(entity)
        canvas.begin(*items)
        before = len(canvas.marks)
        self.in_parts = True
        super().draw_entity(entity, properties)
        self.in_parts = False
        if len(canvas.marks) == before and kind not in self._dispatch:
            canvas.fates |= dict.fromkeys(items, _kind(entity))

    def _place(self, entity: Any, properties: Any) -> None:
        """Draw the block that an entity inserts."""
        block = _content(entity)
        if properties.layer.casefold() in self.frozen:
            self.skip_entity(entity, "invisible")
        elif block is not None:
            for each in block:
                # What ezdxf skips: attributes, of which each insert has its own, and unknown kinds.
                if each.dxftype() == "ATTDEF" or hasattr(each, "xtags"):
                    self.canvas.leave(_kind(each), each)
            super().draw_entity(entity, properties)
        elif entity.block() is None:
            self.canvas.leave(f"undefined block: {entity.dxf.name}", _source(entity))
        else:
            path = entity.block().block.dxf.get("xref_path", "") or entity.dxf.name
            self.canvas.leave(f"external reference: {path}", _source(entity))

    def skip_entity(self, entity: Any, msg: str) -> None:
        self.canvas.count()
        if self.in_parts:
            return
        reason = "hidden part" if msg == "invisible" else _kind(entity)
        for each in _items([_source(entity)], {}):
            self.canvas.leave(reason, each)


def _kind(entity: Any) -> str:
    """The reason to leave out an entity: a name for its kind, or its kind and its layer."""
    known = LEFT_OUT | PATTERNED
    return known.get(entity.dxftype(), f"{entity.dxftype()}: {_layer(entity)}")


def _layer(entity: Any) -> str:
    """The layer of an entity; ezdxf keeps that of unknown kinds apart."""
    source = _source(entity)
    if hasattr(source, "xtags"):
        return str(source.graphic_properties().get("layer", "0"))
    return str(source.dxf.get("layer", "0"))


def _sources(entity: Any) -> list[Any]:
    """The entities of the file that an entity may be a copy of."""
    placed = getattr(entity, "source_block_reference", None)
    if entity.dxftype() != "ELLIPSE" or placed is None or entity.is_copy:
        return [_source(entity)]
    # Of circles and arcs that a block stretches, ezdxf does not say which one became an ellipse.
    block = _content(placed) or ()
    return [each for each in block if each.dxftype() in ("ARC", "CIRCLE", "LWPOLYLINE", "POLYLINE")]


def _source(entity: Any) -> Any:
    """The entity of the file that an entity is a copy of."""
    # Objects of other programs, unknown to ezdxf, are wrapped.
    entity = getattr(entity, "entity", entity)
    return entity.origin_of_copy or entity


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
        # The graphics of other programs' objects may have no layer of their own.
        whole = (_layer(e) for e, _ in self.entity_stack if e.dxftype() != "INSERT")
        layer = next(whole, "0") if properties.layer == "0" else properties.layer
        return Mark(
            None,
            layer,
            (layer, next(names, "")),
            contrast=contrast,
            dashed=self.dashed,
            colour=properties.color[:7].lower(),
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
            distance = 0.5 * min(self.canvas.tolerance, max(extent / 200.0, ROUNDING))
            corners = np.array([tuple(p) for p in path.flattening(distance, segments=4)])
            # Splines are flattened finer than the distance asks for: drop the points in excess.
            line = shapely.simplify(shapely.linestrings(corners), distance, preserve_topology=False)
            corners = shapely.get_coordinates(line)
        return corners * self.scale

    def _nothing(self, *_: Any, **__: Any) -> None:
        """Draw nothing: `_EntityFilter` counts points and pictures, and the paper has no colour."""

    draw_point = draw_image = set_background = clear = _nothing
