"""The errors that lrf3d raises on purpose; each message is one line: what, where, how to mend.

The tree::

    Lrf3dError
    ├── InputError (ValueError)      a value, a file or a flag that cannot be used
    │   └── WorldError               a world file or a world that cannot be used
    ├── CollisionError               a drive that would run into a wall
    ├── OutputError (OSError)        a file or a folder that cannot be written
    ├── DrawingError                 a picture or a film that failed; the data are written
    └── MissingLibraryError          a library that this task needs and this machine lacks
"""


class Lrf3dError(Exception):
    """The root of all errors that lrf3d raises on purpose."""


class InputError(Lrf3dError, ValueError):
    """A value, a file or a flag that cannot be used."""


class WorldError(InputError):
    """A world file, or the segments of a world, that cannot be used."""


class CollisionError(Lrf3dError):
    """A drive that would run into a wall."""


class OutputError(Lrf3dError, OSError):
    """A file or a folder that cannot be written."""


class DrawingError(Lrf3dError):
    """A picture or a film that could not be drawn after the data were written."""


class MissingLibraryError(Lrf3dError):
    """A library that this task needs and this machine lacks."""
