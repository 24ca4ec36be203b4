"""Drawings in PDF: the paths of a page, by pdfium, in metres on paper.

The lower left corner of the page as it is shown is (0, 0). Layers are those of optional content;
what they hide, and what clips cut off, is left out. Texts, pictures, annotations and other pages
are counted. A page that pictures fill, with hardly a line, was scanned, and is read as a picture.
An item is an object of the page, one of its annotations, or another page.
"""

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from lrf3d.base.errors import WorldError, missing_extra
from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float
from lrf3d.plans.canvas import (
    PALEST,
    POINT,
    UNKNOWN,
    WHITE,
    Canvas,
    Mark,
    PerUnit,
    area_of,
    contrast_to_white,
    curve_points,
    scale_of,
)
from lrf3d.plans.doubts import PICTURED, notes
from lrf3d.plans.plan import Plan
from lrf3d.plans.readers.picture import plan_of_picture
from lrf3d.plans.rules.enclosure import LEAST_CLOSED, closed_share, drawn_cells
from lrf3d.plans.rules.layers import rename
from lrf3d.plans.rules.strokes import Strokes
from lrf3d.plans.scale import sheet_scales, size_doubt

try:
    import pypdf
    import pypdfium2
except ImportError:
    raise missing_extra("a PDF drawing needs pypdfium2 and pypdf", "pdf") from None

# The functions of pdfium, as in C.
raw: Any = pypdfium2.raw

# The nouns that count objects which are not read, by pdfium's number of their type.
COUNTED = {1: "text", 3: "picture", 4: "shading"}

# The types of objects on a scanned page that are left out.
LABELS = (raw.FPDF_PAGEOBJ_PATH, raw.FPDF_PAGEOBJ_TEXT)

# Largest depth of nested forms.
DEEPEST = 50

# Share of a page that the picture of a scan fills at least: it may have a border.
FILLED = 0.5

# Number of lines up to which they may be labels on a scan: larger drawings lie on a background.
MOST_LABELS = 300

# Number of pages that are looked at for lines where the chosen one has none.
MOST_TRIED = 200

# Number of lines and areas up to which a page with large pictures is a scanned one.
MOST_ON_SCAN = 10


def draw(
    path: Path, scale: float | PerUnit, page: int = 1, threshold: float | None = None
) -> Canvas | Plan:
    """The marks of a page of a PDF file, enlarged by a scale, or the plan of a scanned one."""
    document = pypdfium2.PdfDocument(path.read_bytes())
    if not 1 <= page <= len(document):
        raise WorldError(f"has no page {page}; --page is 1 to {len(document)}")
    handle = document[page - 1]
    file = pypdf.PdfReader(path)
    point = POINT * float(file.pages[page - 1].user_unit)
    scale = scale_of(scale, point)
    unit = POINT * scale * float(file.pages[page - 1].user_unit)
    matrix, size = _frame(handle, unit)
    canvas = Canvas.of_sheet(float(size.max()), scale)
    canvas.unit = unit
    objects = [raw.FPDFPage_GetObject(handle, n) for n in range(raw.FPDFPage_CountObjects(handle))]
    painter = _PagePainter(canvas, _hidden(file))
    painter.paint(objects, matrix, shapely.box(0.0, 0.0, *size))
    rename(canvas, "latin-1")
    lines = sum(mark.contrast >= PALEST for mark in canvas.marks)
    canvas.pictured = share = painter.pictured / float(size.prod())
    few = lines <= MOST_ON_SCAN
    canvas.scale = scale
    canvas.scales = sheet_scales(handle.get_textpage().get_text_bounded(), scale)
    if share and (not lines or (few and share > FILLED) or _is_bare(canvas, lines, share)):
        which = f"page {page} of {len(document)}"
        plan = _scanned(handle, which, unit, size, threshold)
        number = np.arange(len(plan.segments))
        seen = Strokes(plan.segments, number, number, np.full(len(number), "wall"))
        doubts, scales = size_doubt(canvas, seen)
        return plan._replace(doubts=doubts or plan.doubts, scales=scales)
    pages = len(document) - 1
    annotations = raw.FPDFPage_GetAnnotCount(handle)
    for reason in ["other page"] * pages + ["annotation"] * annotations:
        canvas.leave(reason)
    held = sum(each.type != raw.FPDF_PAGEOBJ_FORM for each in handle.get_objects(max_depth=DEEPEST))
    canvas.held = held + pages + annotations
    if not lines and len(document) > 1:
        others = [n + 1 for n in range(min(len(document), MOST_TRIED)) if _is_drawn(document[n])]
        advice = f"--page {others[0]} shows some" if others else "no page does"
        raise WorldError(f"page {page} of {len(document)} shows no line; {advice}")
    if threshold is not None:
        raise WorldError("is no scanned page: threshold is for pictures")
    return canvas


def _scanned(page: Any, which: str, unit: float, size: Float, threshold: float | None) -> Plan:
    """The plan of a scanned page of some size (2,) [m]."""
    # Pixels of two centimetres, but 1,000 to 6,000 along a side.
    side = float(np.clip(0.02, *(size.max() / [6000, 1000])))
    objects = [raw.FPDFPage_GetObject(page, n) for n in range(raw.FPDFPage_CountObjects(page))]
    # Lines and texts on a scan are labels, not its plan.
    labels = [o for o in objects if raw.FPDFPageObj_GetType(o) in LABELS]
    for each in labels:
        raw.FPDFPage_RemoveObject(page, each)
    picture = page.render(scale=unit / side).to_pil().convert("RGB")
    plan = plan_of_picture(np.asarray(picture), side, threshold)
    without = f", without {counted(len(labels), 'mark')} on it" if labels else ""
    return plan._replace(said=notes(f"{which}, scanned{without}") + plan.said, unit=unit)


def _frame(page: Any, unit: float) -> tuple[Float, Float]:
    """The matrix (3, 3) from units of a page to metres, as it is shown, and its size (2,) [m]."""
    left, bottom, right, top = page.get_cropbox()
    # Clockwise, as it is shown.
    cosine, sine = [(1, 0), (0, -1), (-1, 0), (0, 1)][page.get_rotation() // 90 % 4]
    matrix = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    corners = np.array([[left, bottom, 1.0], [right, top, 1.0]]) @ matrix.T
    matrix[:2, 2] = -corners[:, :2].min(axis=0)
    matrix[:2] *= unit
    return matrix, np.ptp(corners[:, :2], axis=0) * unit


def _is_bare(canvas: Canvas, lines: int, share: float) -> bool:
    """Whether the lines on a page, a share of which is pictured, are labels and enclose nothing."""
    labelled = share > (PICTURED if lines <= MOST_ON_SCAN else FILLED) and lines <= MOST_LABELS
    return labelled and _closed(canvas) < LEAST_CLOSED


def _closed(canvas: Canvas) -> float:
    """The share of what is drawn that its lines close: little by boxes around labels."""
    lines = [each.shape for each in canvas.marks if each.contrast >= PALEST]
    points, line = shapely.get_coordinates(lines, return_index=True)
    joined = line[1:] == line[:-1]
    strokes = np.hstack([points[:-1][joined], points[1:][joined]])
    return closed_share(drawn_cells(strokes)[0]) if len(strokes) else 0.0


def _is_drawn(page: Any) -> bool:
    """Whether a page shows lines or pictures."""
    kinds = (raw.FPDF_PAGEOBJ_PATH, raw.FPDF_PAGEOBJ_IMAGE, raw.FPDF_PAGEOBJ_FORM)
    return any(each.type in kinds for each in page.get_objects(max_depth=1))


def _hidden(file: Any) -> set[str]:
    """Names of the layers that are off when a file is opened."""
    content = file.trailer["/Root"].get("/OCProperties", {})
    usual = content.get("/D", {})
    off = usual.get("/OFF", [])
    if usual.get("/BaseState") == "/OFF":
        on = {each.idnum for each in usual.get("/ON", [])}
        off = [each for each in content.get("/OCGs", []) if each.idnum not in on]
    names = (each.get_object().get("/Name", "") for each in off)
    return {_decoded(getattr(name, "original_bytes", b"")) for name in names}


def _decoded(name: bytes) -> str:
    """A name; one without a mark of its encoding is decoded as in old files."""
    marks = {b"\xfe\xff": "utf-16", b"\xff\xfe": "utf-16", b"\xef\xbb": "utf-8-sig"}
    return name.decode(marks.get(name[:2], "latin-1"), "replace")


class _PagePainter:
    """Paints the objects of a page on a canvas, without those on hidden layers."""

    def __init__(self, canvas: Canvas, hidden: set[str]) -> None:
        self.canvas = canvas
        self.hidden = hidden
        self._clips = dict[bytes, Any]()
        # Area [m²] of the pictures.
        self.pictured = 0.0

    def paint(self, objects: list[Any], matrix: Float, clip: Any, hidden: bool = False) -> None:
        """Paint objects, and those in forms; their units become metres by a matrix."""
        for each in objects:
            self.canvas.count()
            kind = raw.FPDFPageObj_GetType(each)
            layer = self._layer(each)
            off = hidden or layer in self.hidden
            inner = matrix @ self._matrix(each)
            if kind == raw.FPDF_PAGEOBJ_FORM:
                visible = self._clip(each, matrix, clip)
                count = raw.FPDFFormObj_CountObjects(each)
                held = [raw.FPDFFormObj_GetObject(each, number) for number in range(count)]
                self.paint(held, inner, visible, off)
                continue
            if off:
                self.canvas.leave("hidden part")
            elif kind == raw.FPDF_PAGEOBJ_PATH:
                self.canvas.begin(len(self.canvas.fates))
                self._path(each, layer, inner, self._clip(each, matrix, clip))
            else:
                # A picture fills the unit square, so the determinant is its area.
                pictured = kind == raw.FPDF_PAGEOBJ_IMAGE
                self.pictured += abs(float(np.linalg.det(inner[:2, :2]))) * pictured
                self.canvas.leave(COUNTED.get(kind, "unknown object"))

    def _path(self, each: Any, layer: str, matrix: Float, clip: Any) -> None:
        width = ctypes.c_float()
        rule = ctypes.c_int()
        stroked = ctypes.c_int()
        raw.FPDFPath_GetDrawMode(each, rule, stroked)
        count = raw.FPDFPath_CountSegments(each)
        segments = (raw.FPDFPath_GetPathSegment(each, number) for number in range(count))
        raw.FPDFPageObj_GetStrokeWidth(each, width)
        wide = width.value * float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
        fill = self._colour(raw.FPDFPageObj_GetFillColor, each, rule)
        stroke = self._colour(raw.FPDFPageObj_GetStrokeColor, each, stroked)
        self.canvas.shape(
            self._lines(segments, matrix),
            Mark(
                None,
                layer,
                (layer,),
                dashed=raw.FPDFPageObj_GetDashCount(each) > 0,
                colour=stroke[2] if stroked.value else fill[2],
            ),
            clip,
            (*fill[:2], rule.value == raw.FPDF_FILLMODE_WINDING),
            (*stroke[:2], wide, bool(raw.FPDFPageObj_GetLineCap(each))),
        )

    def _lines(self, segments: Iterator[Any], matrix: Float) -> list[Float]:
        """The lines (k, 2) [m] of a path."""
        lines = list[list[Float]]()
        x = ctypes.c_float()
        y = ctypes.c_float()
        controls = list[Float]()
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
        """The clip of an object: its clip paths within a clip."""
        own = raw.FPDFPageObj_GetClipPath(each)
        for path in range(raw.FPDFClipPath_CountPaths(own) if own else 0):
            count = raw.FPDFClipPath_CountPathSegments(own, path)
            segments = (raw.FPDFClipPath_GetPathSegment(own, path, n) for n in range(count))
            if lines := self._lines(segments, matrix):
                key = b"".join(line.tobytes() for line in lines)
                if key not in self._clips:
                    self._clips[key] = area_of(lines, winding=True)
                region = self._clips[key]
                clip = clip if region.covers(clip) else clip.intersection(region)
        return clip

    def _layer(self, each: Any) -> str:
        """The name of the layer in which an object stands."""
        name = b""
        for number in range(raw.FPDFPageObj_CountMarks(each)):
            mark = raw.FPDFPageObj_GetMark(each, number)
            if self._bytes(raw.FPDFPageObjMark_GetName, mark) == "OC\0".encode("utf-16-le"):
                own = self._bytes(raw.FPDFPageObjMark_GetParamBlobValue, mark, b"Name")
                # Pdfium does not say which layers a membership names.
                self.canvas.ignored["layer membership"] += not own
                name = own or name
        return _decoded(name)

    @staticmethod
    def _bytes(read: Any, *arguments: Any) -> bytes:
        """The bytes that a function of pdfium writes into a buffer."""
        size = ctypes.c_ulong()
        buffer = (ctypes.c_ubyte * 512)()
        read(*arguments, ctypes.cast(buffer, read.argtypes[-3]), 512, size)
        return bytes(buffer)[: min(size.value, 512)]

    def _matrix(self, each: Any) -> Float:
        m = raw.FS_MATRIX()
        raw.FPDFPageObj_GetMatrix(each, m)
        return np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0.0, 0.0, 1.0]])

    @staticmethod
    def _colour(read: Callable[..., Any], each: Any, used: Any) -> tuple[float, float, str]:
        """Contrast and opacity of a colour, 0 if unused, both from 0 to 1, and the colour."""
        *colours, alpha = channels = [ctypes.c_uint() for _ in range(4)]
        if not used.value or not read(each, *channels):
            return UNKNOWN, 0.5 if used.value else 0.0, ""
        opaque = alpha.value / WHITE
        values = [each.value for each in colours]
        return opaque * contrast_to_white(*values), opaque, "#" + bytes(values).hex()
