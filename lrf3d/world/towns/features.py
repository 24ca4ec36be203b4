"""Features of maps, as GeoJSON and OpenStreetMap have them, and the worlds that they become.

Features in degrees are recognised, and laid flat in metres. Lines become walls. No beam can reach a
wall that two buildings share, and a straight façade of several is one segment to a laser:
footprints that touch are dissolved into blocks, with only their outer walls.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
import shapely
from shapely.geometry import shape

from lrf3d.base.balance import Balance
from lrf3d.base.errors import WorldError, shown
from lrf3d.base.text import counted
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, is_finite
from lrf3d.world.materials import Material, material_of
from lrf3d.world.model import DEFAULT_HEIGHT, DOOR, World
from lrf3d.world.pieces import (
    TOUCHING,
    Part,
    from_corner,
    groups,
    members_of,
    pairs_within,
    walls,
    world_of_parts,
)
from lrf3d.world.schema import MOST_OBJECTS, parse_colour
from lrf3d.world.towns.tags import (
    LEVEL_HEIGHT,
    left_out,
    metres_of,
    role_in_storey,
    storeys_of,
    tags_of,
)

# Default height of a building [m]: two storeys and a roof.
DEFAULT_BUILDING_HEIGHT = 8.0

# Widest gap [m] between footprints that touch, and largest distance between an opening and the wall
# that it opens: surveys leave hairline gaps.
CLOSING = 0.05

# Largest distance [m] from a straight façade of a corner that is left out.
STRAIGHT = 0.01

# A full turn, and the latitude of a pole [°].
TURN = 360
POLE = 90

# Mean radius of the Earth [m].
EARTH_RADIUS = 6_371_008.8


@dataclass(frozen=True, slots=True)
class Feature:
    """Polygons and lines (shapely's), with one height [m], one for each wall, or None."""

    shapes: tuple[Any, ...]
    height: float | tuple[float, ...] | None = None
    name: str = ""
    colour: tuple[float, float, float] | None = None
    number: int | None = None
    material: Material | None = None
    # Why it is left out.
    left_out: str = ""
    # What it is in a storey: a room, whose outline becomes walls, an opening, or a wall.
    role: str = ""
    # Its storeys; empty if it names none.
    levels: tuple[str, ...] = ()
    # Whether it says that it is a building.
    built: bool = False

    @property
    def lines(self) -> Float:
        """The walls (n, 4) along its lines."""
        lines = [each for each in self.shapes if each.geom_type == "LineString"]
        own = (walls(np.array(each.coords)) for each in lines)
        found = np.concatenate([np.empty((0, 4)), *own])
        # Ways name a point twice in a row, and rounding joins points.
        return np.asarray(found[(found[:, :2] != found[:, 2:]).any(axis=1)])

    def part(self, number: int, segments: Float, default: float) -> Part:
        """Walls of an object that look like the feature, with its height or the default."""
        height = default if self.height is None else self.height
        if isinstance(height, tuple) and len(height) != len(segments):
            height = max(height)
        return Part(number, segments, np.array(height), self.name, self.colour, self.material)


def shapes_of(features: Sequence[Feature]) -> list[Any]:
    """The shapes of all features."""
    return [shape for feature in features for shape in feature.shapes]


def moved(features: Sequence[Feature], move: Callable[[Float], Float]) -> list[Feature]:
    """Features with all their points (k, 2) moved."""
    rest = iter(shapely.transform(np.array(shapes_of(features), dtype=object), move))
    return [replace(f, shapes=tuple(islice(rest, len(f.shapes)))) for f in features]


def feature_of(item: object) -> Feature:
    """The feature of a GeoJSON Feature, or of a bare geometry."""
    if not isinstance(item, dict):
        raise WorldError(f"expected a Feature, found {shown(item)}")
    bare = item.get("type") != "Feature"
    properties = {} if bare else item.get("properties") or {}
    if not isinstance(properties, dict):
        raise WorldError(f"expected an object of properties, found {shown(properties)}")
    if isinstance(properties.get("tags"), dict):
        properties = {**properties["tags"], **properties}
    tags = tags_of({"feature_type": item.get("feature_type")} | properties)
    if reason := left_out(tags):
        return Feature((), left_out=reason)
    number = properties.get("object")
    name = properties.get("name")
    colours = (properties.get(key) for key in ("colour", "building:colour", "color"))
    geometry = item if bare else item.get("geometry")
    role = role_in_storey(tags)
    shapes = tuple(_shapes(geometry, points=role == "opening"))
    kind = geometry["type"] if geometry else "nothing"
    return Feature(
        shapes,
        _height(properties),
        name if isinstance(name, str) else "",
        next(filter(None, map(parse_colour, colours)), None),
        number if type(number) is int and 0 <= number <= MOST_OBJECTS else None,
        material_of(properties.get("material", properties.get("building:material"))),
        "" if shapes else f"feature without a wall: {str(kind)[:40]}",
        role,
        storeys_of(tags),
        bool({"building", "building:part"} & set(tags)),
    )


def with_rooms(
    features: Sequence[Feature], level: str | None, balance: Balance
) -> tuple[list[Feature], str]:
    """Features in metres with the walls of rooms on one storey, and what was assumed.

    The outlines of rooms become lines, shared ones only once, with gaps at openings. Without a
    level the storey is the ground floor, or that with most rooms.
    """
    counts = Counter(each for f in features if f.role == "room" for each in f.levels[:1])
    # The ground floor comes first, then the storeys with most rooms.
    storeys = sorted(counts, key=lambda each: (each != "0", -counts[each]))
    known = ", ".join(sorted(storeys)[:20])
    chosen = level or next(iter(storeys), "0")
    if level is not None and all(level not in f.levels for f in features):
        raise WorldError(f"has no level {shown(level)}; levels: {known or 'none'}")
    here = list[Feature]()
    for feature in features:
        # Buildings also name a level, that of their entrance.
        named = feature.levels if feature.role or level else ()
        if named and chosen not in named:
            balance.used -= 1
            balance.leave(f"feature of another level: {', '.join(named[:3])}")
        else:
            here.append(feature)
    rooms = [f for f in here if f.role == "room"]
    openings = [f for f in here if f.role == "opening"]
    found = [f for f in here if f.role in ("", "wall")]
    if not rooms:
        balance.used -= len(openings)
        balance.leave("opening without a room", len(openings))
        return found, ""
    read = [f"level {chosen} of {known} is read; --level chooses"][: len(storeys) - 1]
    said = "; ".join([counted(len(rooms), "indoor room"), *read])
    return found + _walls_of_rooms(rooms, openings), said


def _walls_of_rooms(rooms: list[Feature], openings: list[Feature]) -> list[Feature]:
    """The walls of rooms that touch, as one feature each."""
    # A line without area may be a wall that divides a room.
    areas = shapely.make_valid(np.array(shapes_of(rooms), dtype=object))
    outlines = [each.boundary if each.area else each for each in areas]
    lines = shapely.union_all(outlines, grid_size=TOUCHING)
    open_ = [
        each.buffer(0.5 * DOOR)
        if each.geom_type == "Point"
        else each.buffer(CLOSING, cap_style="flat")
        for each in shapes_of(openings)
    ]
    lines = shapely.line_merge(lines.difference(shapely.union_all(open_)))
    houses = shapely.get_parts(shapely.union_all(shapely.buffer(areas, TOUCHING)))
    parts = shapely.get_parts(lines)
    house, line = shapely.STRtree(parts).query(houses, predicate="intersects")
    height = next((room.height for room in rooms if room.height), DEFAULT_HEIGHT)
    return [
        Feature(tuple(parts[np.unique(line[house == number])]), height)
        for number in np.unique(house)
    ]


def _shapes(geometry: Any, points: bool = False) -> Iterator[Any]:
    """The polygons and lines of a geometry, checked; points are left out unless asked for."""
    if geometry is None:
        return
    if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
        raise WorldError(f"unknown geometry {shown(geometry)}, expected that of GeoJSON")
    kind = geometry["type"][:40]
    try:
        whole = shape(_flat(geometry))
    except Exception as error:
        # shapely's exceptions depend on what is wrong with the geometry.
        raise WorldError(f"{kind}: {' '.join(str(error).split())}; expected [x, y], …") from None
    if not (np.abs(shapely.get_coordinates(whole)) <= LARGEST_COORDINATE).all():
        raise WorldError(f"{kind}: expected finite coordinates of at most {LARGEST_COORDINATE:g} m")
    # A collection may hold several polygons in one.
    for part in shapely.get_parts(shapely.get_parts([whole])):
        if points and part.geom_type == "Point" and not part.is_empty:
            yield part
        if part.geom_type in ("LineString", "Polygon") and not part.is_empty:
            if part.geom_type == "Polygon" and not encloses(part):
                raise WorldError(f"{kind}: lies on one line and encloses nothing")
            if not part.length > 0.0:
                raise WorldError(f"{kind} of no length: expected two different points")
            yield shapely.remove_repeated_points(part)


def encloses(polygon: Any) -> bool:
    """Whether a polygon encloses anything."""
    valid = polygon if shapely.is_valid(polygon) else shapely.make_valid(polygon)
    return bool(valid.area > 0.0)


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
    for key, scale in (
        ("height", 1.0), ("building:levels", LEVEL_HEIGHT), ("levels", LEVEL_HEIGHT),
    ):  # fmt: skip
        if properties.get(key) is not None:
            known = scale * _number(properties[key], key)
            if known or key != "height":
                return known or None
    return None


def _number(value: object, key: str) -> float:
    metres: Any = metres_of(value) if isinstance(value, str) else value
    if type(metres) in (int, float) and is_finite(metres) and 0.0 <= metres <= LARGEST_COORDINATE:
        return float(metres)
    raise WorldError(f'{key} is {shown(value)}, expected metres such as 12.5 or "12.5 m"')


def joined_areas(features: Sequence[Feature]) -> str:
    """A note on areas that do not say that they are buildings, and lose the walls between them."""
    plain = [f for f in features if not (f.built or f.role)]
    polygons = [each for each in shapes_of(plain) if each.geom_type == "Polygon"]
    areas = np.array(polygons, dtype=object)
    areas = areas[shapely.is_valid(areas)]
    one, other = shapely.STRtree(areas).query(areas, predicate="touches")
    long = shapely.length(shapely.intersection(areas[one], areas[other])) > 0.0
    count = len(np.unique(one[long]))
    joined = f"{counted(count, 'area')} that touch become one block without walls between"
    return f"{joined}: rooms need the property indoor=room" if count else ""


def looks_geographic(features: Sequence[Feature]) -> bool:
    """Whether the coordinates of features are in degrees and not in metres."""
    shapes = shapes_of(features)
    points = shapely.get_coordinates(shapes)
    boxes = shapely.bounds(shapes)
    if (np.abs(points) > [0.5 * TURN, POLE]).any():
        return False
    sizes = np.abs(_from(boxes[:, 2:], boxes[:, :2])).max(axis=1)
    widest = np.ptp(_from(points, points[0]), axis=0).max()
    # In metres the whole would be half a pace wide, and half of the outlines less than a finger.
    return bool(widest <= 0.5 and np.median(sizes) < 0.01)


def laid_flat(features: Sequence[Feature]) -> tuple[list[Feature], Float, float]:
    """Features in degrees laid flat around their middle (2,) [°], and their largest extent [°]."""
    points = shapely.get_coordinates(shapes_of(features))
    local = _from(points, points[0])
    low = local.min(axis=0)
    high = local.max(axis=0)
    longitude, latitude = points[0] + 0.5 * (low + high)
    centre = np.array([(longitude + 0.5 * TURN) % TURN - 0.5 * TURN, latitude])
    flat = moved(features, partial(lay_flat, centre=centre))
    return flat, centre, float((high - low).max())


def lay_flat(points: Float, centre: Float) -> Float:
    """Metres (k, 2) east and north of a centre (2,) [°], by the equirectangular projection.

    Over 10 km its lengths are accurate to about one part in a thousand at middle latitudes.
    """
    return np.asarray(_from(points, centre) * metres_of_degree(centre), dtype=np.float64)


def metres_of_degree(centre: Float) -> Float:
    """Metres of a degree of longitude and of latitude at a centre (2,) [°]."""
    shares = np.array([np.cos(np.radians(centre[1])), 1.0])
    return np.asarray(np.radians(1.0) * EARTH_RADIUS * shares, dtype=np.float64)


def _from(points: Float, centre: Float) -> Float:
    """Points (k, 2) [°] from a centre (2,) [°], the short way round, also across the dateline."""
    local = points - centre
    # Only what lies on the other side is turned, so that rounding touches nothing else.
    local[:, 0] -= TURN * np.round(local[:, 0] / TURN)
    return np.asarray(local, dtype=np.float64)


def world_of_features(
    features: Sequence[Feature], name: str, *, place: tuple[float, float] | None = None
) -> World:
    """The world of features: polygons are dissolved into blocks, lines follow after them.

    The place is the longitude and latitude [°] of the point (0, 0), if they are known.
    """
    parts = list(_blocks(features))
    numbered = not parts and all(feature.number is not None for feature in features)
    following = parts[-1].number + 1 if parts else 0
    for feature in features:
        segments = feature.lines
        if len(segments) or numbered:
            number: Any = feature.number if numbered else following
            parts.append(feature.part(number, segments, DEFAULT_HEIGHT))
            following = number + 1
    if not any(len(part.segments) for part in parts):
        raise WorldError("the footprints are too small to leave a wall")
    return world_of_parts(parts, name, place=place)


def _blocks(features: Sequence[Feature]) -> Iterator[Part]:
    """The blocks of footprints that touch, in the order of the first of each.

    Outer rings are counter-clockwise and courtyards clockwise; after them comes a part without
    walls for the looks of each footprint.
    """
    shapes = [(feature, shape) for feature in features for shape in feature.shapes]
    owned = [each for each in shapes if each[1].geom_type == "Polygon"]
    if not owned:
        return
    polygons = np.array([polygon for _, polygon in owned])
    alone = [each.part(0, np.empty((0, 4)), DEFAULT_BUILDING_HEIGHT) for each, _ in owned]
    tall = np.array([part.heights.max() for part in alone])
    corners = shapely.get_coordinates(polygons)
    origin = np.round(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
    from scipy.spatial import cKDTree

    source = cKDTree(corners - origin)
    number = 0
    local = shapely.transform(polygons, lambda xy: xy - origin)
    # An outline that crosses itself is made valid; lines there and back enclose nothing.
    crossed = ~shapely.is_valid(local)
    local[crossed] = shapely.buffer(shapely.make_valid(local[crossed]), 0.0)
    # Labels are numbered by their first members, so blocks keep the order of the source.
    for members in members_of(groups(*pairs_within(local, CLOSING, "footprints"), len(local))):
        rings = []
        for index, points in _rings(local[members]):
            # Corners that came from the source, and not from closing a gap, are as in the source.
            gaps, nearest = map(np.asarray, source.query(points))
            exact = np.where((gaps <= 2.0 * TOUCHING)[:, None], corners[nearest], points + origin)
            once = (exact != np.roll(exact, 1, axis=0)).any(axis=1)
            if turn := _turn_of(points[once], is_hole=index > 0):
                tops = _heights(points[once][::turn], local[members], tall[members])
                rings.append(Part(number, walls(exact[once][::turn], closed=True), tops))
        if rings:
            yield from rings
            yield from (alone[each]._replace(number=number) for each in members.tolist())
            number += 1


def _rings(polygons: Any) -> Iterator[tuple[int, Float]]:
    """The straightened rings (k, 2) of the union of polygons, of whose areas 0 is the outer one."""
    union = shapely.union_all(polygons)
    if len(polygons) > 1:
        # Slightly more than half on each side, so that a gap of exactly this width is closed.
        # Corners sharper than 6° are cut; all others come back as they were.
        half = 0.5001 * CLOSING
        for distance in (half, -half):
            union = shapely.buffer(union, distance, join_style="mitre", mitre_limit=20.0)
    for part in shapely.get_parts([union]):
        for index, outline in enumerate((part.exterior, *part.interiors)):
            ring = np.array(outline.coords)
            line = shapely.simplify(shapely.linestrings(from_corner(ring)), STRAIGHT)
            corners = shapely.get_coordinates(line) @ [1.0, 1.0j]
            yield index, ring[:-1][np.isin(ring[:-1] @ [1.0, 1.0j], corners)]


def _turn_of(points: Float, is_hole: bool) -> int:
    """1 or, if it has to be reversed, −1 for a ring (k, 2) that becomes walls, and 0 for others."""
    if len(points) < 3:
        return 0
    ring = shapely.linearrings(points)
    # A hole of less than a square metre is a gap between footprints and no courtyard.
    if shapely.area(shapely.polygons(ring)) <= (1.0 if is_hole else 0.0):
        return 0
    return -1 if shapely.is_ccw(ring) == is_hole else 1


def _heights(ring: Float, polygons: Any, heights: Float) -> Float:
    """Height (k,) of each wall of a ring: that of the tallest footprint at the wall's middle."""
    middles = shapely.points(0.5 * (ring + np.roll(ring, -1, axis=0)))
    tree = shapely.STRtree(polygons)
    tallest = np.asarray(heights[tree.nearest(middles)], dtype=np.float64)
    wall, neighbour = tree.query(middles, predicate="dwithin", distance=STRAIGHT)
    np.maximum.at(tallest, wall, heights[neighbour])
    return tallest
