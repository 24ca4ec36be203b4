"""The table of formats: every kind of file that is read or written, one row each.

A row names the function that reads or writes as ``module:function``, so that the libraries of a
format are loaded when a file of it is met. The messages on unknown endings and on files of the
wrong kind, and the lists on help pages, come from these rows. To add a format, write its function
and enter its row; of rows with the same ending the last one counts.
"""

import gzip
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lrf3d.base.errors import WorldError, storage
from lrf3d.base.files import opened

# First bytes of packed files.
GZIP = b"\x1f\x8b"

# Number of first bytes of a file that identify its format.
HEAD = 1 << 11

# First bytes of the files of bags: MCAP, SQLite, those of ROS 1, and files packed by Zstandard.
MCAP = b"\x89MCAP0\r\n"
SQLITE = b"SQLite format 3\0"
ROS_1 = b"#ROSBAG V2.0\n"
ROS_1_OLD = b"#ROSBAG V1.2\n"
ZSTD = b"(\xb5/\xfd"


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A kind of file.

    Args:
        kind: Its content: ``world``, ``drawing``, ``picture``, ``log``, ``map``, ``trajectory``,
            ``film``, ``frame``; ``export`` for other programs; ``other`` for anything else.
        name: Its name in options and programs, if the ending does not identify it.
        endings: Endings of its files, in lower case; files are written with the first one.
        looks: First bytes of its files after blanks, or an XML tag among the first bytes, and a
            description of such a file for messages.
        read: The function that reads a path, or its module and name as ``module:function``.
        write: The function that writes a value to a path, likewise.
        largest: Largest file that is read [bytes].
        options: Options of the function that reads it, or else of the one that writes it.
        extra: The extra of lrf3d that it needs.
        scales: Whether the function that reads a world takes its scale.
        apart: Whether its files are read in a process of their own, which knows only the rows of
            this table.
    """

    kind: str
    name: str = ""
    endings: tuple[str, ...] = ()
    looks: Mapping[bytes, str] = field(default_factory=dict)
    read: str | Callable[..., Any] = ""
    write: str | Callable[..., Any] = ""
    largest: int = 1 << 28
    options: tuple[str, ...] = ()
    extra: str = ""
    scales: bool = False
    apart: bool = False


_PLAN = "lrf3d.plans.reading:plan_of_file"
_FILM = "lrf3d.studio.render.video:render_video"
_CLOUD = "a point cloud without scans"
_CITY = "CityGML: make a mesh of it, as by citygml4j and `cjio FILE export obj city.obj`"
_TABLE = "a table in {}: save it as CSV or .npz, as by pandas or NumPy"
_PAGE = "a web page: download the file itself"
_PBF = "OpenStreetMap in PBF: make XML of it, as by `osmium cat FILE -o town.osm`"

# All formats; the order is that of lists in messages.
FORMATS: list[Format] = [
    Format(
        kind="world", endings=(".toml",), read="lrf3d.simulation.tables:read_toml",
        write="lrf3d.world.toml_file:write_toml",
    ),
    Format(
        kind="world", endings=(".geojson", ".geojsonl", ".geojsonseq"),
        read="lrf3d.world.towns.geojson:read_geojson", options=("level",),
        write="lrf3d.world.towns.geojson:write_geojson", apart=True,
    ),
    # GeoJSON, or what Overpass answers.
    Format(
        kind="world", endings=(".json",), read="lrf3d.world.towns.geojson:read_geojson",
        options=("trees", "level"), apart=True,
    ),
    Format(
        kind="world", endings=(".osm",), read="lrf3d.world.towns.osm:read_osm",
        looks={b"<osm": "an OpenStreetMap extract"},
        options=("trees", "level"), apart=True,
    ),
    Format(
        kind="world", endings=(".sdf", ".world"), read="lrf3d.world.sdf:read_sdf",
        looks={b"<sdf": "a world in SDF"}, largest=1 << 26, options=("cut",), apart=True,
    ),
    Format(
        kind="world", endings=(".yaml", ".yml"), read="lrf3d.world.ros_map:read_ros_map",
        write="lrf3d.world.ros_map:write_ros_map", largest=1 << 16, apart=True,
    ),
    Format(
        kind="picture", endings=(".png", ".pgm", ".jpg", ".jpeg", ".bmp"), read=_PLAN,
        looks={b"\x89PNG": "a picture"}, options=("resolution", "threshold"), apart=True,
    ),
    Format(
        kind="drawing", endings=(".dxf",), read=_PLAN, largest=1 << 26,
        looks=dict.fromkeys(
            (b"AutoCAD Binary DXF", b"0\nSECTION", b"0\r\nSECTION"), "a DXF drawing"
        ),
        options=("layers", "without"), apart=True,
    ),
    Format(
        kind="drawing", endings=(".svg",), read=_PLAN, largest=1 << 26,
        looks={b"<svg": "an SVG drawing"}, options=("layers", "without"), apart=True,
    ),
    Format(
        kind="drawing", endings=(".pdf",), read=_PLAN, largest=1 << 26,
        looks={b"%PDF": "a document"}, options=("threshold", "page", "layers", "without"),
        extra="pdf", apart=True,
    ),
    Format(
        kind="world", endings=(".glb", ".gltf", ".obj", ".off", ".ply", ".stl"), largest=1 << 27,
        read="lrf3d.world.mesh:read_mesh", write="lrf3d.world.mesh:write_glb",
        looks={b"ply": _CLOUD}, options=("cut",), scales=True, apart=True,
    ),
    # The last two endings of CARMEN logs are what the University of Freiburg calls them.
    Format(
        kind="log", name="CARMEN", endings=(".log", ".log.gz", ".clf", ".clf.gz"),
        read="lrf3d.recordings.formats.carmen:load_carmen", options=("poses",),
        write="lrf3d.recordings.formats.carmen_writer:write_log", apart=True,
    ),
    Format(
        kind="log", name="bag", endings=(".mcap", ".db3", ".bag"),
        looks=dict.fromkeys((MCAP, SQLITE, ROS_1, ROS_1_OLD, ZSTD), "a ROS bag"),
        read="lrf3d.recordings.formats.bags.reader:load_bag",
        options=("poses", "scan_topic", "part", "height"), extra="ros", apart=True,
    ),
    Format(
        kind="log", name="arrays", endings=(".npz", ".npy", ".mat"),
        read="lrf3d.recordings.formats.arrays:array_table",
        looks={
            b"PK": "a zip: unpack it; save a spreadsheet as CSV; name arrays of NumPy .npz",
            b"\x93NUMPY": "an array: name it .npy",
            b"MATLAB 5": "a .mat file: name it .mat",
        },
        options=("format",), apart=True,
    ),
    Format(
        kind="log", name="run", endings=(".npz",), read="lrf3d.recordings.reading:run_log",
        options=("poses",), apart=True,
        write="lrf3d.recordings.formats.run_file:save_run",
    ),
    Format(
        kind="log", name="messages", read="lrf3d.recordings.formats.bags.reader:load_bag",
        options=("poses", "scan_topic", "part", "height"),
    ),
    Format(
        kind="log", name="records", read="lrf3d.recordings.formats.arrays:record_table",
        options=("format",),
    ),
    Format(
        kind="log", name="text", read="lrf3d.recordings.formats.text.text_log:text_table",
        options=("format",),
    ),
    Format(
        kind="map", endings=(".geojson",), read="lrf3d.mapping.line_map:load_map",
        write="lrf3d.mapping.line_map:save_map",
    ),
    Format(
        kind="trajectory", endings=(".tum",), read="lrf3d.recordings.formats.trajectory:load_tum",
        write="lrf3d.recordings.formats.trajectory:save_tum",
    ),
    Format(kind="film", endings=(".mp4",), write=_FILM),
    Format(kind="film", endings=(".webp",), write=_FILM),
    Format(kind="film", endings=(".gif",), write=_FILM),
    Format(kind="frame", endings=(".png",), write="lrf3d.studio.render.video:save_png"),
    Format(
        kind="export", name="carmen", endings=(".log.gz", ".log"),
        write="lrf3d.recordings.formats.carmen_writer:write_carmen",
    ),
    Format(
        kind="export", name="mcap", endings=(".mcap",), extra="ros",
        write="lrf3d.recordings.formats.bags.writer:write",
    ),
    Format(
        kind="export", name="rosbag2", endings=("",), extra="ros",
        write="lrf3d.recordings.formats.bags.writer:write_folder",
    ),
    Format(
        kind="export", name="ply", endings=(".ply",),
        write="lrf3d.recordings.formats.cloud_files:write_ply",
    ),
    Format(
        kind="export", name="pcd", endings=(".pcd",),
        write="lrf3d.recordings.formats.cloud_files:write_pcd",
    ),
    Format(
        kind="export", name="las", endings=(".las",), extra="las",
        write="lrf3d.recordings.formats.cloud_files:write_las",
    ),
    Format(
        kind="export", name="kitti", endings=("",),
        write="lrf3d.recordings.formats.cloud_files:write_kitti",
    ),
    Format(
        kind="export", name="npz", endings=(".npz",),
        write="lrf3d.recordings.formats.cloud_files:write_arrays",
    ),
    Format(
        kind="export", name="glb", endings=(".glb",), write="lrf3d.studio.gltf:run_glb",
        options=("every",),
    ),
    Format(
        kind="export", name="html", endings=(".html",), options=("every",),
        write="lrf3d.studio.page.page_file:page_file",
    ),
    Format(
        kind="decisions", name="plan", endings=(".edit.toml",),
        read="lrf3d.plans.reading:read_plan",
    ),
    Format(
        kind="other",
        looks={
            b"\xff\xfe": "text in UTF-16: save it as UTF-8", b"LASF": _CLOUD, b"# .PCD": _CLOUD,
            b"<": "XML",
            b"AC10": "a DWG drawing: save it as DXF, as by LibreDWG's `dwg2dxf`",
            b"ISO-10303-21": "an IFC model: make a mesh of it, as by `IfcConvert FILE model.glb`",
            b"<COLLADA": "a COLLADA model: save it as .glb, as by Blender",
            b"<kml": "KML: make GeoJSON of it, as by `ogr2ogr town.geojson FILE`",
            b"<core:CityModel": _CITY, b"<CityModel": _CITY,
            b"<html": _PAGE, b"<!DOCTYPE html": _PAGE,
            b"version https://git-lfs": "a pointer of Git LFS: fetch the file by `git lfs pull`",
            b"\0\0\0\r\n\tOSMHeader": _PBF, b"\0\0\0\x0e\n\tOSMHeader": _PBF,
            b"PAR1": _TABLE.format("Parquet"), b"ARROW1": _TABLE.format("Feather"),
            b"\x89HDF": _TABLE.format("HDF5"),
            b"BZh": "packed by bzip2: unpack it first",
            b"\xfd7zXZ": "packed by xz: unpack it first",
        },
    ),
]  # fmt: skip

# Kinds of files that a world is read from; of the last two a plan is made first.
WORLDS = ("world", "picture", "drawing")


def of_kind(*kinds: str) -> list[Format]:
    """The formats of some kinds."""
    return [each for each in FORMATS if each.kind in kinds]


def endings(*kinds: str, option: str = "", written: bool = False) -> tuple[str, ...]:
    """The endings of files of some kinds: those for which an option is, or those written."""
    found = [each for each in of_kind(*kinds) if not option or option in each.options]
    if written:
        return tuple(each.endings[0] for each in found if each.write)
    return tuple(dict.fromkeys(ending for each in found for ending in each.endings))


def by_name(kind: str, name: str) -> Format:
    """The format of a kind with a name."""
    return next(each for each in of_kind(kind) if each.name == name)


def by_ending(path: Path, *kinds: str) -> Format | None:
    """The format of some kinds that the ending of a file names; the one entered last."""
    name = path.name.lower()
    # Other formats than those of logs may be packed, too.
    for known in (name, _plain_name(name)):
        if found := [each for each in of_kind(*kinds) if known.endswith(each.endings)]:
            return found[-1]
    return None


def _plain_name(name: str) -> str:
    """The name of a packed file once it is unpacked."""
    return name[:-1] if name.endswith(".svgz") else name.removesuffix(".gz")


@contextmanager
def unpacked(path: Path, largest: int) -> Iterator[Path]:
    """Yield the path of a file, or of an unpacked copy of a gzip file, under its plain name."""
    with open(path, "rb") as file:
        packed = file.read(2) == GZIP
    if not packed:
        yield path
        return
    with TemporaryDirectory() as folder, gzip.open(path) as unpacking:
        copy = Path(folder) / _plain_name(path.name.lower())
        copy.write_bytes(unpacking.read(largest + 1))
        if copy.stat().st_size > largest:
            raise WorldError(f"unpacks to more than {storage(largest)}; cut it down")
        yield copy


def head_of(path: Path, most: int = HEAD, what: str = "a file") -> bytes:
    """The first bytes of a regular file, at most so many, unpacked if gzip packed it."""
    with opened(path, what=what) as file:
        head = file.read(most)
    if head.startswith(GZIP):
        with suppress(zlib.error):
            return zlib.decompressobj(31).decompress(head, most)
    return head


def by_looks(head: bytes) -> tuple[Format, str] | None:
    """The format of a file that begins with these bytes, and what to say of it."""
    plain = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    looks = [
        (len(magic), row, text)
        for row in FORMATS
        for magic, text in row.looks.items()
        if plain.startswith(magic) or (magic[:1] == b"<" and plain[:1] == b"<" and magic in plain)
    ]
    # The longest match is the most specific; a tag is more specific than XML's own first bytes.
    _, row, text = max(looks, key=lambda each: each[0], default=(0, None, ""))
    return None if row is None else (row, text)


def function(target: str | Callable[..., Any]) -> Callable[..., Any]:
    """The function of a row; its module loads the libraries of that format alone."""
    if not isinstance(target, str):
        return target
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)  # type: ignore[no-any-return]


@lru_cache(1)
def enter_installed() -> None:
    """Enter the readers of worlds of installed packages, once.

    They are entry points of the group ``lrf3d.world.readers``, whose names are endings.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group="lrf3d.world.readers"):
        if entry.name not in endings(*WORLDS):
            FORMATS.append(Format(kind="world", endings=(entry.name,), read=entry.value))
