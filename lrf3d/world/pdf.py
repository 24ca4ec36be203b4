"""Drawings in PDF: the paths of a page, by pdfium, in metres on paper.

The lower left corner of the page as it is shown is (0, 0). Layers are those of optional content;
what they hide, and what clips cut off, is left out. Texts and pictures are counted. A page that
holds pictures alone was scanned, and is read as a picture.
"""

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lrf3d.errors import WorldError, missing_extra
from lrf3d.geometry import Float
from lrf3d.world.drawing import CURVE_ERROR, Canvas, Mark, area_of, curve_points, pen_of
from lrf3d.world.pictures import plan_of_picture
from lrf3d.world.plan import Plan

POINT = 0.0254 / 72.0
"""The unit of PDF [m]."""

PIXEL, LARGEST_SIDE = 0.02, 6000
"""Side of a pixel [m] of a scanned page, and the most pixels of a side."""

DEEPEST = 50
"""Most forms within each other."""

COUNTED = {1: "text", 3: "picture", 4: "shading"}
"""Objects that are not read, by pdfium's number of their type."""


class _Page(NamedTuple):
    pdfium: Any
    handle: Any
    scale: float
    """Metres in a unit of the page."""
    matrix: Float
    """From the units of the page to metres (3, 3), turned as it is shown."""
    size: tuple[float, float]
    """Width and height [m]."""
    hidden: set[str]
    """Names of layers that are off."""


def draw_pdf(path: Path, scale: float, page: int) -> Canvas:
    """The marks of a page of a PDF file, enlarged by a scale."""
    import shapely

    shown = _page(path, scale, page)
    canvas = Canvas(min(CURVE_ERROR, 2e-4 * max(shown.size)))
    painter = _Painter(shown, canvas, pen_of(scale))
    raw, handle = shown.pdfium, shown.handle
    objects = [raw.FPDFPage_GetObject(handle, n) for n in range(raw.FPDFPage_CountObjects(handle))]
    painter.paint(objects, shown.matrix, shapely.box(0.0, 0.0, *shown.size), 0)
    return canvas


def read_scan(path: Path, scale: float, page: int, threshold: float | None) -> Plan:
    """The plan of a scanned page, as of a picture."""
    shown = _page(path, scale, page)
    side = max(PIXEL, max(shown.size) / LARGEST_SIDE)
    picture = shown.handle.render(scale=shown.scale / side).to_pil().convert("RGB")
    return plan_of_picture(np.asarray(picture), side, threshold)


def _page(path: Path, scale: float, number: int) -> _Page:
    try:
        import pypdf
        import pypdfium2
    except ImportError:
        raise missing_extra("a PDF drawing needs pypdfium2 and pypdf", "pdf") from None
    document = pypdfium2.PdfDocument(path)
    if not 1 <= number <= len(document):
        raise WorldError(f"has no page {number}; --page is 1 to {len(document)}")
    handle, file = document[number - 1], pypdf.PdfReader(path)
    unit = POINT * scale * float(file.pages[number - 1].user_unit)
    left, bottom, right, top = handle.get_cropbox()
    turn = handle.get_rotation() // 90 % 4
    # Clockwise, as it is shown.
    cosine, sine = [(1, 0), (0, -1), (-1, 0), (0, 1)][turn]
    matrix = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    corners = np.array([[left, bottom, 1.0], [right, top, 1.0]]) @ matrix.T
    matrix[:2, 2] = -corners[:, :2].min(axis=0)
    matrix[:2] *= unit
    wide, high = np.ptp(corners[:, :2], axis=0) * unit
    return _Page(pypdfium2.raw, handle, unit, matrix, (wide, high), _hidden(file))


def _hidden(file: Any) -> set[str]:
    """Names of the layers that are off when a file is opened."""
    content = file.trailer["/Root"].get("/OCProperties", {})
    usual = content.get("/D", {})
    off = usual.get("/OFF", [])
    if usual.get("/BaseState") == "/OFF":
        on = {each.idnum for each in usual.get("/ON", [])}
        off = [each for each in content.get("/OCGs", []) if each.idnum not in on]
    return {str(each.get_object().get("/Name", "")) for each in off}


class _Painter:
    """Paints the objects of a page on a canvas."""

    def __init__(self, page: _Page, canvas: Canvas, pen: float) -> None:
        self.raw, self.hidden = page.pdfium, page.hidden
        self.canvas, self.pen = canvas, pen
        self._clips = dict[bytes, Any]()

    def paint(self, objects: list[Any], matrix: Float, clip: Any, depth: int) -> None:
        """Paint objects, and those in forms; their units become metres by a matrix."""
        raw = self.raw
        if depth > DEEPEST:
            raise WorldError(f"has forms within each other, more than {DEEPEST} deep")
        for each in objects:
            self.canvas.count()
            kind = raw.FPDFPageObj_GetType(each)
            layer = self._layer(each)
            if layer in self.hidden:
                self.canvas.left_out["hidden part"] += 1
            elif kind == raw.FPDF_PAGEOBJ_FORM:
                count = raw.FPDFFormObj_CountObjects(each)
                inner = [raw.FPDFFormObj_GetObject(each, number) for number in range(count)]
                visible = self._clip(each, matrix, clip)
                self.paint(inner, matrix @ self._matrix(each), visible, depth + 1)
            elif kind == raw.FPDF_PAGEOBJ_PATH:
                self._path(each, layer, matrix, self._clip(each, matrix, clip))
            else:
                self.canvas.left_out[COUNTED.get(kind - 0, "unknown object")] += 1

    def _path(self, each: Any, layer: str, outer: Float, clip: Any) -> None:
        raw, canvas = self.raw, self.canvas
        rule, stroked = ctypes.c_int(), ctypes.c_int()
        raw.FPDFPath_GetDrawMode(each, rule, stroked)
        matrix = outer @ self._matrix(each)
        count = raw.FPDFPath_CountSegments(each)
        segments = (raw.FPDFPath_GetPathSegment(each, number) for number in range(count))
        lines = self._lines(segments, matrix)
        mark = Mark(None, layer, (layer,))
        if rule.value:
            contrast, alpha = self._colour(raw.FPDFPageObj_GetFillColor, each)
            solid = mark._replace(contrast=contrast, opaque=alpha > 0.98)
            if alpha > 0.02:
                canvas.area(lines, solid, clip, winding=rule.value == raw.FPDF_FILLMODE_WINDING)
        if stroked.value:
            width = ctypes.c_float()
            raw.FPDFPageObj_GetStrokeWidth(each, width)
            wide = width.value * float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
            contrast, alpha = self._colour(raw.FPDFPageObj_GetStrokeColor, each)
            wide = wide if wide > self.pen or contrast < 0.08 else 0.0
            pen = mark._replace(width=wide, contrast=contrast, opaque=alpha > 0.98)
            cap = "square" if raw.FPDFPageObj_GetLineCap(each) else "flat"
            for line in lines if alpha > 0.02 else ():
                canvas.line(line, pen, clip, cap)

    def _lines(self, segments: Iterator[Any], matrix: Float) -> list[Float]:
        """The lines (k, 2) [m] of a path."""
        raw, lines = self.raw, list[list[Float]]()
        x, y, controls = ctypes.c_float(), ctypes.c_float(), list[Float]()
        for segment in segments:
            raw.FPDFPathSegment_GetPoint(segment, x, y)
            point = matrix[:2, :2] @ [x.value, y.value] + matrix[:2, 2]
            kind = raw.FPDFPathSegment_GetType(segment)
            if kind == raw.FPDF_SEGMENT_MOVETO or not lines:
                lines.append([point[None]])
            elif kind == raw.FPDF_SEGMENT_LINETO:
                lines[-1].append(point[None])
            else:
                controls.append(point)
                if len(controls) == 3:
                    whole = np.stack([lines[-1][-1][-1], *controls])
                    lines[-1].append(curve_points(whole, self.canvas.tolerance))
                    controls = []
            if raw.FPDFPathSegment_GetClose(segment):
                lines[-1].append(lines[-1][0][:1])
        return [np.concatenate(line) for line in lines]

    def _clip(self, each: Any, matrix: Float, clip: Any) -> Any:
        """What the clip paths of an object leave of a clip."""
        raw = self.raw
        own = raw.FPDFPageObj_GetClipPath(each)
        for path in range(max(raw.FPDFClipPath_CountPaths(own), 0) if own else 0):
            count = max(raw.FPDFClipPath_CountPathSegments(own, path), 0)
            segments = (raw.FPDFClipPath_GetPathSegment(own, path, n) for n in range(count))
            lines = self._lines(segments, matrix)
            key = b"".join(line.tobytes() for line in lines)
            if key not in self._clips:
                self._clips[key] = area_of(lines, winding=True)
            if lines:
                region = self._clips[key]
                clip = clip if region.covers(clip) else clip.intersection(region)
        return clip

    def _layer(self, each: Any) -> str:
        """The name of the layer in which an object stands."""
        raw, name = self.raw, ""
        for number in range(max(raw.FPDFPageObj_CountMarks(each), 0)):
            mark = raw.FPDFPageObj_GetMark(each, number)
            if self._text(raw.FPDFPageObjMark_GetName, mark) == "OC":
                name = self._text(raw.FPDFPageObjMark_GetParamStringValue, mark, b"Name") or name
        return name

    @staticmethod
    def _text(read: Callable[..., Any], *arguments: Any) -> str:
        """What a function of pdfium writes into a buffer of UTF-16."""
        size, buffer = ctypes.c_ulong(), (ctypes.c_ushort * 256)()
        read(*arguments, buffer, 512, size)
        return bytes(buffer)[: max(min(size.value, 512) - 2, 0)].decode("utf-16-le", "replace")

    def _matrix(self, each: Any) -> Float:
        m = self.raw.FS_MATRIX()
        self.raw.FPDFPageObj_GetMatrix(each, m)
        return np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0.0, 0.0, 1.0]])

    @staticmethod
    def _colour(read: Callable[..., Any], each: Any) -> tuple[float, float]:
        """How far a colour is from white, and how opaque it is, both from 0 to 1."""
        red, green, blue, alpha = (ctypes.c_uint() for _ in range(4))
        if not read(each, red, green, blue, alpha):
            # A pattern.
            return 0.3, 0.5
        opaque = alpha.value / 255.0
        return opaque * (1.0 - min(red.value, green.value, blue.value) / 255.0), opaque
