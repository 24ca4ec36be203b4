"""Primitives: pyrender's, with the program and texture that draw them and buffers to rewrite."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, Single
from lrf3d.render.bindings import GL, pyrender, rewrite
from lrf3d.render.pictures import Picture


class Texture:
    """A picture that shaders read, or layers of pictures that repeat.

    Args:
        picture: (h, w, 3 or 4) uint8; or the levels of a texture of layers, (n, h, w, 4) uint8
            each, finest first.
        far: Whether it is also seen from far away and at a slant, and so needs smaller copies; a
            picture that is not is seen pixel by pixel.
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
        # A stamp's texels are the picture's pixels: there is nothing to mix.
        stamp = not (self._far or layered)
        smaller = GL.GL_NEAREST if stamp else GL.GL_LINEAR_MIPMAP_NEAREST
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MIN_FILTER, smaller)
        larger = GL.GL_NEAREST if stamp else GL.GL_LINEAR
        GL.glTexParameteri(kind, GL.GL_TEXTURE_MAG_FILTER, larger)
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


_FLOAT = 4
"""Bytes of a float32, and of an index."""

Span = tuple[str, int, int]
"""A program, and the first and the number of the vertices or indices that it draws."""


class Primitive(pyrender.Primitive):  # type: ignore[misc]
    """Vertices in one interleaved buffer, drawn by one shader program.

    Args:
        program: Name of the program.
        sizes: Number of floats of each vertex attribute, in the order of the shader's locations;
            the first is the position.
        vertices: (n, sum of sizes) the vertices; of a dynamic primitive, the first ones.
        indices: (m,) which vertices make the triangles, or nothing for all in order.
        pattern: (k,) which vertices of a group make its triangles, for a dynamic primitive of
            groups of vertices of one kind; nothing for all in order.
        mode: What to draw, an OpenGL constant; triangles if not given.
        capacity: Number of vertices of a dynamic primitive; 0 for one that never changes.
        blend: Whether it is translucent.
        cull: Whether faces seen from behind are left out.
    """

    def __init__(
        self,
        program: str,
        sizes: Sequence[int],
        vertices: Single,
        *,
        indices: NDArray[np.uint32] | None = None,
        pattern: Int | None = None,
        mode: int = GL.GL_TRIANGLES,
        capacity: int = 0,
        blend: bool = False,
        cull: bool = False,
    ) -> None:
        vertices = np.ascontiguousarray(vertices, np.float32).reshape(-1, sum(sizes))
        # pyrender wants positions to reckon bounds; an empty primitive has none but the origin.
        positions = vertices[:, : sizes[0]] if len(vertices) else np.zeros((1, sizes[0]))
        padded = np.zeros((len(positions), 3), np.float32)
        padded[:, : min(3, sizes[0])] = positions[:, :3]
        super().__init__(positions=padded, mode=int(mode))
        self.program = program
        self.sizes = tuple(sizes)
        self.vertices = vertices
        self.elements = indices
        self.capacity = capacity
        self.blend = blend
        self.cull = cull
        self.texture: Texture | None = None
        self._pattern = pattern
        if pattern is not None:
            self.elements = self._grouped(len(vertices))
        self.count = len(vertices) if self.elements is None else len(self.elements)
        self._room = self.count

    def update(self, vertices: Single) -> None:
        """Rewrite a dynamic primitive in place; what it draws is just these vertices."""
        vertices = np.ascontiguousarray(vertices, np.float32).reshape(-1, sum(self.sizes))
        self.vertices = vertices
        self.count = len(vertices)
        if self._pattern is not None:
            self.elements = self._grouped(len(vertices))
            self.count = len(self.elements)
        if not self._in_context() or not len(vertices):
            return
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        if len(vertices) > self.capacity:
            self.capacity = 2 * len(vertices)
            size = self.capacity * sum(self.sizes) * _FLOAT
            GL.glBufferData(GL.GL_ARRAY_BUFFER, size, None, GL.GL_DYNAMIC_DRAW)
            self._fill_groups()
        rewrite(GL.GL_ARRAY_BUFFER, vertices)

    def _grouped(self, vertices: int) -> NDArray[np.uint32]:
        """The vertices that make the triangles of their groups."""
        assert self._pattern is not None
        size = int(self._pattern.max()) + 1
        starts = size * np.arange(vertices // size)
        return np.asarray((starts[:, None] + self._pattern).ravel(), np.uint32)

    def _fill_groups(self) -> None:
        """Fill the buffer of indices for as many groups as there is room for, once for all."""
        if self._pattern is not None:
            every = self._grouped(self.capacity)
            GL.glBindVertexArray(self._vaid)
            GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, every.nbytes, every, GL.GL_STATIC_DRAW)

    def choose(self, indices: NDArray[np.uint32]) -> None:
        """Draw only these of its triangles, which are at most as many as there are."""
        self.elements = indices
        self.count = len(indices)
        if self._in_context() and len(indices):
            GL.glBindVertexArray(self._vaid)
            rewrite(GL.GL_ELEMENT_ARRAY_BUFFER, indices)

    @property
    def spans(self) -> tuple[Span, ...]:
        """What is drawn of it by which program."""
        return ((self.program, 0, self.count),)

    def draw(self, first: int, count: int) -> None:
        """Draw so many of its vertices, or of their indices, with the program in use."""
        GL.glBindVertexArray(self._vaid)
        if self.elements is None:
            GL.glDrawArrays(self.mode, first, count)
        else:
            start = ctypes.c_void_p(_FLOAT * first)
            GL.glDrawElements(self.mode, count, GL.GL_UNSIGNED_INT, start)

    def _add_to_context(self) -> None:
        self._vaid = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._vaid)
        buffer = GL.glGenBuffers(1)
        self._buffers = [buffer]
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, buffer)
        stride = sum(self.sizes) * _FLOAT
        if self.capacity:
            self.capacity = max(self.capacity, len(self.vertices))
            GL.glBufferData(GL.GL_ARRAY_BUFFER, self.capacity * stride, None, GL.GL_DYNAMIC_DRAW)
            if len(self.vertices):
                rewrite(GL.GL_ARRAY_BUFFER, self.vertices)
        else:
            GL.glBufferData(
                GL.GL_ARRAY_BUFFER, self.vertices.nbytes, self.vertices, GL.GL_STATIC_DRAW
            )
        offset = 0
        for place, size in enumerate(self.sizes):
            pointer = ctypes.c_void_p(offset)
            GL.glVertexAttribPointer(place, size, GL.GL_FLOAT, GL.GL_FALSE, stride, pointer)
            GL.glEnableVertexAttribArray(place)
            offset += size * _FLOAT
        if self.elements is not None:
            elements = np.ascontiguousarray(self.elements, np.uint32)
            buffer = GL.glGenBuffers(1)
            self._buffers.append(buffer)
            GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, buffer)
            if self._pattern is None:
                size = self._room * _FLOAT
                GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, size, None, GL.GL_STATIC_DRAW)
                rewrite(GL.GL_ELEMENT_ARRAY_BUFFER, elements)
            self._fill_groups()
        GL.glBindVertexArray(0)


class Mesh(pyrender.Mesh):  # type: ignore[misc]
    """pyrender's mesh, with bounds that do not need ``np.infty``, which NumPy 2 took away."""

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Corners (2, 3) of the box around all primitives [m]."""
        boxes = np.array([primitive.bounds for primitive in self.primitives])
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


class Draw(NamedTuple):
    """A primitive to draw, with the uniforms of its program that no other shares."""

    primitive: Primitive
    uniforms: Mapping[str, Any]


class FrameRenderer(Protocol):
    """Draws scenes of primitives into pictures, in the order of its methods."""

    def know(self, constants: Mapping[str, Any]) -> None:
        """Be told what is the same in all pictures, before the first."""
        ...

    def begin(self, scene: Any) -> None:
        """Start a picture."""
        ...

    def camera_matrices(self, scene: Any) -> tuple[Float, Float]:
        """Matrix (4, 4) from the scene to the picture turned over, and the eye (3,)."""
        ...

    def look_through(self, camera: Mapping[str, Any]) -> None:
        """Draw what comes as a camera sees it: see :class:`lrf3d.render.scenery.Frame`."""
        ...

    def draw(self, primitive: Primitive, uniforms: Mapping[str, Any]) -> None:
        """Draw a primitive with uniforms for its program."""
        ...

    def flatten(self) -> None:
        """Go on with one sample a pixel: what comes has soft edges of its own."""
        ...

    def overlay(self, box: tuple[int, int, int, int] | None) -> None:
        """Go on without depth, in a box left, top, width, height [pixels] or in the whole."""
        ...

    def finish(self) -> Picture:
        """The picture (h, w, 4) uint8; it is written over by the next one."""
        ...

    def delete(self) -> None:
        """Free what is held."""
        ...
