"""OpenGL and pyrender, imported so that they work without a screen and with NumPy 2.

The modules that draw take both libraries from :mod:`lrf3d.studio.render.buffers`.
"""

import ctypes
import ctypes.util
import os
import sys
import warnings
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from threading import RLock
from types import ModuleType
from typing import Any

from lrf3d.base.errors import MissingLibraryError

_INSTALL = "apt-get install -y --no-install-recommends"

# Command that installs OpenGL on a bare Debian or Ubuntu, as no wheel does.
INSTALL_LINE = f"{_INSTALL} libegl1 libgl1"

# Command that installs a software driver, where the libraries are there but nothing draws.
DRIVER_LINE = f"{_INSTALL} libegl-mesa0 libgl1-mesa-dri"

# One thread at a time starts OpenGL.
_STARTS = RLock()

_INSTEAD = "or draw with the renderer embree, which needs none"


def gl_available() -> bool:
    """Whether OpenGL can draw: its libraries are there, and a driver starts."""
    with _STARTS:
        return not _failure()


def require_gl() -> None:
    """See that OpenGL can draw.

    Raises:
        MissingLibraryError: It cannot.
    """
    if not gl_available():
        raise MissingLibraryError(f"{_failure()}; {_INSTEAD}")


@cache
def _failure() -> str:
    """Why OpenGL cannot draw, and what to install; empty where it can."""
    if not sys.platform.startswith("linux"):
        found = ctypes.util.find_library("GL") is not None or sys.platform == "win32"
        return "" if found else "no OpenGL library on this machine"
    try:
        for name in ("libEGL.so.1", "libGL.so.1"):
            ctypes.CDLL(name)
    except OSError:
        return f"no OpenGL library on this machine; install it: {INSTALL_LINE}"
    try:
        context()
    except MissingLibraryError:
        return f"OpenGL is installed, but no driver of it starts; install one: {DRIVER_LINE}"
    from OpenGL import EGL

    # Any thread may draw.
    none = EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT
    EGL.eglMakeCurrent(EGL.eglGetCurrentDisplay(), *none)
    return ""


@cache
def context() -> Any:
    """The one OpenGL context of this process, current in the thread that asks first.

    It is pyrender's and is never deleted: that would end every other context of the process.

    Raises:
        MissingLibraryError: The libraries are there, but no driver that they could start.
    """
    try:
        if not sys.platform.startswith("linux"):
            made = _part_of_pyrender("platforms.pyglet_platform").PygletPlatform(1, 1)
        else:
            # EGL draws with and without a display, so that a film looks the same on both.
            # OSMesa, which is often named here, does not work with the PyOpenGL that pyrender pins.
            os.environ["PYOPENGL_PLATFORM"] = "egl"
            egl = _part_of_pyrender("platforms.egl")
            device = egl.get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
            made = egl.EGLPlatform(1, 1, device)
        made.init_context()
    except Exception as error:
        # pyrender asserts what EGL answers, so that any failure may come as anything.
        raise MissingLibraryError(
            f"OpenGL cannot start ({error!r}); install its software driver: {INSTALL_LINE}"
        ) from error
    return made


def import_libraries() -> tuple[Any, Any]:
    """Import OpenGL.GL, and what pyrender has for buffers.

    Raises:
        MissingLibraryError: There is no OpenGL on this machine.
    """
    require_gl()
    try:
        with _STARTS:
            primitive = _part_of_pyrender("primitive")
            from OpenGL import GL
    except (ImportError, OSError, AttributeError) as error:
        raise MissingLibraryError(
            f"OpenGL cannot be loaded ({error}); install it: {INSTALL_LINE}; {_INSTEAD}"
        ) from error
    return GL, primitive


def _part_of_pyrender(name: str) -> Any:
    """A module of pyrender without its viewer, its scenes and trimesh, which take a second.

    Who imports pyrender afterwards gets all of it.
    """
    part = ModuleType("pyrender")
    spec = find_spec("pyrender")
    part.__path__ = list((spec and spec.submodule_search_locations) or [])
    with warnings.catch_warnings():
        # What these libraries import warns of things that their users cannot fix.
        warnings.simplefilter("ignore")
        _adapt()
        whole = sys.modules.setdefault("pyrender", part)
        try:
            return import_module(f"pyrender.{name}")
        finally:
            if whole is part:
                for each in [each for each in sys.modules if each.split(".")[0] == "pyrender"]:
                    del sys.modules[each]


def _adapt() -> None:
    """Fix PyOpenGL 3.1.0, which pyrender pins.

    It does not find the type of ``ctypes.byref``, which was renamed in Python 3.12: "No
    array-type handler". With its checks off, a name of EGL's is missing.
    """
    import OpenGL

    if "OpenGL.GL" not in sys.modules:
        # A check after every call costs more than many of the calls.
        OpenGL.ERROR_CHECKING = False
    from OpenGL.plugins import FormatHandler
    from OpenGL.raw.EGL import _errors

    for handler in FormatHandler.registry:
        if handler.name == "ctypesparameter" and "_ctypes.CArgObject" not in handler.check:
            handler.check.append("_ctypes.CArgObject")
    if not hasattr(_errors, "_error_checker"):
        _errors._error_checker = None
