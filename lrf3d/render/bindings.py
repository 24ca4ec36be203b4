"""The modules ``GL`` and ``pyrender`` for all that draws: importing this prepares both."""

from lrf3d.render.gl import import_libraries

GL, pyrender = import_libraries()

__all__ = ["GL", "pyrender"]
