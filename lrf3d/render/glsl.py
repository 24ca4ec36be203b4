"""Sources of the shaders, for OpenGL and for the browser, with the constants of the look."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.scene import look

_SHADERS = Path(__file__).parent / "shaders"

_CONSTANTS: dict[str, Any] = {
    name: getattr(look, name)
    for name in (
        "CLIMB", "DAWN", "EMBER", "EMBER_SHARE", "EXPLORED", "FALL", "FRONT",
        "GHOST", "GHOST_STRENGTH", "GROUND_SHARPNESS", "HAZE", "LEAST_FALL", "MAP_LIGHT",
        "MAP_SHARE", "NIGHT_LOW", "PEEP", "POINT_HALO", "POINT_HALO_STRENGTH", "REFLECTED",
        "ROOF_SHARE", "VEIL_SHARE", "ZENITH",
    )
}  # fmt: skip
"""Constants of the look that shaders know by their names."""


def night(*, indoor: bool) -> dict[str, Any]:
    """Constants of what is dark and what is lit, outdoors and in rooms."""
    return {
        "COOL": look.COOL_INDOOR if indoor else look.COOL,
        "NIGHT_HIGH": look.NIGHT_HIGH_INDOOR if indoor else look.NIGHT_HIGH,
    }


def shader_source(name: str, *, vertex: bool, constants: Mapping[str, Any]) -> str:
    """The source of a shader without its version: ``common.glsl``, then ``name.glsl``.

    What stands after colons in the name is defined in it, and ``VERTEX`` in the vertex shader.
    """
    file, *defined = name.split(":")
    lines = [f"#define {each}\n" for each in (["VERTEX"] * vertex + defined)]
    for constant, value in {**_CONSTANTS, **constants}.items():
        values = np.ravel(value).tolist()
        kind = f"vec{len(values)}" if len(values) > 1 else type(values[0]).__name__
        lines.append(f"const {kind} {constant} = {kind}({', '.join(map(repr, values))});\n")
    common, own = ((_SHADERS / f"{each}.glsl").read_text() for each in ("common", file))
    return "".join([*lines, common, "#line 1\n", own])
