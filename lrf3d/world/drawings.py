"""Worlds from drawings, DXF, SVG and PDF: drawing, then plan, then world.

Curves become chords no farther from them than :data:`~lrf3d.world.drawing.CURVE_ERROR`. Walls that
touch are one object. One line says what was left out.
"""

import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import Lrf3dNote
from lrf3d.text import counted
from lrf3d.world.drawing import Canvas
from lrf3d.world.model import World
from lrf3d.world.plan import Plan, plan_of

FORMATS = {".dxf": "dxf:draw_dxf", ".svg": "svg:draw_svg"}
"""The module and the function that paint a drawing, by the ending of its file."""


def read_drawing(path: Path, **options: Any) -> World:
    """Read what stands in a drawing as walls; the options are those of :func:`read_plan`."""
    plan = read_plan(path, **options)
    world = plan.world(path)
    if plan.left_out or plan.doors:
        doors = f"{counted(len(plan.doors), 'door')} standing open, " if plan.doors else ""
        left = f"left out: {plan.left_out}; " if plan.left_out else ""
        found = f"{path}: {counted(len(world.segments), 'wall')}, {doors}{left}"
        warnings.warn(f"{found}`lrf3d world show` draws it", Lrf3dNote, stacklevel=2)
    return world


def read_plan(
    path: Path, *, scale: float = 1.0, layers: Sequence[str] = (), without: Sequence[str] = ()
) -> Plan:
    """Read a drawing as a plan.

    Args:
        path: The file.
        scale: Enlarges the drawing: 100 for one of 1:100.
        layers: The layers that are walls, by patterns such as ``A-WALL*``; all if none is given.
        without: Layers to leave out.
    """
    module, name = FORMATS[path.suffix.lower()].split(":")
    draw: Callable[[Path, float], Canvas] = getattr(import_module(f"lrf3d.world.{module}"), name)
    return plan_of(draw(path, scale).drawing(), layers, without)
