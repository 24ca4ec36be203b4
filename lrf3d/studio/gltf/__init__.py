"""Runs as glTF 2.0 in one file (GLB), in the film's light: no material needs a lamp."""

from lrf3d.studio.gltf.drive import run_glb

__all__ = ["run_glb"]
