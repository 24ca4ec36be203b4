"""Casting beams: exact in the plane, and with Embree in 3D.

Casters are loaded when they are first used: dynamic obstacles need none of their compiled code.
"""

from typing import TYPE_CHECKING

from lrf3d.base.lazy import loading

if TYPE_CHECKING:
    from lrf3d.casting.caster import PlanarCaster
    from lrf3d.casting.comparison import CrossCheck, crosscheck
    from lrf3d.casting.embree import EmbreeCaster
else:
    __getattr__, __dir__ = loading(
        globals(),
        {"comparison": "CrossCheck crosscheck", "embree": "EmbreeCaster", "caster": "PlanarCaster"},
    )

__all__ = ["CrossCheck", "EmbreeCaster", "PlanarCaster", "crosscheck"]
