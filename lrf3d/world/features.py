"""Features of maps, as GeoJSON and OpenStreetMap have them: outlines with a few properties."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.geometry import LARGEST_COORDINATE, Float, is_finite
from lrf3d.world.materials import Material, material_of
from lrf3d.world.schema import MOST_OBJECTS, parse_colour

LEVEL_HEIGHT = 3.0
"""Height of a storey [m], for buildings with only a number of levels."""

_METRES = re.compile(r"\s*(\d+(?:[.,]\d*)?|[.,]\d+)\s*(?:m|metres?|meters?)?\s*")
_FEET = re.compile(r"""\s*(\d+(?:\.\d+)?)\s*(?:ft|feet|')\s*(?:(\d+(?:\.\d+)?)\s*(?:in|"))?\s*""")
_FOOT, _INCH = 0.3048, 0.0254


@dataclass(frozen=True, slots=True)
class Feature:
    """A feature.

    Args:
        shapes: Its polygons and its lines, as shapely's.
        height: One height [m], one for each wall, or None if not given.
        number: The object it belongs to, or None.
    """

    shapes: tuple[Any, ...]
    height: float | tuple[float, ...] | None = None
    name: str = ""
    colour: tuple[float, float, float] | None = None
    number: int | None = None
    material: Material | None = None

    @property
    def looks(self) -> tuple[str, tuple[float, float, float] | None, Material | None]:
        """Its name, colour and material."""
        return self.name, self.colour, self.material

    @property
    def polygons(self) -> list[Any]:
        """Its polygons."""
        return [shape for shape in self.shapes if shape.geom_type == "Polygon"]

    @property
    def lines(self) -> list[Float]:
        """Lines (k, 2) [m]."""
        return [np.array(each.coords) for each in self.shapes if each.geom_type == "LineString"]

    def moved(self, move: Callable[[Float], Float]) -> "Feature":
        """The feature with all its points (k, 2) moved."""
        import shapely

        return replace(self, shapes=tuple(shapely.transform(s, move) for s in self.shapes))

    def height_or(self, default: float) -> float:
        """The one height [m] of a building."""
        height = max(self.height) if isinstance(self.height, tuple) else self.height
        return default if height is None else height


def feature_of(item: object) -> Feature:
    """The feature of a GeoJSON Feature, or of a bare geometry.

    Raises:
        WorldError: It is invalid.
    """
    if not isinstance(item, dict):
        raise WorldError(f"expected a Feature, found {shown(item)}")
    bare = item.get("type") != "Feature"
    geometry = item if bare else item.get("geometry")
    properties = {} if bare else item.get("properties") or {}
    if not isinstance(properties, dict):
        raise WorldError(f"expected an object of properties, found {shown(properties)}")
    number, name = properties.get("object"), properties.get("name")
    colours = (properties.get(key) for key in ("colour", "building:colour", "color"))
    return Feature(
        tuple(_shapes(geometry)),
        _height(properties),
        name if isinstance(name, str) else "",
        next(filter(None, map(parse_colour, colours)), None),
        number if type(number) is int and 0 <= number <= MOST_OBJECTS else None,
        material_of(properties.get("material", properties.get("building:material"))),
    )


def _shapes(geometry: Any) -> Iterator[Any]:
    """The polygons and lines of a geometry, checked; points, such as trees, are left out."""
    import shapely
    from shapely.geometry import shape

    if geometry is None:
        return
    if not isinstance(geometry, dict) or "type" not in geometry:
        raise WorldError(f"unknown geometry {shown(geometry)}, expected that of GeoJSON")
    kind = str(geometry["type"])[:40]
    try:
        whole = shape(_flat(geometry))
    except Exception as error:
        # shapely's exceptions depend on what is wrong with the geometry.
        raise WorldError(f"{kind}: {' '.join(str(error).split())}; expected [x, y], …") from None
    if not (np.abs(shapely.get_coordinates(whole)) <= LARGEST_COORDINATE).all():
        raise WorldError(f"{kind}: expected finite coordinates of at most {LARGEST_COORDINATE:g} m")
    # A collection may hold several polygons in one.
    parts = shapely.get_parts(shapely.get_parts([whole]))
    for part in parts[~shapely.is_empty(parts)]:
        if part.geom_type == "LineString":
            points = shapely.get_coordinates(part)
            moves = np.append(True, (points[1:] != points[:-1]).any(axis=1))
            if moves.sum() < 2:
                raise WorldError(f"{kind} of no length: expected two different points")
            yield shapely.LineString(points[moves])
        elif part.geom_type == "Polygon":
            if not shapely.make_valid(part).area > 0.0:
                raise WorldError(f"{kind}: lies on one line and encloses nothing")
            yield shapely.remove_repeated_points(part)


def _flat(value: Any) -> Any:
    """A geometry without heights, which some positions of a line may lack."""
    if isinstance(value, dict):
        return {key: _flat(each) for key, each in value.items()}
    if not isinstance(value, list):
        return value
    nested = not value or isinstance(value[0], list | dict)
    return [_flat(each) for each in value] if nested else value[:2]


def _height(properties: dict[str, Any]) -> float | tuple[float, ...] | None:
    """The height [m] from the properties height or building:levels; 0 means unknown."""
    given = properties.get("height")
    if isinstance(given, list) and given:
        return tuple(_number(value, "height") for value in given)
    if given is not None and (height := _number(given, "height")):
        return height
    for key in ("building:levels", "levels"):
        if properties.get(key) is not None:
            return LEVEL_HEIGHT * _number(properties[key], key) or None
    return None


def _number(value: object, key: str) -> float:
    metres: Any = metres_of(value) if isinstance(value, str) else value
    if type(metres) in (int, float) and is_finite(metres) and 0.0 <= metres <= LARGEST_COORDINATE:
        return float(metres)
    raise WorldError(f'{key} is {shown(value)}, expected metres such as 12.5 or "12.5 m"')


def metres_of(text: str) -> float | None:
    """A length [m] from a text such as 12, 12,5 m or 40'; None if it is invalid."""
    if match := _METRES.fullmatch(text):
        return float(match.group(1).replace(",", "."))
    if match := _FEET.fullmatch(text):
        return _FOOT * float(match.group(1)) + _INCH * float(match.group(2) or 0.0)
    return None
