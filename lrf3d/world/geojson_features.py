"""The features of a GeoJSON file, checked: outlines as arrays, and known properties."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.geometry import Float, is_finite
from lrf3d.world.materials import Material, material_of
from lrf3d.world.model import MOST_OBJECTS
from lrf3d.world.schema import LARGEST_COORDINATE, parse_colour

LEVEL_HEIGHT = 3.0
"""Height of a storey [m], for buildings with only a number of levels."""

_METRES = re.compile(r"\s*(\d+(?:[.,]\d*)?|[.,]\d+)\s*(?:m|metres?|meters?)?\s*")
_FEET = re.compile(r"""\s*(\d+(?:\.\d+)?)\s*(?:ft|feet|')\s*(?:(\d+(?:\.\d+)?)\s*(?:in|"))?\s*""")
_FOOT, _INCH = 0.3048, 0.0254


@dataclass(frozen=True, slots=True)
class Feature:
    """A feature.

    Args:
        polygons: Each a tuple of rings (k, 2), the outer one first, no point repeated.
        lines: Lines (k, 2) of at least two points, none repeated in a row.
        height: One height [m], one for each wall, or None if not given.
        name: Its name, or an empty text.
        colour: Its colour, or None.
        number: The object it belongs to, or None.
        material: Its material, or None.
    """

    polygons: tuple[tuple[Float, ...], ...]
    lines: tuple[Float, ...]
    height: float | tuple[float, ...] | None
    name: str
    colour: tuple[float, float, float] | None
    number: int | None
    material: Material | None = None

    @property
    def rings(self) -> list[Float]:
        """The rings of all polygons."""
        return [ring for polygon in self.polygons for ring in polygon]

    def moved(self, move: Callable[[Float], Float]) -> "Feature":
        """The feature with all its points (k, 2) moved."""
        polygons = tuple(tuple(move(ring) for ring in polygon) for polygon in self.polygons)
        return replace(self, polygons=polygons, lines=tuple(move(line) for line in self.lines))

    def height_or(self, default: float) -> float:
        """The one height [m] of a building."""
        height = max(self.height) if isinstance(self.height, tuple) else self.height
        return default if height is None else height

    def wall_heights(self, count: int, default: float) -> Float:
        """The heights (count,) [m] of the walls along the lines."""
        if isinstance(self.height, tuple) and len(self.height) == count:
            return np.array(self.height)
        return np.full(count, self.height_or(default))


def features_of(data: dict[str, Any], path: Path) -> list[Feature]:
    """The features of a GeoJSON object: a FeatureCollection, a Feature or a bare geometry.

    Raises:
        WorldError: A feature is invalid; the message names the file and the feature.
    """
    kind = data.get("type")
    items: Any = data.get("features") if kind == "FeatureCollection" else [data]
    if not isinstance(items, list):
        raise WorldError(f"{path}: FeatureCollection without a list of features")
    return [_Reader(path, index).feature(item) for index, item in enumerate(items)]


@dataclass(frozen=True, slots=True)
class _Reader:
    """Reads one feature of a file."""

    path: Path
    index: int

    def refuse(self, message: str) -> NoReturn:
        raise WorldError(f"{self.path}: feature {self.index}: {message}")

    def feature(self, item: object) -> Feature:
        if not isinstance(item, dict):
            self.refuse(f"expected a Feature, found {shown(item)}")
        bare = item.get("type") != "Feature"
        geometry = item if bare else item.get("geometry")
        properties = {} if bare else item.get("properties") or {}
        if not isinstance(properties, dict):
            self.refuse(f"expected an object of properties, found {shown(properties)}")
        outlines = list(self.outlines(geometry))
        number = properties.get("object")
        name = properties.get("name")
        colours = (properties.get(key) for key in ("colour", "building:colour", "color"))
        return Feature(
            polygons=tuple(rings for rings, closed in outlines if closed),
            lines=tuple(rings[0] for rings, closed in outlines if not closed),
            height=self.height(properties),
            name=name if isinstance(name, str) else "",
            colour=next(filter(None, map(parse_colour, colours)), None),
            number=number if type(number) is int and 0 <= number <= MOST_OBJECTS else None,
            material=self.material(properties),
        )

    def material(self, properties: dict[str, Any]) -> Material | None:
        """The material from the properties material or building:material."""
        try:
            return material_of(properties.get("material", properties.get("building:material")))
        except WorldError as error:
            self.refuse(str(error))

    def outlines(self, geometry: object) -> Iterator[tuple[tuple[Float, ...], bool]]:
        """The polygons and lines of a geometry: rings, and whether they are a polygon's."""
        if geometry is None:
            return
        if not isinstance(geometry, dict):
            self.refuse(f"expected a geometry, found {shown(geometry)}")
        kind = geometry.get("type")
        key = "geometries" if kind == "GeometryCollection" else "coordinates"
        parts = geometry.get(key)
        if not isinstance(parts, list):
            self.refuse(f"expected a GeoJSON geometry with {key}, found type {shown(kind)}")
        match kind:
            case "Polygon" | "LineString" if not parts:
                # An empty geometry counts as null (RFC 7946, section 3.1).
                pass
            case "Polygon":
                yield self.polygon(parts), True
            case "MultiPolygon":
                for part in parts:
                    yield self.polygon(part), True
            case "LineString":
                yield (self.line(parts),), False
            case "MultiLineString":
                for part in parts:
                    yield (self.line(part),), False
            case "GeometryCollection":
                for part in parts:
                    yield from self.outlines(part)
            case "Point" | "MultiPoint":
                # Points, such as trees and lamps, are not walls.
                pass
            case _:
                self.refuse(f"unknown geometry {shown(kind)}")

    def polygon(self, rings: object) -> tuple[Float, ...]:
        if not isinstance(rings, list) or not rings:
            self.refuse(f"Polygon without rings: {shown(rings)}")
        return tuple(self.ring(ring, index) for index, ring in enumerate(rings))

    def ring(self, points: object, index: int) -> Float:
        ring = self.points(points, f"Polygon ring {index}")
        ring = _without_repeats(ring, np.roll(ring, 1, axis=0))
        if len(ring) < 3:
            self.refuse(f"Polygon ring {index} has {len(ring)} different points, expected 3")
        arms = ring[1:] - ring[0]
        if not (arms[:, 0] * arms[-1, 1] != arms[:, 1] * arms[-1, 0]).any():
            self.refuse(f"Polygon ring {index} lies on one line and encloses nothing")
        return ring

    def line(self, points: object) -> Float:
        line = self.points(points, "LineString")
        line = _without_repeats(line, np.vstack([[np.inf, np.inf], line[:-1]]))
        if len(line) < 2:
            self.refuse("LineString of no length: expected two different points")
        return line

    def points(self, points: object, what: str) -> Float:
        """Points (k, 2), at least one, of a list of positions, Z dropped."""
        if not isinstance(points, list) or not points:
            self.refuse(f"{what}: expected a list of points, found {shown(points)}")
        for index, point in enumerate(points):
            if (
                not isinstance(point, list)
                or len(point) < 2
                or not all(type(value) in (int, float) for value in point[:2])
            ):
                self.refuse(f"{what}: point {index} is {shown(point)}, expected [x, y]")
            if not all(abs(value) <= LARGEST_COORDINATE for value in point[:2]):
                self.refuse(
                    f"{what}: point {index} is {shown(point)}, expected finite coordinates"
                    f" of at most {LARGEST_COORDINATE:g} m"
                )
        return np.array([point[:2] for point in points], dtype=np.float64)

    def height(self, properties: dict[str, Any]) -> float | tuple[float, ...] | None:
        """The height [m] from the properties height or building:levels; 0 means unknown."""
        given = properties.get("height")
        if isinstance(given, list) and given:
            return tuple(self.number(value, "height") for value in given)
        if given is not None and (height := self.number(given, "height")):
            return height
        for key in ("building:levels", "levels"):
            if properties.get(key) is not None:
                return LEVEL_HEIGHT * self.number(properties[key], key) or None
        return None

    def number(self, value: object, key: str) -> float:
        metres = metres_of(value) if isinstance(value, str) else value
        if type(metres) in (int, float):
            assert isinstance(metres, int | float)
            if is_finite(metres) and 0.0 <= metres <= LARGEST_COORDINATE:
                return float(metres)
        self.refuse(f'{key} is {shown(value)}, expected metres such as 12.5 or "12.5 m"')


def metres_of(text: str) -> float | None:
    """A length [m] from a text such as 12, 12,5 m or 40'; None if it is invalid."""
    if match := _METRES.fullmatch(text):
        return float(match.group(1).replace(",", "."))
    if match := _FEET.fullmatch(text):
        return _FOOT * float(match.group(1)) + _INCH * float(match.group(2) or 0.0)
    return None


def _without_repeats(points: Float, before: Float) -> Float:
    """The points (k, 2) that differ from those before them."""
    return np.asarray(points[(points != before).any(axis=1)], dtype=np.float64)
