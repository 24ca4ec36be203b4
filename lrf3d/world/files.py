"""World files: built-in worlds by name, others by path; the ending of a file gives its format."""

from difflib import get_close_matches
from pathlib import Path
from typing import Any

from lrf3d.base.errors import OutputError, WorldError, check_names, expect
from lrf3d.base.files import as_path, check_ordinary, data_folder
from lrf3d.base.formats import (
    WORLDS,
    Format,
    by_ending,
    by_looks,
    by_name,
    endings,
    enter_installed,
    function,
    head_of,
    of_kind,
    unpacked,
)
from lrf3d.base.interrupts import reading
from lrf3d.base.isolation import read_file
from lrf3d.world.model import LARGEST_CELL, World, check_scale
from lrf3d.world.schema import at
from lrf3d.world.toml_file import WorldFile


def load_world(
    name_or_path: str | Path,
    *,
    trees: bool = False,
    resolution: float | None = None,
    threshold: float | None = None,
    scale: float = 1.0,
    edits: Any = None,
    isolated: bool = True,
    **drawing: Any,
) -> World:
    """Read a world: a built-in one by its name, or a file by its path.

    Args:
        name_or_path: The name or the path.
        trees: Whether trunks of trees in an OpenStreetMap extract also become walls.
        resolution: Side of a pixel [m], for a bare picture of a floor plan (.png, .jpg, …).
        threshold: Least grey of paper, from 0 to 255, in a picture or a scanned page; found from
            the picture if not given.
        scale: Enlarges the plan, but not the heights: 100 for a drawing of 1:100. A mesh is
            enlarged as a whole.
        edits: Decisions about a plan, as for `read_plan`; those of ``FILE.edit.toml`` next to it if
            not given.
        isolated: Read a file of another program in a process of its own, with limits on memory and
            time.
        drawing: For a drawing, ``layers``, name patterns of layers that are walls, ``without``,
            those of layers to leave out, and ``page`` of a PDF file; for a mesh, ``cut``, the
            height [m] above its floor at which it is cut; for GeoJSON and OpenStreetMap, ``level``
            of indoor rooms.

    Raises:
        WorldError: There is no such world, its file cannot be used, or an option is given that
            its format does not have.

    Examples:
        >>> import lrf3d
        >>> lrf3d.load_world("paper_room").object_count
        3
    """
    drawing |= {"trees": trees, "resolution": resolution, "threshold": threshold}
    file = load_world_file(name_or_path, scale=scale, edits=edits, isolated=isolated, **drawing)
    return file.world


def load_world_file(
    name_or_path: str | Path,
    *,
    scale: float = 1.0,
    edits: Any = None,
    isolated: bool = True,
    **options: Any,
) -> WorldFile:
    """Read a world as `load_world` does, with the user's decisions about its robot."""
    path = find_world(name_or_path)
    check_scale(scale)
    # Decisions about a world file are in the file itself once they are saved.
    kept = path.suffix.lower() != ".toml" and edits_path(path).is_file()
    if not (kept if edits is None else edits):
        world = read_world("lrf3d.world.files:world_of_file", path, scale, isolated, options)
        return WorldFile(world, path=path)
    read_plan = function(by_name("decisions", "plan").read)
    plan = read_plan(path, edits, scale=scale, isolated=isolated, **options)
    with at(str(path)):
        file: WorldFile = plan.file(path)
        return file


def edits_path(path: Path) -> Path:
    """The file of the decisions about a drawing, next to it."""
    return path.with_name(f"{path.name}{by_name('decisions', 'plan').endings[0]}")


def read_world(reader: str, path: Path, scale: Any, isolated: bool, options: dict[str, Any]) -> Any:
    """Return what a reader returns for the file of a world.

    All functions that read worlds call this one, so a file needs only one process.
    """
    row = _row(path)
    given = {"scale": scale, **options_of(path, **options)}
    with reading(), at(str(path)):
        return read_file(reader, path, given, isolated=isolated and row.apart, error=WorldError)


def world_of_file(path: Path, scale: float, **options: Any) -> World:
    """Read the world of a file with the reader of its format."""
    planned = is_plan(path)
    scales = planned or _row(path).scales
    found = value_of_file(path, **({"scale": scale} if scales else {}), **options)
    # A plan, which is already scaled, becomes a world, and warns of what it leaves out.
    world: World = found.world(path) if planned else found
    expect(world, World, f"the reader of {path.suffix} files: what it returns")
    return world if scales else world.scaled(scale)


def value_of_file(path: Path, **options: Any) -> Any:
    """Read a file, which may be packed by gzip, with the reader of its format."""
    row = _row(path)
    with unpacked(path, row.largest) as plain:
        return function(row.read)(plain, **options)


def options_of(path: Path, **options: Any) -> dict[str, Any]:
    """The options that are given, checked to be options of the file's format."""
    # What is 0 is given, and refused by the reader.
    given = {
        name: value
        for name, value in options.items()
        if value is not None and value is not False and not (type(value) is tuple and not value)
    }
    check_names("load_world", given, [name for row in of_kind(*WORLDS) for name in row.options])
    for name in given:
        if name not in _row(path).options:
            fitting = ", ".join(endings(*WORLDS, option=name))
            raise WorldError(f"{path}: {name} is for {fitting} files alone")
    return given


def _row(path: Path) -> Format:
    """The format of the file of a world."""
    row = by_ending(path, *WORLDS)
    assert row is not None
    return row


def is_picture(path: str | Path) -> bool:
    """Whether a file is a bare picture of a floor plan, which needs a resolution."""
    return by_ending(Path(path), "picture") is not None


def is_plan(path: str | Path) -> bool:
    """Whether a file is a drawing or a picture, of which a plan is made."""
    return by_ending(Path(path), "picture", "drawing") is not None


def save_world(world: World, path: str | Path, *, resolution: float | None = None) -> None:
    """Write a world to a file in the format that its ending names.

    TOML and GeoJSON keep the world to the last bit; GLB keeps it in float32 about its ``origin``,
    and a ROS map (``.yaml`` and, next to it, ``.pgm``) to half a cell.

    Args:
        world: The world.
        path: The file; it ends in .toml, .geojson, .yaml or .glb.
        resolution: Side of a cell [m], for a ROS map alone; 0.05, or more for a large one.

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
    path = as_path(path)
    expect(world, World, "world")
    ending = path.suffix.lower()
    writers = {row.endings[0]: row.write for row in of_kind("world") if row.write}
    if ending not in writers:
        raise OutputError(f"{path}: unknown ending; a world is written as {', '.join(writers)}")
    options = {} if resolution is None else {"resolution": resolution}
    if options and not (
        ending == ".yaml" and 1.0 / LARGEST_CELL <= options["resolution"] <= LARGEST_CELL
    ):
        expected = "expected 0.0001 to 10000 m, for a ROS map (.yaml)"
        raise OutputError(f"{path}: resolution {resolution:g}: {expected}")
    function(writers[ending])(world, path, **options)


def world_names() -> list[str]:
    """Names of the built-in worlds, sorted.

    Examples:
        >>> import lrf3d
        >>> lrf3d.world_names()
        ['city', 'corridor', 'glass_office', 'mirror_hall', 'paper_room', 'warehouse']
    """
    return sorted(path.stem for path in data_folder("worlds").glob("*.toml"))


def find_world(name_or_path: str | Path) -> Path:
    """The file of a world, given by its name or its path, with a known ending.

    A built-in name comes before a file or a folder of that name, which is given as ``./city``.
    """
    names = world_names()
    if isinstance(name_or_path, str) and name_or_path in names:
        return data_folder("worlds") / f"{name_or_path}.toml"
    path = as_path(name_or_path)
    if by_ending(path, *WORLDS) is None:
        enter_installed()
    near = get_close_matches(path.stem, names, n=1)
    suggestion = f"; did you mean {near[0]!r}?" if near else ""
    if (row := by_ending(path, *WORLDS)) is not None:
        check_ordinary(
            path, what="a world file", largest=row.largest, missing=f"no such file{suggestion}",
            error=WorldError,
        )  # fmt: skip
        _check_looks(path, row)
        return path
    raise _not_a_world(path, name_or_path, suggestion)


def _check_looks(path: Path, row: Format | None) -> None:
    """Check that the first bytes of a file do not belong to another format than a row's."""
    found = by_looks(head_of(path))
    if found is None or found[0] is row or found[1] == "XML":
        return
    other, text = found
    if other.kind in WORLDS:
        text = f"{text}; name it {path.stem}{other.endings[0]}"
    raise WorldError(f"{path}: this is {text}")


def _not_a_world(path: Path, given: str | Path, suggestion: str) -> WorldError:
    """The error of what is neither a built-in world nor a file of one."""
    known = ", ".join(endings(*WORLDS))
    names = ", ".join(world_names())
    if path.is_dir() or path.suffix.lower() == ".npz":
        run = not path.is_dir() or (path / "run.npz").exists()
        what = "a run, for `lrf3d view` and others" if run else "a folder"
        return WorldError(f"{path}: {what}; expected a world: {names}, or a file ({known})")
    if path.is_file():
        _check_looks(path, None)
    if path.is_file() or path.suffix:
        logs = "; logs are read by `lrf3d slam` and `lrf3d map`" if ".log" in path.suffixes else ""
        return WorldError(f"{path}: unknown ending; worlds are read from {known}{logs}")
    worlds = f"built-in are {names}; or give a file ({known})"
    return WorldError(f"{given}: unknown world{suggestion}; {worlds}")
