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
from types import ModuleType
from typing import Any

from lrf3d.base.errors import MissingLibraryError

_INSTALL = "apt-get install -y --no-install-recommends"

# Command that installs OpenGL on a bare Debian or Ubuntu, as no wheel does.
INSTALL_LINE = f"{_INSTALL} libegl1 libgl1"

# Command that installs a software driver, where the libraries are there but nothing draws.
DRIVER_LINE = f"{_INSTALL} libegl-mesa0 libgl1-mesa-dri"

# EGL's number for displays that are devices.
_DEVICE = 0x313F

# EGL's number for OpenGL.
_OPENGL = 0x30A2

# EGL's numbers for the context that pyrender makes: OpenGL 4.1, core profile.
_CONTEXT = (0x3098, 4, 0x30FB, 1, 0x30FD, 1, 0x3038)

_INSTEAD = "or draw with the renderer embree, which needs none"


def gl_available() -> bool:
    """Whether OpenGL can draw: its libraries are there, and a driver starts."""
    return not _failure()


def require_gl() -> None:
    """See that OpenGL can draw.

    Raises:
        MissingLibraryError: It cannot.
    """
    if failure := _failure():
        raise MissingLibraryError(f"{failure}; {_INSTEAD}")


@cache
def _failure() -> str:
    """Why OpenGL cannot draw, and what to install; empty where it can."""
    if not sys.platform.startswith("linux"):
        found = ctypes.util.find_library("GL") is not None or sys.platform == "win32"
        return "" if found else "no OpenGL library on this machine"
    try:
        egl, _ = map(ctypes.CDLL, ("libEGL.so.1", "libGL.so.1"))
    except OSError:
        return f"no OpenGL library on this machine; install it: {INSTALL_LINE}"
    if not _starts(egl):
        return f"OpenGL is installed, but no driver of it starts; install one: {DRIVER_LINE}"
    return ""


def _starts(egl: ctypes.CDLL) -> bool:
    """Whether EGL makes a context as pyrender does, on the first of its devices.

    The display is not closed: it would end the contexts that others in this process have on it.
    """
    pointer = ctypes.c_void_p
    egl.eglGetProcAddress.restype = egl.eglGetDisplay.restype = egl.eglCreateContext.restype = (
        pointer
    )
    query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_of = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    device = pointer()
    count = ctypes.c_int()
    if query and display_of:
        find = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, pointer, pointer)(query)
        if not find(1, ctypes.byref(device), ctypes.byref(count)) or not count.value:
            return False
        show = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display_of)
        display = pointer(show(_DEVICE, device, None))
    else:
        display = pointer(egl.eglGetDisplay(None))
    if not display or not egl.eglInitialize(display, None, None) or not egl.eglBindAPI(_OPENGL):
        return False
    wanted = (ctypes.c_int * len(_CONTEXT))(*_CONTEXT)
    context = pointer(egl.eglCreateContext(display, None, None, wanted))
    return bool(context) and bool(egl.eglDestroyContext(display, context))


def import_libraries() -> tuple[Any, Any, Any]:
    """Import OpenGL.GL, and pyrender's contexts without a screen and its primitives.

    Raises:
        MissingLibraryError: There is no OpenGL on this machine.
    """
    require_gl()
    offscreen = "pyglet_platform"
    if sys.platform.startswith("linux"):
        # EGL draws with and without a display, so that a film looks the same on both.
        # OSMesa, which is often named here, does not work with the PyOpenGL that pyrender pins.
        os.environ["PYOPENGL_PLATFORM"] = offscreen = "egl"
    with warnings.catch_warnings():
        # What these libraries import warns of things that their users cannot fix.
        warnings.simplefilter("ignore")
        try:
            import OpenGL

            if "OpenGL.GL" not in sys.modules:
                # A check after every call costs more than many of the calls.
                OpenGL.ERROR_CHECKING = False
            _adapt()
            from OpenGL import GL

            return GL, *_parts_of_pyrender(f"platforms.{offscreen}", "primitive")
        except (ImportError, OSError, AttributeError) as error:
            raise MissingLibraryError(
                f"OpenGL cannot be loaded ({error}); install it: {INSTALL_LINE}; {_INSTEAD}"
            ) from error


def _parts_of_pyrender(*names: str) -> list[Any]:
    """Modules of pyrender without its viewer, its scenes and trimesh, which take a second.

    Who imports pyrender afterwards gets all of it.
    """
    parts = ModuleType("pyrender")
    spec = find_spec("pyrender")
    parts.__path__ = list((spec and spec.submodule_search_locations) or [])
    whole = sys.modules.setdefault("pyrender", parts)
    try:
        return [import_module(f"pyrender.{name}") for name in names]
    finally:
        if whole is parts:
            for name in [each for each in sys.modules if each.split(".")[0] == "pyrender"]:
                del sys.modules[name]


def _adapt() -> None:
    """Fix PyOpenGL 3.1.0, which pyrender pins.

    It does not find the type of ``ctypes.byref``, which was renamed in Python 3.12: "No
    array-type handler". With its checks off, a name of EGL's is missing.
    """
    from OpenGL.plugins import FormatHandler
    from OpenGL.raw.EGL import _errors

    for handler in FormatHandler.registry:
        if handler.name == "ctypesparameter" and "_ctypes.CArgObject" not in handler.check:
            handler.check.append("_ctypes.CArgObject")
    if not hasattr(_errors, "_error_checker"):
        _errors._error_checker = None
