"""Worlds from GeoJSON: footprints of buildings become blocks, lines become walls.

A path enters, a :class:`World` leaves. Coordinates are metres and are kept as they are, also far
from the origin; a file in longitude and latitude, which GeoJSON proper is in, is recognised by
its ``crs`` or by its size and laid flat about its middle. Heights above ground (Z) are ignored.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float, Int
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.dissolve import STRAIGHT, Block, Footprint, dissolve
from lrf3d.world.geographic import centre_of, lay_flat, looks_geographic
from lrf3d.world.geojson_features import Feature, features_of
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import walls
from lrf3d.world.schema import Invalid, place
from lrf3d.world.text_file import read_text

DEFAULT_BUILDING_HEIGHT = 8.0
"""Height of a building [m] that the file says nothing of: two storeys and a roof."""


def read_geojson(path: Path, *, simplify: float = STRAIGHT) -> World:
    """Read a world: Polygons are dissolved into blocks, each an object; lines follow after them.

    A wall of a block is as high as the footprint that it belongs to. Each feature of lines is an
    object, or what its whole-number property ``object`` says where all have one.

    Args:
        path: The file.
        simplify: Farthest that a corner may lie off a straight façade and be left out [m].

    Raises:
        WorldError: The file cannot be read, or holds no walls or broken ones; the message names
            the file and the feature, counted from 0.
    """
    data = _parse(path)
    features = features_of(data, path)
    outlines = [part for feature in features for part in (*feature.rings, *feature.lines)]
    if not outlines:
        raise WorldError(f"{path}: holds no Polygon and no LineString, so there is no wall")
    if _is_geographic(data, outlines):
        centre = centre_of(outlines)
        features = [feature.moved(lambda points: lay_flat(points, centre)) for feature in features]
    name = data.get("name")
    try:
        world = _world(features, name if isinstance(name, str) else path.stem, simplify)
        return replace(world, cameras=_cameras(data.get("cameras", [])))
    except WorldError as error:
        raise WorldError(f"{path}: {error}") from None


def _parse(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(read_text(path), parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise WorldError(
            f"{path}:{error.lineno}: not JSON: {error.msg} at column {error.colno}"
        ) from None
    except RecursionError:
        raise WorldError(f"{path}: nested too deeply for a world file") from None
    except ValueError as error:
        raise WorldError(f"{path}: not JSON: {error}") from None
    if not isinstance(data, dict):
        raise WorldError(f"{path}: expected a GeoJSON object, found a JSON {type(data).__name__}")
    return data


def _cameras(members: object) -> tuple[FixedCamera, ...]:
    """The cameras that ``World.save`` wrote."""
    try:
        return tuple(
            FixedCamera(
                str(member["name"]),
                place()(member["position"]),  # type: ignore[arg-type]
                place()(member["target"]),  # type: ignore[arg-type]
                float(member["field_deg"]),
            )
            for member in members  # type: ignore[attr-defined]
        )
    except (KeyError, TypeError, ValueError, Invalid) as error:
        raise WorldError(
            f"cameras: expected a list of name, position, target and field_deg ({error})"
        ) from None


def _refuse_constant(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number; expected finite ones")


def _is_geographic(data: dict[str, Any], outlines: list[Float]) -> bool:
    if data.get("units") == "m":
        return False
    reference = data.get("crs")
    if reference is None:
        return looks_geographic(outlines)
    return any(name in json.dumps(reference) for name in ("CRS84", "EPSG::4326", "EPSG:4326"))


def _world(features: list[Feature], name: str, simplify: float) -> World:
    builder = _Builder()
    owners = [feature for feature in features for _ in feature.polygons]
    footprints = [
        Footprint(rings, feature.height_or(DEFAULT_BUILDING_HEIGHT))
        for feature in features
        for rings in feature.polygons
    ]
    for block in dissolve(footprints, simplify=simplify):
        builder.add_block(block, [owners[index] for index in block.footprints])
    line_features = [feature for feature in features if not feature.polygons]
    numbered = not owners and all(feature.number is not None for feature in line_features)
    for feature in features:
        if feature.lines or (numbered and feature.number is not None):
            builder.add_lines(feature, feature.number if numbered else None)
    return builder.world(name)


class _Builder:
    """Gathers walls, object by object."""

    def __init__(self) -> None:
        self.segments: list[Float] = []
        self.heights: list[Float] = []
        self.objects: list[Int] = []
        self.names: dict[int, str] = {}
        self.colours: dict[int, tuple[float, float, float]] = {}
        self.next = 0

    def add_block(self, block: Block, owners: list[Feature]) -> None:
        """Add a block, called and coloured as the first of its footprints that tells."""
        for ring, heights in zip(block.rings, block.heights, strict=True):
            self._add(walls(ring, closed=True), heights, self.next)
        for owner in reversed(owners):
            self._describe(owner, self.next)
        self.next += 1

    def add_lines(self, feature: Feature, number: int | None) -> None:
        """Add the lines of a feature as an object of a number, or of the next one."""
        number = self.next if number is None else number
        segments = [walls(line, closed=False) for line in feature.lines]
        if segments:
            lines = np.concatenate(segments)
            self._add(lines, feature.wall_heights(len(lines), DEFAULT_HEIGHT), number)
        self._describe(feature, number)
        self.next = number + 1

    def _add(self, segments: Float, heights: Float, number: int) -> None:
        self.segments.append(segments)
        self.heights.append(heights)
        self.objects.append(np.full(len(segments), number, dtype=np.int64))

    def _describe(self, feature: Feature, number: int) -> None:
        if feature.name:
            self.names[number] = feature.name
        if feature.colour:
            self.colours[number] = feature.colour

    def world(self, name: str) -> World:
        """The world of all that was added."""
        if not self.segments:
            raise WorldError("the footprints are too small to leave a wall")
        objects = np.concatenate(self.objects)
        count = int(objects.max()) + 1
        colours = np.full((count, 3), np.nan)
        for number, colour in self.colours.items():
            if number < count:
                colours[number] = colour
        return World(
            np.concatenate(self.segments),
            objects,
            np.concatenate(self.heights),
            name,
            object_names=tuple(self.names.get(number, "") for number in range(count))
            if self.names
            else (),
            colours=colours,
        )
