"""Checking whether a drawing has the size of a building, and which scales would correct it.

The strokes of a drawing enter; advice leaves. It only offers scales that were tried: they make the
drawing as large as a building, and its doors, if it has any, as wide as doors.
"""

import re

import numpy as np

from lrf3d.base.text import Note, counted
from lrf3d.geometry.lines import Float, lengths
from lrf3d.plans.canvas import Canvas
from lrf3d.plans.rules.doors import USUAL, find_doors
from lrf3d.plans.rules.strokes import MAY_OPEN, Strokes
from lrf3d.world.model import SHEET
from lrf3d.world.model import UNITS as LENGTHS

# Least and largest extent of a building [m]: a hut, and an airport.
EXTENT = (3.0, 400.0)

# In every plan, less than half of the total wall length belongs to walls longer than this [m].
LONGEST = 15.0

# Geometric mean of the wall length and the extent of most plans [m].
USUAL_SIDE = 7.0

# Least and largest extent of most buildings [m].
USUAL_EXTENT = (10.0, 200.0)

# Number of doors, each a leaf and its arc, that only another scale finds, from which it is offered
# although the size is usual: gates of other widths are few.
CLEAR = 3

# Units of drawings [m]; no building is drawn in kilometres.
UNITS = {"metres": 1.0, **{name: size for size, name in LENGTHS.items() if size < 1.0}}

# Usual scales of sheets: 1 to each of these.
SHEETS = (20, 25, 50, 75, 100, 125, 150, 200, 250, 500, 1000)

# Matches a scale of a sheet, such as 1:125, but no fraction of an inch.
RATIO = re.compile(
    r"""(?<![\d.:/])1\s?(?!/\s?\d+\s?(?:["″”]|''|in(?:ch|\.?\s?=)))[:/]\s?(\d{1,4})(?![\d.:/])"""
)

# Matches a scale in inches per foot, such as 1/4" = 1'-0".
INCHES = re.compile(
    r"""(?<![\d/.])(?<![\d'′’][ -])([1-9]\d{0,3})(?:/(\d{1,4}))?\s?["″”]\s?=\s?(\d{1,4})\s?['′’]"""
)


def sheet_scales(texts: str, scale: float = 1.0) -> dict[float, str]:
    """The factors that correct the scale of a sheet, by what they are called.

    They lead to the scales that the sheet names, or else to the usual ones.

    >>> sheet_scales("Plan 1:125"), len(sheet_scales(""))
    ({125.0: 'as 1:125 on the sheet'}, 11)
    >>> sheet_scales("1/8\u2033 = 1\u2032-0\u2033; a door of 3\u2032-0\u2033 = 1\u2032")
    {96.0: 'as 1/8″ = 1′ on the sheet'}
    """
    written = {float(n): f"1:{n}" for n in RATIO.findall(texts)}
    for inches in INCHES.finditer(texts):
        paper, parts, feet = (int(each or 1) for each in inches.groups())
        written[12.0 * feet * parts / paper] = inches[0]
    named = {size / scale: f"as {text} on the sheet" for size, text in written.items() if size > 4}
    return named or {number / scale: f"if it is 1:{number}" for number in SHEETS}


def unit_scales(unit: float) -> dict[float, str]:
    """The factors that correct a unit [m], by what they are called.

    >>> unit_scales(1.0)[0.01]
    'if it is in centimetres'
    """
    return {float(f"{size / unit:.6g}"): f"if it is in {name}" for name, size in UNITS.items()}


def size_doubt(canvas: Canvas, strokes: Strokes) -> tuple[tuple[Note, ...], dict[str, float]]:
    """A doubt about the size of a drawing, if there is one, and the scales that would fit.

    These are factors of its scale, by what they are called.
    """
    # Frames and dimensions are longer than walls.
    drawn = strokes.segments[strokes.role != "annotation"]
    if not len(drawn) or not canvas.scales:
        return (), {}
    points = drawn.reshape(-1, 2)
    long = lengths(drawn)
    usual = _quantile(long, long, 0.5)
    # A single long line does not make a large plan.
    weights = np.repeat(long, 2)
    size = np.array([_quantile(x, weights, 0.98) - _quantile(x, weights, 0.02) for x in points.T])
    extent = float(size.max())
    usual_size = extent >= SHEET and usual <= LONGEST
    if usual_size and (strokes.doors or canvas.declared):
        return (), {}
    large = [each for each in canvas.scales if EXTENT[0] <= each * extent <= EXTENT[1]]
    # A hall may have longer walls than any other plan.
    fits = [each for each in large if each * usual <= LONGEST] or large
    doors = [_doors(strokes, factor) for factor in fits]
    most = max(doors, default=0)
    # A plan in feet may have a usual size in metres, but no doors.
    if usual_size and most < CLEAR:
        return (), {}
    chosen = [each for each, count in zip(fits, doors, strict=True) if count == most]
    # Without doors, go by the walls; the second also by the extent: furniture is of short lines.
    side = float(np.sqrt(usual * extent))
    second = sorted(chosen, key=lambda factor: abs(np.log(factor * side / USUAL_SIDE)))[:1]
    chosen.sort(
        key=lambda factor: (
            abs(np.log(factor * usual / 4.0))
            + abs(np.log(factor * extent / np.clip(factor * extent, *USUAL_EXTENT)))
        )
    )
    likely = [*dict.fromkeys(chosen[:1] + second + chosen)]
    wide, high = np.ptp(points, axis=0)
    wider = f", {counted(most, 'door')} of usual width" if most else ""
    scales = {
        f"{canvas.scales[each]} ({metres(each * wide)} by {metres(each * high)}{wider})": each
        for each in likely[:3]
    }
    ways = [f"--scale {canvas.scale * factor:g} {words}" for words, factor in scales.items()]
    found = f"a plan of {metres(wide)} by {metres(high)}, with walls of {metres(usual)}?"
    return (Note(found, "; ".join(ways) or "--scale corrects it"),), scales


def metres(length: float) -> str:
    """A length [m] in words.

    >>> metres(10_000.0), metres(3.14159)
    ('10,000 m', '3.14 m')
    """
    return f"{length:,.0f} m" if length >= 1000.0 else f"{length:.3g} m"


def _quantile(values: Float, weights: Float, share: float) -> float:
    """The weighted quantile of values (n,): up to it, weights (n,) reach a share of their sum."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, share * total[-1])]])


def _doors(strokes: Strokes, factor: float) -> int:
    """The number of doors of usual width when a drawing is enlarged by a factor."""
    drawn = np.isin(strokes.role, MAY_OPEN)
    doors, _ = find_doors(factor * strokes.segments, strokes.line, drawn)
    return sum(USUAL[0] <= door.width <= USUAL[1] for door in doors)
