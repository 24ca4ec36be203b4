"""The context, buffers and textures of OpenGL.

The context and the buffers are pyrender's. Its private members are used here and nowhere else: the
``_platform`` of its ``OffscreenRenderer``, to make the one context of a process current, and the
``_vaid`` and ``_buffers`` of its ``Primitive``, which ``_add_to_context`` fills, so that vertices
are one interleaved buffer that can be rewritten.
"""

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Single
from lrf3d.render.bindings import GL, pyrender, rewrite
from lrf3d.render.gl import INSTALL_LINE

_FLOAT = 4
"""Bytes of a float32, and of an index."""


@cache
def _context() -> Any:
    """The one OpenGL context of this process, current in the thread that asks first.

    It is pyrender's, and stays: deleting one of them would end every other in the process.

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


class Texture:
    """A picture that shaders read, or layers of pictures that repeat.

    Args:
        levels: One picture (h, w, 3) uint8, of which smaller copies are made; or the levels of a
            texture of layers, (n, h, w, 4) uint8 each, finest first.
    """

    def __init__(self, levels: tuple[NDArray[np.uint8], ...]) -> None:
        layered = levels[0].ndim == 4
        self._kind = kind = GL.GL_TEXTURE_2D_ARRAY if layered else GL.GL_TEXTURE_2D
        self._id = GL.glGenTextures(1)
        GL.glBindTexture(kind, self._id)
        # Rows of three bytes a pixel do not fill whole words.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        fill = GL.glTexImage3D if layered else GL.glTexImage2D
        form = GL.GL_RGBA if layered else GL.GL_RGB
        for level, picture in enumerate(levels):
            size = (picture.shape[-2], picture.shape[-3], *picture.shape[:-3])
            data = np.ascontiguousarray(picture)
            fill(kind, level, GL.GL_RGBA8, *size, 0, form, GL.GL_UNSIGNED_BYTE, data)
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_NEAREST)
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        wrap = GL.GL_REPEAT if layered else GL.GL_CLAMP_TO_EDGE
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(kind, axis, wrap)
        if layered:
            GL.glTexParameteri(kind, GL.GL_TEXTURE_MAX_LEVEL, len(levels) - 1)
        else:
            GL.glGenerateMipmap(kind)

    def bind(self) -> None:
        """Make it the picture that shaders read."""
        GL.glBindTexture(self._kind, self._id)

    def delete(self) -> None:
        """Free it."""
        GL.glDeleteTextures([self._id])


class Buffer(pyrender.Primitive):  # type: ignore[misc]
    """Vertices in one interleaved buffer that can be rewritten.

    Args:
        sizes: Number of floats of each vertex attribute, in the order of the shader's locations.
        mode: What vertices make up, an OpenGL constant.

    Attributes:
        count: How many vertices, or indices, there are to draw.
        shown: What was packed into it last.
    """

    def __init__(self, sizes: tuple[int, ...], mode: int) -> None:
        super().__init__(positions=np.zeros((1, 3)), mode=int(mode))
        self.sizes, self.count = sizes, 0
        self.shown: object = None
        self._room = self._indexed = 0
        self._add_to_context()

    def fill(self, rows: Single) -> None:
        """Draw these vertices (n, sum of sizes) from now on."""
        self.count = len(rows)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        if len(rows) > self._room:
            self._room = len(rows) if not self._room else 2 * len(rows)
            size = self._room * sum(self.sizes) * _FLOAT
            GL.glBufferData(GL.GL_ARRAY_BUFFER, size, None, GL.GL_DYNAMIC_DRAW)
        if len(rows):
            rewrite(GL.GL_ARRAY_BUFFER, np.ascontiguousarray(rows, np.float32))

    def choose(self, indices: NDArray[np.uint32]) -> None:
        """Draw its triangles of these vertices from now on."""
        self.count = len(indices)
        GL.glBindVertexArray(self._vaid)
        if len(self._buffers) == 1:
            self._buffers.append(GL.glGenBuffers(1))
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])
        if len(indices) > self._indexed:
            self._indexed = len(indices)
            size = self._indexed * _FLOAT
            GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, size, None, GL.GL_DYNAMIC_DRAW)
        if len(indices):
            rewrite(GL.GL_ELEMENT_ARRAY_BUFFER, np.ascontiguousarray(indices))

    def draw(self, first: int, count: int) -> None:
        """Draw so many of its vertices, or of its indices, with the program in use."""
        GL.glBindVertexArray(self._vaid)
        if len(self._buffers) == 1:
            GL.glDrawArrays(self.mode, first, count)
        else:
            start = ctypes.c_void_p(_FLOAT * first)
            GL.glDrawElements(self.mode, count, GL.GL_UNSIGNED_INT, start)

    def _add_to_context(self) -> None:
        self._vaid = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._vaid)
        self._buffers = [GL.glGenBuffers(1)]
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        offset, stride = 0, sum(self.sizes) * _FLOAT
        for place, size in enumerate(self.sizes):
            pointer: Any = ctypes.c_void_p(offset)
            GL.glVertexAttribPointer(place, size, GL.GL_FLOAT, GL.GL_FALSE, stride, pointer)
            GL.glEnableVertexAttribArray(place)
            offset += size * _FLOAT
        GL.glBindVertexArray(0)
