"""What films can be drawn with, and which of them is taken."""

from lrf3d.errors import InputError
from lrf3d.render.gl import gl_available, require_gl

RENDERERS = ("embree", "gl")
"""Names of the renderers: Embree's, which needs nothing but wheels, and OpenGL's, the fast one."""


def choose_renderer(wanted: str | None, *, here: bool = True) -> str:
    """The renderer of a name; where none is named, OpenGL's where it is there, else Embree's.

    Args:
        wanted: The name.
        here: Whether this machine draws; where others do, they say whether they can.

    Raises:
        InputError: There is no renderer of that name.
        MissingLibraryError: OpenGL is wanted and is not there.
    """
    if wanted is None:
        return "gl" if gl_available() else "embree"
    if wanted not in RENDERERS:
        raise InputError(f"renderer {wanted!r}: expected one of {', '.join(RENDERERS)}")
    if wanted == "gl" and here:
        require_gl()
    return wanted
