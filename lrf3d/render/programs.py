"""Programs: pairs of shaders, compiled with the constants of a film, and the camera that all share.

Names of the files in ``shaders/`` and values enter; programs leave that draw with them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Single
from lrf3d.render.buffers import GL, rewrite
from lrf3d.render.glsl import shader_source
from lrf3d.scene.look import Setting
from lrf3d.scene.shapes import Lens

Uniform = float | int | np.ndarray[Any, Any] | tuple[float, ...]


class ShaderProgram:
    """A linked pair of a vertex and a fragment shader, by their name: see :func:`shader_source`."""

    def __init__(self, name: str, setting: Setting) -> None:
        self.name = name
        self._id = GL.glCreateProgram()
        kinds = (GL.GL_VERTEX_SHADER, GL.GL_FRAGMENT_SHADER)
        shaders = [_compile(name, kind, setting) for kind in kinds]
        for shader in shaders:
            GL.glAttachShader(self._id, shader)
        GL.glLinkProgram(self._id)
        if not GL.glGetProgramiv(self._id, GL.GL_LINK_STATUS):
            log = GL.glGetProgramInfoLog(self._id)
            raise RuntimeError(f"shader {name} does not link: {log!r}")
        for shader in shaders:
            GL.glDeleteShader(shader)
        count = GL.glGetProgramiv(self._id, GL.GL_ACTIVE_UNIFORMS)
        names = [GL.glGetActiveUniform(self._id, number)[0].decode() for number in range(count)]
        places = {each: GL.glGetUniformLocation(self._id, each) for each in names}
        # The picture is on the unit that is read where nothing is said.
        self._places = {each: at for each, at in places.items() if at >= 0 and each != "picture"}
        block = GL.glGetUniformBlockIndex(self._id, b"Camera")
        if block != GL.GL_INVALID_INDEX:
            GL.glUniformBlockBinding(self._id, block, CameraBlock.PLACE)
        self._values: dict[str, Uniform] = {}

    def use(self, uniforms: Mapping[str, Uniform]) -> None:
        """Make this the program to draw with, and set those of its uniforms that have changed.

        What the shader does not ask for is passed over.
        """
        GL.glUseProgram(self._id)
        for name, place in self._places.items():
            value, known = uniforms[name], self._values.get(name)
            if value is known or (not isinstance(value, np.ndarray) and value == known):
                continue
            self._values[name] = value
            if isinstance(value, int):
                GL.glUniform1i(place, value)
            elif isinstance(value, np.ndarray) and value.ndim == 2:
                GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, np.ascontiguousarray(value, np.float32))
            else:
                numbers = np.ravel(value).tolist()
                getattr(GL, f"glUniform{len(numbers)}f")(place, *numbers)

    def delete(self) -> None:
        """Free what the driver holds of it."""
        GL.glDeleteProgram(self._id)


class CameraBlock:
    """What all programs know of the camera, in one buffer: see ``common.glsl``."""

    PLACE = 0

    def __init__(self) -> None:
        self._values: Single = np.zeros(24, np.float32)
        self._buffer = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._buffer)
        size = self._values.nbytes
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, size, self._values, GL.GL_DYNAMIC_DRAW)

    def fill(self, lens: Lens, width: int, height: int) -> None:
        """Make it the camera of all that is drawn from now on, in pixels."""
        values = self._values
        values[:16] = lens.matrix.T.ravel()
        values[16:19], values[19] = lens.eye, lens.thick
        values[20:] = width, height, lens.slack, lens.nearer
        GL.glBindBufferBase(GL.GL_UNIFORM_BUFFER, self.PLACE, self._buffer)
        rewrite(GL.GL_UNIFORM_BUFFER, values)

    def delete(self) -> None:
        """Free it."""
        GL.glDeleteBuffers(1, [self._buffer])


def _compile(name: str, kind: int, setting: Setting) -> int:
    source = shader_source(name, setting, vertex=kind == GL.GL_VERTEX_SHADER)
    shader: int = GL.glCreateShader(kind)
    GL.glShaderSource(shader, f"#version 330 core\n{source}")
    GL.glCompileShader(shader)
    if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
        raise RuntimeError(f"shader {name} does not compile: {GL.glGetShaderInfoLog(shader)!r}")
    return shader
