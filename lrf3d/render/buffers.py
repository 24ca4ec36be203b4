"""The context, buffers and textures of OpenGL, and the module ``GL`` for all that draws with it.

The context and the buffers are pyrender's. Its private members are used here and nowhere else: the
``_platform`` of its ``OffscreenRenderer``, to make the one context of a process current, and the
``_vaid`` and ``_buffers`` of its ``Primitive``, which ``_add_to_context`` fills, so that each
vertex attribute has a buffer that can be rewritten.
"""

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import quad_indices
from lrf3d.render.gl import INSTALL_LINE, import_libraries

GL: Any
pyrender: Any
GL, pyrender = import_libraries()


@cache
def _context() -> Any:
    """The one OpenGL context of this process, current in the thread that asks first.

    It is pyrender's and is never deleted: that would end every other context of the process.

    Raises:
        MissingLibraryError: The libraries are there, but no driver that they could start.
    """
    try:
        return pyrender.OffscreenRenderer(16, 16)
    except Exception as error:
        # pyrender asserts what EGL answers, so that any failure may come as anything.
        raise MissingLibraryError(
            f"OpenGL cannot start ({error!r}); install its software driver: {INSTALL_LINE}"
        ) from error


def make_current() -> None:
    """Let this thread draw."""
    _context()._platform.make_current()


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
        self.unit, self.size, kind = unit, texels.shape[1::-1], GL.GL_TEXTURE_2D
        self.id = GL.glGenTextures(1)
        self.bind()
        GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
        # Rows of three bytes a pixel do not fill whole words.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        picture = texels.dtype == np.uint8
        kept, given = (GL.GL_RGBA8, GL.GL_RGB) if picture else (GL.GL_RGBA16F, GL.GL_RGBA)
        form = given, GL.GL_UNSIGNED_BYTE if picture else GL.GL_FLOAT
        GL.glTexImage2D(kind, 0, kept, *self.size, 0, *form, np.ascontiguousarray(texels))
        smaller = GL.GL_LINEAR_MIPMAP_NEAREST if picture else GL.GL_LINEAR
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MIN_FILTER, smaller)
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


class Buffer(pyrender.Primitive):  # type: ignore[misc]
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
        self.count, self._indexed = len(indices), True
        GL.glBindVertexArray(self._vaid)
        self._store(GL.GL_ELEMENT_ARRAY_BUFFER, -1, indices)

    def draw(self) -> None:
        """Draw its vertices with the program in use."""
        GL.glBindVertexArray(self._vaid)
        if self._indexed:
            start = ctypes.c_void_p(0)
            GL.glDrawElements(self.mode, self.count, GL.GL_UNSIGNED_INT, start)
        else:
            GL.glDrawArrays(self.mode, 0, self.count)

    def _write(self, place: int, values: NDArray[Any]) -> None:
        new = place not in self._rooms
        self._store(GL.GL_ARRAY_BUFFER, place, values.astype(np.float32, copy=False))
        if new:
            GL.glBindVertexArray(self._vaid)
            size, start = values.shape[1], ctypes.c_void_p(0)
            GL.glVertexAttribPointer(place, size, GL.GL_FLOAT, GL.GL_FALSE, 0, start)
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
