"""Sources of the shaders, for OpenGL and for the browser, with the constants of the look."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.scene import facades, look

_SHADERS = Path(__file__).parent / "shaders"

_CONSTANTS: dict[str, Any] = {
    "BODY_LIGHT": look.BODY_LIGHT,
    "DASH": look.DASH,
    "GHOST": (*look.GHOST, look.GHOST_STRENGTH),
    "POINT_HALO": look.POINT_HALO,
    "POINT_HALO_STRENGTH": look.POINT_HALO_STRENGTH,
    "RIM": look.SHADOW_RIM,
    "SHARPNESS": look.GROUND_SHARPNESS,
    "SIZE": (float(facades.BAYS * facades.TILE), float(facades.ROWS * facades.TILE)),
    "SLANTS": facades.SLANTS,
    "SUN": look.SUN,
    "TILE": float(facades.TILE),
    "WINDOWED": facades.WINDOWED,
}
"""Constants of the look that shaders know by these names."""


def air(*, indoor: bool) -> dict[str, Any]:
    """Constants of the air, outdoors and in rooms."""
    return {
        "HAZE": look.HAZE_INDOOR if indoor else look.HAZE,
        "ZENITH": look.ZENITH_INDOOR if indoor else look.ZENITH,
        "GLOW": (0.0, 0.0, 0.0) if indoor else look.GLOW,
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
