"""OpenGL and pyrender, imported so that they work without a screen and with NumPy 2.

The modules that draw take both libraries from :mod:`lrf3d.render.buffers`.
"""

import ctypes
import ctypes.util
import os
import sys
import warnings
from typing import Any

from lrf3d.errors import MissingLibraryError

INSTALL_LINE = "apt-get install -y --no-install-recommends libegl1 libgl1"
"""What brings OpenGL to a bare Debian or Ubuntu; no wheel does."""

_LIBRARIES = ("libEGL.so.1", "libGL.so.1")


def gl_available() -> bool:
    """Whether the OpenGL libraries are there; cheap, for it makes no context."""
    if not sys.platform.startswith("linux"):
        return ctypes.util.find_library("GL") is not None or sys.platform == "win32"
    return not any(_cannot_load(library) for library in _LIBRARIES)


def require_gl() -> None:
    """See that OpenGL is there.

    Raises:
        MissingLibraryError: It is not.
    """
    if not gl_available():
        raise MissingLibraryError(f"no OpenGL library on this machine; install it: {INSTALL_LINE}")


def import_libraries() -> tuple[Any, Any]:
    """Import OpenGL.GL and pyrender, with what each of them needs set before.

    Returns:
        The modules ``OpenGL.GL`` and ``pyrender``.

    Raises:
        MissingLibraryError: There is no OpenGL on this machine.
    """
    require_gl()
    if sys.platform.startswith("linux"):
        # EGL draws with and without a display, so that a film looks the same on both.
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    with warnings.catch_warnings():
        # What these libraries import warns of things that their users cannot mend.
        warnings.simplefilter("ignore")
        try:
            import OpenGL
            import pyglet

            if "OpenGL.GL" not in sys.modules:
                # A check after every call costs more than many of the calls.
                OpenGL.ERROR_CHECKING = False
            # pyrender imports its viewer, which opens a window on import unless headless is set.
            pyglet.options["headless"] = True
            _accept_references()
            _do_without_checks()
            import pyrender
            from OpenGL import GL
        except (ImportError, OSError, AttributeError) as error:
            raise MissingLibraryError(
                f"OpenGL cannot be loaded ({error}); install it: {INSTALL_LINE}"
            ) from error
    return GL, pyrender


def _cannot_load(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return True
    return False


def _accept_references() -> None:
    """Let PyOpenGL 3.1.0, which pyrender pins, take ``ctypes.byref`` from Python 3.12 on.

    There the type is called otherwise than PyOpenGL looks for: "No array-type handler".
    """
    from OpenGL.plugins import FormatHandler

    for handler in FormatHandler.registry:
        if handler.name == "ctypesparameter" and "_ctypes.CArgObject" not in handler.check:
            handler.check.append("_ctypes.CArgObject")


def _do_without_checks() -> None:
    """Name what PyOpenGL 3.1.0 forgets to name for EGL when its checks are off."""
    from OpenGL.raw.EGL import _errors

    if not hasattr(_errors, "_error_checker"):
        _errors._error_checker = None
