"""The Embree library that embreex brings along, called without the copies and the loop of embreex.

embreex hands rays to Embree one by one, from arrays of its own. Compiled code that knows where
the function ``rtcIntersect8`` lies hands over eight at a time, in half the time. Whether the
library is there, of the right version and in working order is tried out once; where it is not,
casters go on with embreex. Where embreex is missing too, as on Linux with an ARM processor, for
which it has no wheel, they go on with compiled code of their own, which gives the same ranges.
"""

import ctypes
import multiprocessing
import warnings
import weakref
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.packets import find_faces
from lrf3d.errors import Lrf3dWarning, MissingLibraryError

MAJOR_VERSION = 4
"""The version of Embree whose packets `kernels.packets` builds."""

# Numbers from rtcore_device.h, rtcore_geometry.h and rtcore_buffer.h of Embree 4.
_VERSION_MAJOR = 1
_TRIANGLES = 0
_INDICES, _VERTICES = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_ROW = 12  # Bytes of three numbers.

_POINTER, _SIZE, _INT, _UINT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_uint

_FUNCTIONS = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcGetDeviceError": (_INT, [_POINTER]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, _INT]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, _INT]),
    "rtcSetNewGeometryBuffer": (_POINTER, [_POINTER, _INT, _UINT, _INT, _SIZE, _SIZE]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (_UINT, [_POINTER, _POINTER]),
    "rtcReleaseGeometry": (None, [_POINTER]),
}
"""Result and arguments of the functions that are called from Python."""


class EmbreeScene(NamedTuple):
    """Triangles that compiled code can cast at, for as long as it is kept."""

    intersect: int
    """Address of ``rtcIntersect8``."""
    address: int
    """Address of the scene."""
    owner: "_Owned"


class _Owned:
    """A scene of Embree that is released when nobody holds this any more."""

    def __init__(self, library: ctypes.CDLL, scene: int) -> None:
        self.release = weakref.finalize(self, library.rtcReleaseScene, scene)
        # At the end of the process a thread may still be casting, and all is released anyway.
        self.release.atexit = False


class EmbreeLibrary:
    """A loaded Embree with a device, which lives as long as the process.

    Args:
        library: The library, or one that depends on it.

    Raises:
        AttributeError: It has not the functions of Embree 4.
        OSError: It is of another version, or gives no device.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        self._library = library
        self._intersect = ctypes.cast(library.rtcIntersect8, _POINTER).value or 0
        self._device = library.rtcNewDevice(None)
        if not self._device:
            raise OSError("Embree gives no device")
        version = library.rtcGetDeviceProperty(self._device, _VERSION_MAJOR)
        if version != MAJOR_VERSION:
            raise OSError(f"Embree {version}, expected {MAJOR_VERSION}")

    def build(self, vertices: NDArray[np.float32], faces: NDArray[np.integer]) -> EmbreeScene:
        """Build a scene of faces (m, 3) over vertices (n, 3).

        Raises:
            OSError: Embree reports an error, as where memory is short.
        """
        library = self._library
        scene = library.rtcNewScene(self._device)
        owner = _Owned(library, scene)
        geometry = library.rtcNewGeometry(self._device, _TRIANGLES)
        self._fill(geometry, _VERTICES, _FLOAT3, np.ascontiguousarray(vertices, np.float32))
        self._fill(geometry, _INDICES, _UINT3, np.ascontiguousarray(faces, np.uint32))
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(scene, geometry)
        library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(scene)
        error = library.rtcGetDeviceError(self._device)
        if error:
            raise OSError(f"Embree reports error {error} while it builds a scene")
        return EmbreeScene(self._intersect, scene, owner)

    def _fill(
        self,
        geometry: int,
        kind: int,
        layout: int,
        rows: NDArray[np.float32] | NDArray[np.uint32],
    ) -> None:
        """Hand rows (n, 3) to a geometry."""
        buffer = self._library.rtcSetNewGeometryBuffer(geometry, kind, 0, layout, _ROW, len(rows))
        if buffer:
            ctypes.memmove(buffer, rows.ctypes.data, rows.nbytes)


@cache
def embreex_installed() -> bool:
    """Whether embreex is installed; if it is not, a warning says once what is done instead."""
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError:
        # The processes that a program starts would each say the same again.
        if multiprocessing.parent_process() is None:
            warnings.warn(
                "embreex is not installed: beams are cast without Embree, to the same ranges",
                Lrf3dWarning,
                stacklevel=2,
            )
        return False
    return True


def require_embreex(task: str) -> None:
    """See that embreex is there for a task that makes no sense without it.

    Raises:
        MissingLibraryError: It is not.
    """
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError:
        raise MissingLibraryError(
            f"{task} needs Embree: pip install embreex (for Linux on ARM it has no wheel)"
        ) from None


@cache
def embree_library() -> EmbreeLibrary | None:
    """The library, loaded and tried out once a process; None where it is not to be used."""
    if not embreex_installed():
        return None
    for file in _candidates():
        try:
            library = EmbreeLibrary(ctypes.CDLL(str(file)))
            if _answers(library):
                return library
        except (AttributeError, OSError):
            continue
    return None


def _candidates() -> Iterator[Path]:
    """Files in which to look for Embree's functions.

    First embreex's own module: Linux and macOS look up a function in all libraries that a module
    depends on, so this is the very library that embreex uses, whatever it is called. Windows does
    not; there it lies beside the package, or in it.
    """
    import embreex.rtcore_scene

    module = Path(embreex.rtcore_scene.__file__)
    yield module
    for folder in (module.parent.parent / "embreex.libs", module.parent):
        yield from sorted(folder.glob("**/*embree4*"))


def _answers(library: EmbreeLibrary) -> bool:
    """Whether a packet, and a second that is not full, hit and miss a triangle as they should."""
    scene = library.build(
        np.array([[1, -1, -1], [1, 1, -1], [1, 0, 9]], np.float32), np.array([[0, 1, 2]])
    )
    across = np.linspace(-1.6, 1.6, 11)
    faces = find_faces(scene.intersect, scene.address, 0.0, 0.0, np.ones(11), across, 10.0)
    short = find_faces(scene.intersect, scene.address, 0.0, 0.0, np.ones(11), across, 0.5)
    return bool(((faces == 0) == (abs(across) < 0.9)).all() and (short == -1).all())
