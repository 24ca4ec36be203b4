"""Where the files lie that lrf3d brings along: the built-in worlds and the assets.

In a checkout they stand beside the package, in a wheel inside it.
"""

from pathlib import Path

_PACKAGE = Path(__file__).parent


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def worlds_folder() -> Path:
    """The folder of the built-in worlds, one TOML file each."""
    return _folder("worlds")


def assets_folder() -> Path:
    """The folder of the robot's mesh and of the pictures."""
    return _folder("assets")
