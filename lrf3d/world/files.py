"""World files: built-in worlds by name, others by path; the ending of a file gives its format."""

from collections.abc import Callable
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, OutputError, WorldError
from lrf3d.files import check_ordinary, worlds_folder
from lrf3d.world.model import World
from lrf3d.world.schema import at

PICTURES = dict.fromkeys((".png", ".pgm"), "ros_map:read_picture")
"""Bare pictures of floor plans, which need a resolution."""

MESHES = dict.fromkeys((".glb", ".gltf", ".obj", ".off", ".ply", ".stl"), "mesh:read_mesh")

BY_LIBRARY = {
    ".dxf": "drawings:read_dxf",
    ".svg": "drawings:read_svg",
    **MESHES,
}
"""Formats that a library parses, which raises anything where a file is damaged."""

READERS = {
    ".toml": "toml_file:read_toml",
    ".geojson": "geojson:read_geojson",
    ".json": "geojson:read_geojson",
    ".osm": "osm:read_osm",
    ".yaml": "ros_map:read_ros_map",
    ".yml": "ros_map:read_ros_map",
    **PICTURES,
    **BY_LIBRARY,
}
"""The module and the function that read a world, by the ending of the file."""

LARGEST = {
    **dict.fromkeys(READERS, 1 << 28),
    **dict.fromkeys((".yaml", ".yml"), 1 << 16),
    ".svg": 1 << 25,
    ".dxf": 1 << 26,
    **dict.fromkeys(MESHES, 1 << 27),
}
"""Largest file [bytes], by its ending: a town of half a million inhabitants as OpenStreetMap has
it, two million walls as TOML, the plan of a factory as SVG."""

WRITERS = {
    ".toml": "toml_file:write_toml",
    ".geojson": "geojson:write_geojson",
    ".yaml": "ros_map:write_ros_map",
    ".glb": "mesh:write_glb",
}
"""The module and the function that write a world, by the ending of the file."""


def load_world(
    name_or_path: str | Path, *, trees: bool = False, resolution: float | None = None
) -> World:
    """Read a world: a built-in one by its name, or a file by its path.

    Args:
        name_or_path: The name or the path.
        trees: Whether the trunks of the trees in an OpenStreetMap extract are walls too, each an
            object of bark. Films show such objects as trees.
        resolution: Side of a pixel [m], for a bare picture of a floor plan (.png, .pgm).

    Raises:
        WorldError: There is no such world, its file cannot be used, or an option is given that
            its format does not have.

    Examples:
        >>> import lrf3d
        >>> lrf3d.load_world("paper_room").object_count
        3
    """
    path = find_world(name_or_path)
    ending = path.suffix.lower()
    if trees and ending != ".osm":
        raise WorldError(f"{path}: trees are read from OpenStreetMap extracts (.osm) alone")
    if resolution is not None and ending not in PICTURES:
        raise WorldError(f"{path}: a resolution is for a picture ({', '.join(PICTURES)}) alone")
    given = {"trees": trees or None, "resolution": resolution}
    options = {key: value for key, value in given.items() if value is not None}
    with at(str(path)):
        try:
            world: World = _function(READERS[ending])(path, **options)
        except InputError:
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise WorldError(f"cannot be read: {error.strerror}") from None
            if ending not in BY_LIBRARY:
                raise
            # What a library raises depends on the damage.
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"[:120].strip(": ")
            raise WorldError(
                f"damaged, or not a {ending[1:]} file ({reason}); save it again"
            ) from error
    return world


def save_world(world: World, path: str | Path, *, resolution: float | None = None) -> None:
    """Write a world to a file in the format that its ending names.

    TOML and GeoJSON keep the world to the last bit; GLB keeps it in float32 about its ``origin``,
    and a ROS map (``.yaml`` and, beside it, ``.pgm``) to half a cell.

    Args:
        world: The world.
        path: The file; it ends in .toml, .geojson, .yaml or .glb.
        resolution: Side of a cell [m], for a ROS map alone; 0.05, or what makes the map small
            enough, if not given.

    Raises:
        OutputError: The file cannot be written, its ending names no known format, or a
            resolution is given for a format that has none.

    Examples:
        >>> import tempfile
        >>> import lrf3d
        >>> path = f"{tempfile.mkdtemp()}/wall.toml"
        >>> lrf3d.save_world(lrf3d.World([[0, 0, 4, 0]]), path)
        >>> lrf3d.load_world(path).segments.tolist()
        [[0.0, 0.0, 4.0, 0.0]]
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise OutputError(f"{path}: unknown ending; a world is written as {', '.join(WRITERS)}")
    options = {} if resolution is None else {"resolution": resolution}
    if resolution is not None and not (ending == ".yaml" and 1e-4 <= resolution <= 1e4):
        raise OutputError(
            f"{path}: resolution {resolution:g}: expected 0.0001 to 10000 m, for a ROS map (.yaml)"
        )
    _function(WRITERS[ending])(world, path, **options)


def _function(target: str) -> Callable[..., Any]:
    """The function of a table's entry; its module loads the libraries of that format alone."""
    module, name = target.split(":")
    function: Callable[..., Any] = getattr(import_module(f"lrf3d.world.{module}"), name)
    return function


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
    known = ", ".join(READERS)
    if (largest := LARGEST.get(path.suffix.lower())) is not None:
        missing = f"no such file{_suggestion(path.stem, names)}"
        check_ordinary(
            path, what="a world file", largest=largest, missing=missing, error=WorldError
        )
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
