"""Inputs of shaders, in OpenGL and in the browser: their sources, constants and vertices.

The arrays of a mark are its vertex attributes, in the order of the shader's locations.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry.lines import Float, Single
from lrf3d.studio.scene import look
from lrf3d.studio.scene.look import Setting
from lrf3d.studio.scene.shapes import Faces, GroundPicture, Mark

_SHADERS = Path(__file__).parent / "shaders"

# How far the ground goes past its picture, to the horizon, in the colour of its edge [m].
LAND_REACH = 3000.0


def shader_source(name: str, setting: Setting, *, vertex: bool) -> str:
    """The source of a shader without its version: ``common.glsl``, then ``name.glsl``.

    Words after colons in the name are defined as macros, and ``VERTEX`` in the vertex shader.
    """
    file, *defined = name.split(":")
    lines = [f"#define {each}\n" for each in (["VERTEX"] * vertex + defined)]
    common, own = ((_SHADERS / f"{each}.glsl").read_text() for each in ("common", file))
    # Shaders know constants of the look by their names.
    named = sorted(set(re.findall(r"\b[A-Z][A-Z_]+\b", common + own)))
    values = {each: getattr(look, each) for each in named if hasattr(look, each)}
    values |= {"COOL": setting.cool, "TOP_LIT": setting.top}
    for constant, value in values.items():
        parts = np.ravel(value).tolist()
        kind = f"vec{len(parts)}" if len(parts) > 1 else "float"
        lines.append(f"const {kind} {constant} = {kind}({', '.join(map(repr, parts))});\n")
    return "".join([*lines, common, "#line 1\n", own])


def exposed(day: Any, on: Any, height: Any, setting: Setting) -> Float:
    """Colours (…, 3) in the laser's light, long after it came, as ``common.glsl`` has them.

    How lit they are (…), and how high they lie [m].
    """
    dark = look.NIGHT_LOW + (day @ look.GREY)[..., None] * np.subtract(
        look.NIGHT_HIGH, look.NIGHT_LOW
    )
    share = on * np.maximum(1.0 - look.FALL * height, look.LEAST_FALL)
    return np.asarray(dark + share[..., None] * (day * setting.cool - dark))


def columns_of(mark: Mark | Faces) -> dict[str, NDArray[Any]]:
    """The arrays of a mark by their names."""
    return {name: each for name, each in mark._asdict().items() if isinstance(each, np.ndarray)}


def ground_of(ground: GroundPicture, cells: int) -> Single:
    """Corners (n, 2) of the triangles of the ground, and of the land to the horizon [m].

    Browsers give large triangles coarse depths, in which what lies on them sinks: so the picture
    has that many cells to a side. In films more of them only take time.
    """
    low = ground.corner
    high = ground.corner + ground.size
    return mesh(
        *np.concatenate(
            [[low - LAND_REACH], np.linspace(low, high, cells + 1), [high + LAND_REACH]]
        ).T
    )


def mesh(x: Float, y: Float) -> Single:
    """Corners (6 c r, 2) of the triangles of a mesh between places x (c + 1,) and y (r + 1,)."""
    places = np.stack(np.meshgrid(x, y), axis=-1).astype(np.float32)
    corners = places[:-1, :-1], places[:-1, 1:], places[1:, 1:], places[1:, :-1]
    return np.stack([corners[k] for k in (0, 1, 2, 0, 2, 3)], axis=2).reshape(-1, 2)
