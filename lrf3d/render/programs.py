"""Shader programs from the files in ``shaders/``, with the places of their uniforms kept."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.render.bindings import GL
from lrf3d.scene import facades, look

_SHADERS = Path(__file__).parent / "shaders"

_CONSTANTS: dict[str, Any] = {
    "FAN_COLOUR": look.FAN_COLOUR,
    "GLOW": look.GLOW,
    "RIM": look.SHADOW_RIM,
    "SHADOW_COLOUR": look.SHADOW_COLOUR,
    "SHARPNESS": look.GROUND_SHARPNESS,
    "SIZE": (float(facades.BAYS * facades.TILE), float(facades.ROWS * facades.TILE)),
    "SKYLIGHT": look.SKYLIGHT,
    "SLANTS": facades.SLANTS,
    "TILE": float(facades.TILE),
    "TRAIL_COLOUR": look.TRAIL_COLOUR,
    "WINDOWED": facades.WINDOWED,
    "ZENITH": look.ZENITH,
    "ZENITH_INDOOR": look.ZENITH_INDOOR,
}
"""Constants of the look that shaders know by these names."""

Uniform = float | int | np.ndarray[Any, Any] | tuple[float, ...]


class Program:
    """A linked pair of a vertex and a fragment shader.

    Args:
        name: The files ``name.vert`` and ``name.frag``; ``common.glsl`` goes before both.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._id = GL.glCreateProgram()
        shaders = [
            _compile(f"{name}.vert", GL.GL_VERTEX_SHADER),
            _compile(f"{name}.frag", GL.GL_FRAGMENT_SHADER),
        ]
        for shader in shaders:
            GL.glAttachShader(self._id, shader)
        GL.glLinkProgram(self._id)
        if not GL.glGetProgramiv(self._id, GL.GL_LINK_STATUS):
            log = GL.glGetProgramInfoLog(self._id)
            raise RuntimeError(f"shader {name} does not link: {log!r}")
        for shader in shaders:
            GL.glDeleteShader(shader)
        self._places = _uniforms(self._id)
        self._values: dict[str, Uniform] = {}

    def use(self, uniforms: Mapping[str, Uniform]) -> None:
        """Make this the program to draw with, and set those of its uniforms that have changed.

        What the shader does not ask for is passed over, so that all programs of a picture can be
        given the same camera and light.
        """
        GL.glUseProgram(self._id)
        for name, place in self._places.items():
            value, known = uniforms[name], self._values.get(name)
            if value is known or (not isinstance(value, np.ndarray) and value == known):
                continue
            self._values[name] = value
            _set(place, value)

    def delete(self) -> None:
        """Free what the driver holds of it."""
        GL.glDeleteProgram(self._id)


def _uniforms(program: int) -> dict[str, int]:
    """The names of a program's uniforms but its picture, and their places."""
    count = GL.glGetProgramiv(program, GL.GL_ACTIVE_UNIFORMS)
    names = [GL.glGetActiveUniform(program, number)[0] for number in range(count)]
    places = {name.decode(): GL.glGetUniformLocation(program, name.decode()) for name in names}
    places.pop("picture", None)
    return places


def _set(place: int, value: Uniform) -> None:
    if isinstance(value, int):
        GL.glUniform1i(place, value)
    elif isinstance(value, float):
        GL.glUniform1f(place, value)
    elif isinstance(value, np.ndarray) and value.ndim == 2:
        GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, np.ascontiguousarray(value, np.float32))
    elif len(value) == 2:
        GL.glUniform2f(place, value[0], value[1])
    elif len(value) == 3:
        GL.glUniform3f(place, value[0], value[1], value[2])
    else:
        GL.glUniform4f(place, value[0], value[1], value[2], value[3])


def _constants() -> str:
    """The constants of the look, as lines of a shader."""
    lines = []
    for name, value in _CONSTANTS.items():
        values = np.ravel(value).tolist()
        kind = f"vec{len(values)}" if len(values) > 1 else type(values[0]).__name__
        lines.append(f"const {kind} {name} = {kind}({', '.join(map(repr, values))});\n")
    return "".join(lines)


def _compile(file: str, kind: int) -> int:
    common = _constants() + (_SHADERS / "common.glsl").read_text()
    source = (_SHADERS / file).read_text()
    shader: int = GL.glCreateShader(kind)
    GL.glShaderSource(shader, f"#version 330 core\n{common}\n#line 1\n{source}")
    GL.glCompileShader(shader)
    if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
        raise RuntimeError(f"shader {file} does not compile: {GL.glGetShaderInfoLog(shader)!r}")
    return shader
