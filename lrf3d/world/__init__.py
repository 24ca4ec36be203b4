"""Worlds: the walls of a scene, read from files and made ready to cast beams at."""

from lrf3d.world.files import load_world, save_world, world_names
from lrf3d.world.materials import Material
from lrf3d.world.model import World

__all__ = ["Material", "World", "load_world", "save_world", "world_names"]
