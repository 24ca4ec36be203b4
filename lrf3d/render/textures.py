"""Pictures that shaders read; they go to the graphics side when they are first drawn."""

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
        self.picture = picture
        self.size = (picture.shape[1], picture.shape[0])
        self._far = far
        self._id: int | None = None

    def _upload(self) -> int:
        height, width, channels = self.picture.shape
        self._format = GL.GL_RGB if channels == 3 else GL.GL_RGBA
        number: int = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, number)
        # Rows of three bytes a pixel do not fill whole words. Software OpenGL reads pixels of four
        # bytes several times as fast as those of three.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(self.picture)
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
        smaller = GL.GL_LINEAR_MIPMAP_NEAREST if self._far else GL.GL_LINEAR
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, smaller)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, GL.GL_CLAMP_TO_EDGE)
        if self._far:
            GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        return number

    def update(self, picture: NDArray[np.uint8]) -> None:
        """Put another picture of the same size in its place."""
        self.picture = picture
        if self._id is None:
            return
        width, height = self.size
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._id)
        data = np.ascontiguousarray(picture)
        GL.glTexSubImage2D(
            GL.GL_TEXTURE_2D, 0, 0, 0, width, height, self._format, GL.GL_UNSIGNED_BYTE, data
        )
        if self._far:
            GL.glGenerateMipmap(GL.GL_TEXTURE_2D)

    def bind(self) -> None:
        """Make it the picture that shaders read."""
        if self._id is None:
            self._id = self._upload()
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._id)

    def delete(self) -> None:
        """Free it."""
        if self._id is not None:
            GL.glDeleteTextures([self._id])
            self._id = None
