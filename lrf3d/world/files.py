"""World files: built-in worlds by name, others by path; the ending of a file gives its format."""

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from lrf3d.errors import OutputError, WorldError
from lrf3d.files import check_ordinary, worlds_folder
from lrf3d.world.model import World


@dataclass(frozen=True, slots=True)
class WorldFormat:
    """How files of an ending are read and written.

    Args:
        read: Reads a world from a path.
        write: Writes a world to a path; None if worlds are not written in this format.
        apart: Whether the file is read in a process of its own, because the library that parses it
            limits neither time nor memory.
        trees: Whether ``read`` takes ``trees=True``, which makes walls of the trunks of trees.
    """

    read: Callable[..., World]
    write: Callable[..., None] | None = None
    apart: bool = False
    trees: bool = False


# Each format is imported by its own functions, so that a world loads no other format's libraries.


def _read_toml(path: Path) -> World:
    from lrf3d.world.toml_file import read_toml

    return read_toml(path).world


def _write_toml(world: World, path: Path) -> None:
    from lrf3d.world.toml_text import write_toml

    write_toml(world, path)


def _read_geojson(path: Path) -> World:
    from lrf3d.world.geojson import read_geojson

    return read_geojson(path)


def _write_geojson(world: World, path: Path) -> None:
    from lrf3d.world.geojson import write_geojson

    write_geojson(world, path)


def _read_osm(path: Path, *, trees: bool = False) -> World:
    from lrf3d.world.osm import read_osm

    return read_osm(path, trees=trees)


def _read_ros_map(path: Path) -> World:
    from lrf3d.world.ros_map import read_ros_map

    return read_ros_map(path)


def _write_ros_map(world: World, path: Path, **options: Any) -> None:
    from lrf3d.world.ros_map import write_ros_map

    write_ros_map(world, path, **options)


def _read_dxf(path: Path) -> World:
    from lrf3d.world.dxf import read_dxf

    return read_dxf(path)


def _read_svg(path: Path) -> World:
    from lrf3d.world.svg import read_svg

    return read_svg(path)


def _read_mesh(path: Path) -> World:
    from lrf3d.world.mesh import read_mesh

    return read_mesh(path)


def _write_glb(world: World, path: Path) -> None:
    from lrf3d.world.mesh import write_glb

    write_glb(world, path)


_MESH = WorldFormat(_read_mesh, apart=True)

FORMATS = {
    ".toml": WorldFormat(_read_toml, _write_toml),
    ".geojson": WorldFormat(_read_geojson, _write_geojson),
    ".json": WorldFormat(_read_geojson),
    ".osm": WorldFormat(_read_osm, trees=True),
    ".yaml": WorldFormat(_read_ros_map, _write_ros_map),
    ".yml": WorldFormat(_read_ros_map),
    ".dxf": WorldFormat(_read_dxf, apart=True),
    ".svg": WorldFormat(_read_svg, apart=True),
    ".glb": WorldFormat(_read_mesh, _write_glb, apart=True),
    ".gltf": _MESH,
    ".obj": _MESH,
    ".off": _MESH,
    ".ply": _MESH,
    ".stl": _MESH,
}
"""The formats of worlds by the ending of the file; a new format is one more entry."""

WRITERS = {ending: known.write for ending, known in FORMATS.items() if known.write is not None}
"""What writes a world, by the ending of the file."""


def load_world(name_or_path: str | Path, *, trees: bool = False) -> World:
    """Read a world: a built-in one by its name, or a file by its path.

    Args:
        name_or_path: The name or the path.
        trees: Whether the trunks of the trees in an OpenStreetMap extract are walls too, each an
            object of bark. Films show such objects as trees.

    Raises:
        WorldError: There is no such world, its file cannot be used, or trees are asked for of a
            file that is no such extract.

    Examples:
        >>> import lrf3d
        >>> lrf3d.load_world("paper_room").object_count
        3
    """
    path = find_world(name_or_path)
    known = FORMATS[path.suffix.lower()]
    if trees:
        if not known.trees:
            raise WorldError(f"{path}: trees are read from OpenStreetMap extracts (.osm) alone")
        return known.read(path, trees=True)
    if known.apart:
        from lrf3d.world.apart import read_apart

        return read_apart(path, known.read)
    return known.read(path)


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
    if ending not in WRITERS:
        raise OutputError(f"{path}: unknown ending; a world is written as {', '.join(WRITERS)}")
    options: dict[str, Any] = {}
    if resolution is not None:
        if ending != ".yaml" or not 1e-4 <= resolution <= 1e4:
            raise OutputError(
                f"{path}: resolution {resolution:g}: expected 0.0001 to 10000 m, for a ROS map"
                " (.yaml)"
            )
        options["resolution"] = resolution
    WRITERS[ending](world, path, **options)


def world_names() -> list[str]:
    """Names of the built-in worlds, sorted.

    Examples:
        >>> import lrf3d
        >>> lrf3d.world_names()
        ['city', 'corridor', 'glass_office', 'mirror_hall', 'paper_room', 'warehouse']
    """
    return sorted(path.stem for path in worlds_folder().glob("*.toml"))


def find_world(name_or_path: str | Path) -> Path:
    """The file of a world, given by its name or its path, with a known ending.

    A built-in name comes before a file or a folder of that name, which is given as ``./city``.

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
