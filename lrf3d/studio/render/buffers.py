"""The context, buffers, textures and programs of OpenGL, and its module ``GL`` for what draws.

The context and the buffers are pyrender's. Its private members are used here and nowhere else: the
``_vaid`` and ``_buffers`` of its ``Primitive``, which ``_add_to_context`` fills, so that each
vertex attribute has a buffer that can be rewritten.
"""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import DrawingError
from lrf3d.geometry.lines import Single, quad_indices
from lrf3d.studio.render.gl import context, import_libraries, require_gl
from lrf3d.studio.render.glsl import shader_source
from lrf3d.studio.scene.look import Setting
from lrf3d.studio.scene.shapes import Lens

GL: Any
_primitive: Any
GL, _primitive = import_libraries()

Uniform = float | int | np.ndarray[Any, Any] | tuple[float, ...]


def make_current() -> None:
    """Let this thread draw.

    Raises:
        DrawingError: Another thread draws.
    """
    require_gl()
    try:
        context().make_current()
    except AssertionError as error:
        raise DrawingError(
            "OpenGL draws in another thread; draw all pictures in one, or with the renderer embree"
        ) from error


def rewrite(kind: int, values: NDArray[Any]) -> None:
    """Write a contiguous array to the beginning of the buffer that is bound.

    PyOpenGL's own wrapper of this takes several times as long as the writing.
    """
    from OpenGL.raw.GL.VERSION.GL_1_5 import glBufferSubData

    glBufferSubData(kind, 0, values.nbytes, ctypes.c_void_p(values.ctypes.data))


class Texture:
    """What shaders read on a unit of its own: a picture (h, w, 3), or numbers (h, w, 4).

    Of a picture there are smaller copies.
    """

    def __init__(self, unit: int, texels: NDArray[Any]) -> None:
        self.unit = unit
        self.size = texels.shape[1::-1]
        kind = GL.GL_TEXTURE_2D
        self.id = GL.glGenTextures(1)
        self.bind()
        GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
        # Rows of three bytes a pixel do not fill whole words.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        picture = texels.dtype == np.uint8
        kept, given = (GL.GL_RGBA8, GL.GL_RGB) if picture else (GL.GL_RGBA16F, GL.GL_RGBA)
        form = given, GL.GL_UNSIGNED_BYTE if picture else GL.GL_FLOAT
        GL.glTexImage2D(kind, 0, kept, *self.size, 0, *form, np.ascontiguousarray(texels))
        GL.glTexParameteri(
            kind, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_NEAREST if picture else GL.GL_LINEAR
        )
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(kind, axis, GL.GL_CLAMP_TO_EDGE)
        if picture:
            GL.glGenerateMipmap(kind)
        GL.glActiveTexture(GL.GL_TEXTURE0)

    def bind(self) -> None:
        """Make it what shaders read on its unit."""
        GL.glActiveTexture(GL.GL_TEXTURE0 + self.unit)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        GL.glActiveTexture(GL.GL_TEXTURE0)

    def delete(self) -> None:
        """Free it."""
        GL.glDeleteTextures([self.id])


class Buffer(_primitive.Primitive):  # type: ignore[misc]
    """Vertices, whose attributes are rewritten where their arrays have changed.

    The mode, an OpenGL constant, is what they make up; a count of them, or of indices, is drawn.
    """

    def __init__(self, mode: int) -> None:
        super().__init__(positions=np.zeros((1, 3)), mode=int(mode))
        self.count = 0
        self._shown: dict[int, NDArray[Any]] = {}
        self._rooms: dict[int, int] = {}
        self._indexed = False
        self._add_to_context()

    def fill(self, columns: Sequence[NDArray[Any]], *, corners: int = 1) -> None:
        """Draw these from now on: an array (…, k) for each attribute, by the shader's locations.

        A row holds the attributes of one vertex, or of the four vertices of a quad.
        """
        rows = 0
        for place, values in enumerate(columns):
            rows = values.size // values.shape[-1]
            # An array that is the same object as before has not changed.
            if values is not self._shown.get(place):
                self._shown[place] = values
                self._write(place, np.repeat(values.reshape(-1, values.shape[-1]), corners, axis=0))
        if corners == 1:
            self.count = rows
        elif self.count != 6 * rows:
            self.choose(quad_indices(rows))

    def choose(self, indices: NDArray[np.uint32]) -> None:
        """Draw only the triangles of these vertices from now on."""
        self.count = len(indices)
        self._indexed = True
        GL.glBindVertexArray(self._vaid)
        self._store(GL.GL_ELEMENT_ARRAY_BUFFER, -1, indices)

    def draw(self) -> None:
        """Draw its vertices with the program in use."""
        GL.glBindVertexArray(self._vaid)
        if self._indexed:
            GL.glDrawElements(self.mode, self.count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(0))
        else:
            GL.glDrawArrays(self.mode, 0, self.count)

    def _write(self, place: int, values: NDArray[Any]) -> None:
        new = place not in self._rooms
        self._store(GL.GL_ARRAY_BUFFER, place, values.astype(np.float32, copy=False))
        if new:
            GL.glBindVertexArray(self._vaid)
            GL.glVertexAttribPointer(
                place, values.shape[1], GL.GL_FLOAT, GL.GL_FALSE, 0, ctypes.c_void_p(0)
            )
            GL.glEnableVertexAttribArray(place)

    def _store(self, kind: int, place: int, values: NDArray[Any]) -> None:
        """Put values into the buffer of a place, which grows by twice as much as is needed."""
        room = self._rooms.get(place, -1)
        if room < 0:
            self._named[place] = GL.glGenBuffers(1)
            self._buffers.append(self._named[place])
        GL.glBindBuffer(kind, self._named[place])
        if values.nbytes > room:
            self._rooms[place] = values.nbytes if room < 0 else 2 * values.nbytes
            GL.glBufferData(kind, self._rooms[place], None, GL.GL_DYNAMIC_DRAW)
        if values.nbytes:
            rewrite(kind, np.ascontiguousarray(values))

    def _add_to_context(self) -> None:
        self._vaid = GL.glGenVertexArrays(1)
        self._buffers: list[int] = []
        self._named: dict[int, int] = {}


class ShaderProgram:
    """A linked pair of a vertex and a fragment shader, by their name: see :func:`shader_source`."""

    def __init__(self, name: str, setting: Setting) -> None:
        self.name = name
        self._id = GL.glCreateProgram()
        shaders = [
            _compile(name, kind, setting) for kind in (GL.GL_VERTEX_SHADER, GL.GL_FRAGMENT_SHADER)
        ]
        for shader in shaders:
            GL.glAttachShader(self._id, shader)
        GL.glLinkProgram(self._id)
        if not GL.glGetProgramiv(self._id, GL.GL_LINK_STATUS):
            raise RuntimeError(f"shader {name} does not link: {GL.glGetProgramInfoLog(self._id)!r}")
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
            value = uniforms[name]
            known = self._values.get(name)
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
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, self._values.nbytes, self._values, GL.GL_DYNAMIC_DRAW)

    def fill(self, lens: Lens, width: int, height: int) -> None:
        """Make it the camera of all that is drawn from now on, in pixels."""
        values = self._values
        values[:16] = lens.matrix.T.ravel()
        values[16:19] = lens.eye
        values[19] = lens.thick
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
