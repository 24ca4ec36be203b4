"""Pictures that shaders read; they go to the graphics side when they are first drawn."""

import numpy as np
from numpy.typing import NDArray

from lrf3d.render.bindings import GL


class Texture:
    """A picture that shaders read, or layers of pictures that repeat.

    Args:
        picture: (h, w, 3 or 4) uint8; or the levels of a texture of layers, (n, h, w, 4) uint8
            each, finest first.
        far: Whether it is also seen from far away and at a slant, and so needs smaller copies.
    """

    def __init__(
        self, picture: NDArray[np.uint8] | tuple[NDArray[np.uint8], ...], *, far: bool = False
    ) -> None:
        self.levels = picture if isinstance(picture, tuple) else (picture,)
        self.size = (self.picture.shape[-2], self.picture.shape[-3])
        self._far = far
        self._id: int | None = None

    @property
    def picture(self) -> NDArray[np.uint8]:
        """The picture, as fine as it is."""
        return self.levels[0]

    def _upload(self) -> int:
        number: int = GL.glGenTextures(1)
        layered = self.picture.ndim == 4
        self._kind = kind = GL.GL_TEXTURE_2D_ARRAY if layered else GL.GL_TEXTURE_2D
        GL.glBindTexture(kind, number)
        # Rows of three bytes a pixel do not fill whole words. Software OpenGL reads pixels of four
        # bytes several times as fast as those of three.
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        self._format = GL.GL_RGB if self.picture.shape[-1] == 3 else GL.GL_RGBA
        for level, picture in enumerate(self.levels):
            data = np.ascontiguousarray(picture)
            size = (picture.shape[-2], picture.shape[-3], *picture.shape[:-3])
            fill = GL.glTexImage3D if layered else GL.glTexImage2D
            fill(kind, level, GL.GL_RGBA8, *size, 0, self._format, GL.GL_UNSIGNED_BYTE, data)
        smaller = GL.GL_LINEAR_MIPMAP_NEAREST if self._far or layered else GL.GL_LINEAR
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MIN_FILTER, smaller)
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
        wrap = GL.GL_REPEAT if layered else GL.GL_CLAMP_TO_EDGE
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(kind, axis, wrap)
        if layered:
            GL.glTexParameteri(kind, GL.GL_TEXTURE_MAX_LEVEL, len(self.levels) - 1)
        elif self._far:
            GL.glGenerateMipmap(kind)
        return number

    def update(self, picture: NDArray[np.uint8]) -> None:
        """Put another picture of the same size in its place."""
        self.levels = (picture,)
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
        GL.glBindTexture(self._kind, self._id)

    def delete(self) -> None:
        """Free it."""
        if self._id is not None:
            GL.glDeleteTextures([self._id])
            self._id = None
