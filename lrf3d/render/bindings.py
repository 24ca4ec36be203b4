"""The modules ``GL`` and ``pyrender`` for all that draws with OpenGL: importing this prepares both.

pyrender makes the context and is the base of buffers; only
:mod:`lrf3d.render.buffers` overrides or reads members of its own that are private.
"""

import ctypes
from typing import Any

from numpy.typing import NDArray

from lrf3d.render.gl import import_libraries

GL: Any
pyrender: Any
GL, pyrender = import_libraries()


def rewrite(kind: int, values: NDArray[Any]) -> None:
    """Write a contiguous array to the beginning of the buffer that is bound.

    PyOpenGL's own wrapper of this takes several times as long as the writing.
    """
    from OpenGL.raw.GL.VERSION.GL_1_5 import glBufferSubData

    glBufferSubData(kind, 0, values.nbytes, ctypes.c_void_p(values.ctypes.data))


__all__ = ["GL", "pyrender", "rewrite"]
