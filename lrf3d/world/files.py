"""World files: built-in worlds by name, others by path, each read and written by its ending."""

from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import OutputError, WorldError
from lrf3d.input import check_ordinary, worlds_folder
from lrf3d.world.model import World


@dataclass(frozen=True, slots=True)
class WorldFormat:
    """How files of an ending are read and written.

    Modules are named and not imported, so that a world file loads no other format's libraries.

    Args:
        read: Module of this package and function in it, ``module:function``, that reads a world
            from a path.
        write: The same of the function that writes a world to a path; empty where there is none.
        apart: Whether a process of its own reads the file, because the library that parses it has
            no bounds of its own.
    """

    read: str
    write: str = ""
    apart: bool = False


_GEOJSON = WorldFormat("geojson:read_geojson", "geojson:write_geojson")
_ROS_MAP = WorldFormat("ros_map:read_ros_map", "ros_map:write_ros_map")
_MESH = WorldFormat("mesh:read_mesh", apart=True)

FORMATS = {
    ".toml": WorldFormat("toml_file:read_world", "toml_file:write_toml"),
    ".geojson": _GEOJSON,
    ".json": WorldFormat(_GEOJSON.read),
    ".osm": WorldFormat("osm:read_osm"),
    ".yaml": _ROS_MAP,
    ".yml": WorldFormat(_ROS_MAP.read),
    ".dxf": WorldFormat("dxf:read_dxf", apart=True),
    ".svg": WorldFormat("svg:read_svg", apart=True),
    ".glb": WorldFormat(_MESH.read, "mesh:write_glb", apart=True),
    ".gltf": _MESH,
    ".obj": _MESH,
    ".off": _MESH,
    ".ply": _MESH,
    ".stl": _MESH,
}
"""The formats of worlds by the ending of the file; a new format is one more entry."""

WRITTEN = [ending for ending, known in FORMATS.items() if known.write]
"""The endings of files that worlds are written to."""


def load_world(name_or_path: str | Path) -> World:
    """Read a world: a built-in one by its name, or a file by its path.

    Raises:
        WorldError: There is no such world, or its file cannot be used.

    Examples:
        >>> import lrf3d
        >>> lrf3d.load_world("paper_room").object_count
        3
    """
    path = find_world(name_or_path)
    known = FORMATS[path.suffix.lower()]
    if known.apart:
        # Only what reads a file apart needs to know how processes are started.
        from lrf3d.world.apart import read_apart

        return read_apart(path, known.read)
    world: World = _function(known.read)(path)
    return world


def save_world(world: World, path: str | Path, *, resolution: float | None = None) -> None:
    """Write a world to a file in the format that its ending names.

    TOML and GeoJSON keep the world to the last bit; GLB keeps it in float32 about its ``origin``,
    and a ROS map (``.yaml`` and, beside it, ``.pgm``) to half a cell.

    Args:
        world: The world.
        path: The file; it ends in .toml, .geojson, .glb or .yaml.
        resolution: Side of a cell [m], for a ROS map alone; 0.05, or what makes the map small
            enough, if not given.

    Raises:
        OutputError: The file cannot be written, its ending names no known format, or a
            resolution is given for a format that has none.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_world(lrf3d.World([[0, 0, 4, 0]]), "wall.toml")
        >>> lrf3d.load_world("wall.toml").segments.tolist()
        [[0.0, 0.0, 4.0, 0.0]]
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in WRITTEN:
        raise OutputError(f"{path}: unknown ending; a world is written as {', '.join(WRITTEN)}")
    options: dict[str, Any] = {}
    if resolution is not None:
        if ending != ".yaml" or not 1e-4 <= resolution <= 1e4:
            raise OutputError(
                f"{path}: resolution {resolution:g}: expected 0.0001 to 10000 m, for a ROS map"
                " (.yaml)"
            )
        options["resolution"] = resolution
    _function(FORMATS[ending].write)(world, path, **options)


def _function(name: str) -> Any:
    """A function of this package that is named ``module:function``."""
    module, _, function = name.partition(":")
    return getattr(import_module(f"lrf3d.world.{module}"), function)


def world_names() -> list[str]:
    """Names of the built-in worlds, sorted.

    Examples:
        >>> import lrf3d
        >>> lrf3d.world_names()
        ['city', 'corridor', 'paper_room']
    """
    return sorted(path.stem for path in worlds_folder().glob("*.toml"))


def find_world(name_or_path: str | Path) -> Path:
    """The file of a world that is named or given by its path; its ending is a known one.

    A built-in name comes before a file or a folder that is called the same: that is ``./city``.

    Raises:
        WorldError: There is no such world.
    """
    names = world_names()
    if isinstance(name_or_path, str) and name_or_path in names:
        return worlds_folder() / f"{name_or_path}.toml"
    path = Path(name_or_path)
    known = ", ".join(FORMATS)
    if path.suffix.lower() in FORMATS:
        missing = f"no such file{_suggestion(path.stem, names)}"
        check_ordinary(path, what="a world file", missing=missing, error=WorldError)
        return path
    if path.is_dir() or path.suffix.lower() == ".npz":
        run = not path.is_dir() or (path / "run.npz").exists()
        what = "a run, for `lrf3d view` and others" if run else "a folder"
        raise WorldError(
            f"{path}: {what}; expected a world: {', '.join(names)}, or a file ({known})"
        )
    if path.is_file() or path.suffix:
        raise WorldError(f"{path}: unknown ending; worlds are read from {known}")
    raise WorldError(
        f"{name_or_path}: unknown world{_suggestion(str(name_or_path), names)}; built-in are"
        f" {', '.join(names)}; or give a file ({known})"
    )


def _suggestion(name: str, names: list[str]) -> str:
    near = get_close_matches(name, names, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
