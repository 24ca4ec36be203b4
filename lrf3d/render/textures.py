"""Pictures on the graphics side."""

import numpy as np
from numpy.typing import NDArray

from lrf3d.render.bindings import GL


class Texture:
    """A picture that shaders read.

    Args:
        picture: (h, w, 3 or 4) uint8.
        far: Whether it is also seen from far away and at a slant, and so needs smaller copies.
    """

    def __init__(self, picture: NDArray[np.uint8], *, far: bool = False) -> None:
        height, width, channels = picture.shape
        self._format = GL.GL_RGB if channels == 3 else GL.GL_RGBA
        self.id: int = GL.glGenTextures(1)
        self.size = (width, height)
        self._far = far
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        # Rows of three bytes a pixel do not fill whole words. Software OpenGL reads pixels of four
        # bytes several times as fast as those of three.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(picture)
        GL.glTexImage2D(
            GL.GL_TEXTURE_2D,
            0,
            GL.GL_RGBA8,
            width,
            height,
            0,
            self._format,
            GL.GL_UNSIGNED_BYTE,
            data,
        )
        smaller = GL.GL_LINEAR_MIPMAP_NEAREST if far else GL.GL_LINEAR
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, smaller)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, GL.GL_CLAMP_TO_EDGE)
        if far:
            GL.glGenerateMipmap(GL.GL_TEXTURE_2D)

    def update(self, picture: NDArray[np.uint8]) -> None:
        """Put another picture of the same size in its place."""
        width, height = self.size
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        data = np.ascontiguousarray(picture)
        GL.glTexSubImage2D(
            GL.GL_TEXTURE_2D, 0, 0, 0, width, height, self._format, GL.GL_UNSIGNED_BYTE, data
        )
        if self._far:
            GL.glGenerateMipmap(GL.GL_TEXTURE_2D)

    def bind(self) -> None:
        """Make it the picture that shaders read."""
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)

    def delete(self) -> None:
        """Free it."""
        GL.glDeleteTextures([self.id])
