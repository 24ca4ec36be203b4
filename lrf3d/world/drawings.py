"""Worlds from drawings, DXF, SVG and PDF: drawing, then plan, then world.

Curves become chords no farther from them than :data:`~lrf3d.world.drawing.CURVE_ERROR`. Walls that
touch are one object. One line says what was left out.
"""

import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import Lrf3dNote, WorldError
from lrf3d.text import counted
from lrf3d.world.drawing import Canvas
from lrf3d.world.model import World
from lrf3d.world.plan import Plan, plan_of

FORMATS = {".dxf": "dxf:draw_dxf", ".svg": "svg:draw_svg", ".pdf": "pdf:draw_pdf"}
"""The module and the function that paint a drawing, by the ending of its file."""


def read_drawing(path: Path, scale: float = 1.0, page: int | None = None, **choice: Any) -> World:
    """Read what stands in a drawing as walls; the options are those of :func:`read_plan`."""
    canvas = _drawn(path, scale, page)
    if not canvas.marks and canvas.left_out["picture"] and path.suffix.lower() == ".pdf":
        from lrf3d.world.pdf import read_scan

        return read_scan(path, scale, page or 1)
    plan = plan_of(canvas.drawing(), **choice)
    world = plan.world(path)
    if plan.left_out or plan.doors:
        doors = f"{counted(len(plan.doors), 'door')} standing open, " if plan.doors else ""
        left = f"left out: {plan.left_out}; " if plan.left_out else ""
        found = f"{path}: {counted(len(world.segments), 'wall')}, {doors}{left}"
        warnings.warn(f"{found}`lrf3d world show` draws it", Lrf3dNote, stacklevel=2)
    return world


def read_plan(
    path: Path,
    *,
    scale: float = 1.0,
    page: int | None = None,
    layers: Sequence[str] = (),
    without: Sequence[str] = (),
) -> Plan:
    """Read a drawing as a plan.

    Args:
        path: The file.
        scale: Enlarges the drawing: 100 for one of 1:100.
        page: The page of a PDF file, from 1.
        layers: The layers that are walls, by patterns such as ``A-WALL*``; all if none is given.
        without: Layers to leave out.
    """
    return plan_of(_drawn(path, scale, page).drawing(), layers, without)


def _drawn(path: Path, scale: float, page: int | None) -> Canvas:
    """What is drawn in a file."""
    module, name = FORMATS[path.suffix.lower()].split(":")
    draw: Callable[..., Canvas] = getattr(import_module(f"lrf3d.world.{module}"), name)
    if module == "pdf":
        return draw(path, scale, page or 1)
    if page is not None:
        raise WorldError("has no pages: --page is for PDF files")
    return draw(path, scale)
