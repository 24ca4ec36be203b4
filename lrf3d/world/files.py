"""World files: built-in worlds by name, others by path."""

from pathlib import Path

from lrf3d.world.model import World


def load_world(name_or_path: str | Path) -> World:
    """Read a world."""
    raise NotImplementedError


def save_world(world: World, path: Path) -> None:
    """Write a world."""
    raise NotImplementedError


def world_names() -> list[str]:
    """Names of the built-in worlds."""
    raise NotImplementedError
