"""The modules ``GL`` and ``pyrender`` for all that draws: importing this prepares both.

Where there is no OpenGL, they are stand-ins that hold what scenes are made of and draw nothing.
"""

from typing import Any

from lrf3d.errors import MissingLibraryError
from lrf3d.render.gl import import_libraries

GL: Any
pyrender: Any

try:
    GL, pyrender = import_libraries()
except MissingLibraryError:
    from lrf3d.render.traced.stand_ins import GL, pyrender

__all__ = ["GL", "pyrender"]
