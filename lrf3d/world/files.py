"""World files: built-in worlds by name, others by path, each read by its ending."""

from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path

from lrf3d.errors import OutputError, WorldError
from lrf3d.input import check_ordinary
from lrf3d.output import replacing, write_text
from lrf3d.resources import worlds_folder
from lrf3d.world.model import World


def load_world(name_or_path: str | Path) -> World:
    """Read a world: a built-in one by its name, or a file by its path.

    Raises:
        WorldError: There is no such world, or its file cannot be used.
    """
    path = find_world(name_or_path)
    return READERS[path.suffix.lower()](path)


def save_world(world: World, path: Path) -> None:
    """Write a world to a file in the format that its ending names; see :meth:`World.save`.

    Raises:
        OutputError: The file cannot be written, or its ending names no known format.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise OutputError(f"{path}: unknown ending; a world is written as {', '.join(WRITERS)}")
    WRITERS[path.suffix.lower()](world, path)


def world_names() -> list[str]:
    """Names of the built-in worlds, sorted."""
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
    known = ", ".join(READERS)
    if path.suffix.lower() in READERS:
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


def _read_toml(path: Path) -> World:
    from lrf3d.world.toml_file import read_toml

    return read_toml(path).world


def _read_geojson(path: Path) -> World:
    from lrf3d.world.geojson import read_geojson

    return read_geojson(path)


def _read_osm(path: Path) -> World:
    from lrf3d.world.osm import read_osm

    return read_osm(path)


def _read_ros_map(path: Path) -> World:
    from lrf3d.world.ros_map import read_ros_map

    return read_ros_map(path)


def _read_apart(path: Path) -> World:
    from lrf3d.world.apart import read_apart

    return read_apart(path)


def _write_toml(world: World, path: Path) -> None:
    from lrf3d.world.toml_writer import toml_text

    write_text(path, toml_text(world))


def _write_geojson(world: World, path: Path) -> None:
    from lrf3d.world.geojson_writer import geojson_text

    write_text(path, geojson_text(world))


def _write_glb(world: World, path: Path) -> None:
    from lrf3d.world.glb_writer import glb_bytes

    with replacing(path) as unfinished:
        unfinished.write_bytes(glb_bytes(world))


def _write_ros_map(world: World, path: Path) -> None:
    from lrf3d.world.ros_map_writer import write_ros_map

    write_ros_map(world, path)


READERS: dict[str, Callable[[Path], World]] = {
    ".toml": _read_toml,
    ".geojson": _read_geojson,
    ".json": _read_geojson,
    ".osm": _read_osm,
    ".yaml": _read_ros_map,
    ".yml": _read_ros_map,
    ".dxf": _read_apart,
    ".svg": _read_apart,
    ".glb": _read_apart,
    ".gltf": _read_apart,
    ".obj": _read_apart,
    ".off": _read_apart,
    ".ply": _read_apart,
    ".stl": _read_apart,
}
"""How a world is read, by the ending of its file; a new format is one more entry."""

WRITERS: dict[str, Callable[[World, Path], None]] = {
    ".toml": _write_toml,
    ".geojson": _write_geojson,
    ".glb": _write_glb,
    ".yaml": _write_ros_map,
}
"""How a world is written, by the ending of the file."""
