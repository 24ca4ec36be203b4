"""Casting beams: exact in the plane, and with Embree in 3D."""

from lrf3d.casting.crosscheck import CrossCheck, crosscheck
from lrf3d.casting.embree import EmbreeCaster
from lrf3d.casting.planar import PlanarCaster

__all__ = ["CrossCheck", "EmbreeCaster", "PlanarCaster", "crosscheck"]
