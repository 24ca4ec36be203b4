"""Worlds and runs as glTF 2.0 in one file (GLB), which Blender, web viewers and engines read.

Needs no OpenGL: what the film draws is taken as arrays.
"""

from lrf3d.gltf.drive import run_glb, still_glb

__all__ = ["run_glb", "still_glb"]
