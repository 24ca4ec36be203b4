"""A drawing: lines and areas as they are seen, each with its layer, its width and its colour.

The readers of DXF, SVG and PDF paint marks on a :class:`Canvas`, in the order of the file and in
metres. `Canvas.seen` returns what is visible: an area hides the marks that were painted before.
"""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.base.errors import WorldError
from lrf3d.base.units import INCH
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, Int

# Largest distance [m] of chords from their curve: about the width of a laser beam.
CURVE_ERROR = 0.005

# Upper bounds on marks and on points: larger drawings are blocks nested in blocks, which multiply.
MOST_MARKS = 150_000
MOST_POINTS = 2_000_000

# A typographic point [m].
POINT = INCH / 72

# Value of each colour channel of white.
WHITE = 255.0

# Contrast of what is painted with a gradient or a pattern, whose colours are not read.
UNKNOWN = 0.3

# Opacity below which a mark is not seen; one above 1 less this hides what is below it.
FAINT = 0.02

# Contrast below which a mark has the colour of the paper.
PALEST = 0.08

# Largest mean thickness [m] of a wall that is drawn as an area; only a thicker area may be a floor.
THICKEST_SOLID = 0.6

# An area hides lines from this distance [m] inside its edge: a line on the edge is half seen.
HIDDEN = 0.002

# An area of which a clip leaves a strip narrower than this [m] only touches it, but for rounding.
TOUCHING = 1e-5


class Mark(NamedTuple):
    """A line or an area that is painted, with what the file says about it."""

    # The shapely geometry [m].
    shape: Any
    layer: str = ""
    # Names that may give its role, the best first: those of its layer and of its block in DXF, of
    # its element and of the groups around it, from the inside out, in SVG.
    names: tuple[str, ...] = ()
    # Width [m] of a line; a line with a width is painted as an area.
    width: float = 0.0
    # Difference from the colour of the paper, from 0 to 1. A mark in the colour of the paper is not
    # seen, but hides what is below it.
    contrast: float = 1.0
    opaque: bool = True
    # Whether it is a dashed line: it shows a beam overhead or a path, and nothing that stands.
    dashed: bool = False
    # Its colour as ``#rrggbb``; empty where it is not known.
    colour: str = ""
    # The items of the file that it is drawn for.
    items: tuple[Any, ...] = ()
    # The middle of a thin line that is painted as an area, since it is as light as white paper.
    middle: Any = None


class PerUnit(NamedTuple):
    """A scale that is given in metres per unit of the drawing."""

    metres: float


def scale_of(scale: float | PerUnit, unit: float) -> float:
    """The factor of a scale, where a unit of the drawing is read as so many metres."""
    return scale.metres / unit if isinstance(scale, PerUnit) else scale


class Canvas:
    """Takes what a reader paints, bounds the work for it, and returns what is seen."""

    def __init__(self, tolerance: float, pen: float = 0.0) -> None:
        # Largest distance [m] of chords from their curve.
        self.tolerance = tolerance
        # Width [m] above which a stroke is an area.
        self.pen = pen
        # For each item of the file: the reason for which it is left out; empty if it is painted.
        self.fates = dict[Any, str]()
        # The number of items that the file holds, as counted by the library that reads it.
        self.held = 0
        # The number of properties that are ignored, such as patterns, by name.
        self.ignored = Counter[str]()
        self._items: tuple[Any, ...] = ()
        self.marks = list[Mark]()
        # What the reader assumed, in words.
        self.said = ""
        # Share of the sheet that pictures cover.
        self.pictured = 0.0
        # Unit of the drawing [m], after scaling.
        self.unit = 1.0
        # The scale of the drawing, and factors that may correct it, with their reasons.
        self.scale = 1.0
        self.scales = dict[float, str]()
        # Whether the paper is dark although no area of it is painted.
        self.dark = False
        # Whether the source names its unit.
        self.declared = False
        self._work = self._points = 0

    @classmethod
    def of_sheet(cls, side: float, scale: float) -> "Canvas":
        """Canvas for a sheet whose longer side measures `side` [m] after scaling."""
        # A line has two faces if it is wider [m] than a thin wall, and than any pen on paper.
        thin_wall = 0.12
        pen = 1.05e-3
        # A sheet that is not enlarged is small, and so are its curves: they need finer chords.
        return cls(min(CURVE_ERROR, 2e-4 * side), max(thin_wall, pen * scale))

    def begin(self, *items: Any) -> None:
        """Begin to paint items of the file."""
        self._items = items
        self.fates |= dict.fromkeys(items, "")

    def leave(self, reason: str, item: Any = None) -> None:
        """Leave out an item for a reason, unless it is painted elsewhere."""
        self.fates.setdefault(object() if item is None else item, reason)

    @property
    def left_out(self) -> Counter[str]:
        """The number of items that are left out, by reason, and of properties that are ignored."""
        return Counter(filter(None, self.fates.values())) + self.ignored

    def count(self, steps: int = 1) -> None:
        """Count steps of work, also those that paint nothing, and raise if there are too many."""
        self._work += steps
        if self._work > MOST_MARKS or self._points > MOST_POINTS:
            raise WorldError(
                f"draws more than {MOST_MARKS:,} lines or {MOST_POINTS:,} points, blocks and uses"
                " in each other counted; take out what is no wall"
            )

    def line(self, points: Float, mark: Mark, clip: Any = None, cap: str = "flat") -> None:
        """Paint a line through points (k, 2) [m], with the looks of a mark."""
        self._points += len(points)
        self.count()
        points = points[np.append(True, (points[1:] != points[:-1]).any(axis=1))]
        if len(points) < 2:
            return
        if not (np.abs(points) <= LARGEST_COORDINATE).all():
            raise WorldError(
                f"holds a line that is not finite, or over {LARGEST_COORDINATE:g} m away; --scale"
                " 0.001, if it is in millimetres"
            )
        closed = len(points) > 3 and (points[0] == points[-1]).all()
        shape = shapely.linearrings(points) if closed else shapely.linestrings(points)
        if mark.width:
            thin = mark.width <= self.pen
            mark = mark._replace(middle=_clipped(shape, clip) if thin else None)
            shape = shape.buffer(mark.width / 2.0, cap_style=cap, join_style="mitre")
        self._add(shape, mark, clip)

    def area(self, rings: list[Float], mark: Mark, clip: Any = None, winding: bool = False) -> None:
        """Paint the area in rings (k, 2) [m], by the even-odd rule or the winding numbers."""
        self._points += sum(map(len, rings))
        self.count(len(rings))
        self._add(area_of(rings, winding), mark, clip)

    def shape(
        self,
        lines: list[Float],
        mark: Mark,
        clip: Any,
        fill: tuple[float, float, bool],
        stroke: tuple[float, float, float, bool],
    ) -> None:
        """Fill and stroke lines (k, 2) [m].

        A fill is its contrast, how opaque it is, and whether it goes by winding numbers; a stroke
        is contrast, opacity, width [m], and whether square caps extend it beyond its ends.
        """
        contrast, alpha, winding = fill
        if alpha > FAINT:
            solid = mark._replace(contrast=contrast, opaque=alpha > 1.0 - FAINT, dashed=False)
            self.area(lines, solid, clip, winding)
        contrast, alpha, width, square = stroke
        if alpha > FAINT:
            # A stroke in the colour of the paper hides the marks below it.
            wide = width if width > self.pen or contrast < PALEST else 0.0
            pen = mark._replace(width=wide, contrast=contrast, opaque=alpha > 1.0 - FAINT)
            for line in lines:
                self.line(line, pen, clip, "square" if square else "flat")

    def _add(self, shape: Any, mark: Mark, clip: Any) -> None:
        cut = _clipped(shape, clip)
        touches = cut is not shape and is_area(cut) and 2.0 * cut.area < TOUCHING * cut.length
        if not (cut.is_empty or touches):
            self.marks.append(mark._replace(shape=cut, items=self._items))

    def find_paper(self) -> None:
        """Take the paper for dark if all marks are white, and some as thin as lines or walls."""
        white = all(mark.contrast < FAINT for mark in self.marks)
        if white and not all(is_thick(mark.shape) for mark in self.marks):
            self.dark = True
            self.said = "all is drawn in white, as on dark paper"

    def seen(self) -> list[Mark]:
        """The marks without the paper and what later areas hide."""
        return _seen(_on_paper(self.marks, self.dark))


def _clipped(shape: Any, clip: Any) -> Any:
    """What a clip, if there is one, leaves of a shape."""
    return shape if clip is None or clip.covers(shape) else shape.intersection(clip)


def area_of(rings: list[Float], winding: bool = False) -> Any:
    """The area in rings (k, 2), by the even-odd rule or by their winding numbers."""
    rings = [ring for ring in rings if len(ring) > 2 and np.isfinite(ring).all()]
    if not rings:
        return shapely.Polygon()
    plain = shapely.polygons([shapely.linearrings(ring) for ring in rings])
    turns = np.where(shapely.is_ccw(shapely.get_exterior_ring(plain)), 1, -1)
    parts = shapely.buffer(shapely.make_valid(plain), 0.0)
    kept = shapely.area(parts) > 0.0
    parts = parts[kept]
    turns = turns[kept]
    tree = shapely.STRtree(parts)
    inner, outer = tree.query(parts, predicate="covered_by")
    # For each part: the number of rings around it, itself included, and its winding number or its
    # parity, of which 0 is a hole.
    depth = np.bincount(inner, minlength=len(parts))
    number = np.bincount(inner, turns[outer], len(parts)) if winding else depth % 2
    area = shapely.union_all(parts[(depth == 1) & (number != 0)])
    for level in range(2, int(depth.max(initial=1)) + 1):
        area = area.difference(shapely.union_all(parts[(depth == level) & (number == 0)]))
        area = area.union(shapely.union_all(parts[(depth == level) & (number != 0)]))
    return area


def curve_points(controls: Float, tolerance: float) -> Float:
    """Points (k, 2) after the first on the Bézier curve of two, three or four controls (n, 2).

    The chords are no farther from the curve than the tolerance.
    """
    # A quadratic curve is also a cubic one.
    if len(controls) == 3:
        one, two, three = controls
        controls = np.array([one, one + (two - one) / 1.5, three + (two - three) / 1.5, three])
    if len(controls) < 4:
        return controls[1:]
    # The second differences of the controls bound the error of the chords.
    bends = controls[:-2] - 2.0 * controls[1:-1] + controls[2:]
    count = np.ceil(np.sqrt(0.75 * np.hypot(*bends.T).max() / (0.9 * tolerance)))
    t = np.linspace(0.0, 1.0, int(np.clip(np.nan_to_num(count), 1, 2000)) + 1)[1:, None]
    a, b, c, d = controls
    points = a * (1 - t) ** 3 + b * 3 * t * (1 - t) ** 2 + c * 3 * t**2 * (1 - t) + d * t**3
    return np.asarray(points, dtype=np.float64)


def _on_paper(marks: list[Mark], dark: bool) -> list[Mark]:
    """The marks without the paper, if it is painted.

    On dark paper, contrasts are reversed: light marks stand out, and thin lines have no faces,
    unless light rooms are left open in a dark mass of walls, where they are doorways.
    """
    if len(marks) > 1 and _is_paper(marks[0], marks[1:]):
        dark = marks[0].contrast > 0.5
        marks = marks[1:]
    if not dark:
        return marks
    mass = any(not m.middle and m.contrast < PALEST and is_thick(m.shape) for m in marks)
    return [
        m._replace(contrast=1.0 - m.contrast, shape=m.shape if mass else m.middle or m.shape)
        for m in marks
    ]


def _is_paper(first: Mark, others: list[Mark]) -> bool:
    """Whether the mark that is painted first is an opaque rectangle around all others."""
    sheet = shapely.box(*first.shape.bounds)
    drawn = shapely.box(*shapely.total_bounds([m.middle or m.shape for m in others]))
    fills = first.opaque and first.shape.area > 0.99 * sheet.area
    return bool(fills and first.shape.geom_type == "Polygon" and sheet.covers(drawn))


def _seen(marks: list[Mark]) -> list[Mark]:
    """What later areas leave of the marks, without what has the colour of the paper."""
    shapes = np.array([mark.shape for mark in marks], dtype=object)
    hiding = np.flatnonzero([mark.opaque and is_area(mark.shape) for mark in marks])
    return [
        mark._replace(shape=shape)
        for mark, shape in zip(marks, _uncovered(shapes, hiding), strict=True)
        # Rooms are seen although they are nearly white.
        if (mark.contrast >= PALEST or (mark.contrast > FAINT and is_thick(shape)))
        and not shape.is_empty
    ]


def is_thick(shape: Any) -> bool:
    """Whether a geometry is an area that is thicker than a wall."""
    return bool(2.0 * shape.area > THICKEST_SOLID * shape.length)


def _uncovered(shapes: Any, hiding: Int) -> Any:
    """The shapes (n,) without what hiding ones, given by number, cover of those painted before."""
    left = shapes.copy()
    covers = shapely.buffer(shapes[hiding], -HIDDEN, join_style="mitre")
    cover, under = shapely.STRtree(shapes).query(covers, predicate="intersects")
    under, cover = np.stack([under, cover])[:, under < hiding[cover]]
    order = np.argsort(under, kind="stable")
    for over in np.split(order, np.flatnonzero(np.diff(under[order])) + 1):
        for number in under[over[:1]]:
            # An area is cut at the edges of those above it, a line a little inside of them.
            solid = is_area(shapes[number])
            above = shapes[hiding[cover[over]]] if solid else covers[cover[over]]
            left[number] = shapes[number].difference(shapely.union_all(above))
            if not solid:
                # A line that ends on the edge of an area would leave a crumb there: drop it.
                parts = shapely.get_parts(left[number])
                left[number] = shapely.multilinestrings(parts[shapely.length(parts) > 2.5 * HIDDEN])
    return left


def is_area(shape: Any) -> bool:
    """Whether a geometry is an area."""
    return shape.geom_type in ("Polygon", "MultiPolygon")


def contrast_to_white(*channels: float) -> float:
    """The contrast to white paper, from 0 to 1, of a colour in channels up to 255."""
    return 1.0 - min(channels) / WHITE
