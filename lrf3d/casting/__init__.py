"""Casting beams: exact in the plane, and with Embree in 3D.

Casters are loaded when they are first used: dynamic obstacles need none of their compiled code.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lrf3d.casting.comparison import CrossCheck, crosscheck
    from lrf3d.casting.embree import EmbreeCaster
    from lrf3d.casting.planar import PlanarCaster

__all__ = ["CrossCheck", "EmbreeCaster", "PlanarCaster", "crosscheck"]

_HOMES = {
    "CrossCheck": "comparison",
    "EmbreeCaster": "embree",
    "PlanarCaster": "planar",
    "crosscheck": "comparison",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
