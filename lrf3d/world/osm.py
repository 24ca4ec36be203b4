"""Worlds from OpenStreetMap extracts (``.osm``): buildings become blocks, laid flat in metres.

A path enters; a :class:`World` leaves, whose point (0, 0) is the middle of the buildings and whose
``place`` says where on Earth that is. Buildings are closed ways and multipolygon relations with a
tag ``building``; their height is ``height``, or three metres for each of ``building:levels``.
Tags are free text; a value that cannot be read counts as not given. OpenStreetMap's wiki defines
them on the pages Key:building, Key:height, Key:min_height and Key:building:levels. Trees are read
where they are asked for, see :mod:`lrf3d.world.osm_trees`.
"""

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.files import opened, own_name
from lrf3d.geometry import Float
from lrf3d.world.buildings import world_of_features
from lrf3d.world.features import LEVEL_HEIGHT, Feature, metres_of
from lrf3d.world.geographic import centre_of, lay_flat
from lrf3d.world.materials import osm_material
from lrf3d.world.model import World
from lrf3d.world.osm_trees import is_tree, trunks
from lrf3d.world.schema import parse_colour

LARGEST_OSM = 1 << 28
"""Largest extract [bytes]: a town of half a million inhabitants, read in half a minute."""

WIDEST_EXTRACT = 2.0
"""Largest extent [°] of the buildings: beyond it the projection is too inaccurate."""

HIGHEST = 1000.0
"""Height [m] above which a tag counts as an error."""

ABOVE_BEAMS = 2.0
"""Least height above the ground [m] of buildings that the robot passes under."""

NO_WALLS = {"no", "roof", "carport"}
"""Values of the tag building without walls."""

Tags = dict[str, str]


def read_osm(path: Path, *, trees: bool = False) -> World:
    """Read the buildings of an OpenStreetMap extract in XML.

    Buildings that stand above the beams (``min_height`` of two metres or more) and mere roofs are
    left out, and so are outlines of which the extract holds a part only.

    Args:
        path: The file.
        trees: Whether the trunks of its trees are walls too, each an object of bark.

    Raises:
        WorldError: The file holds no building or an invalid number; the message names the element.
    """
    import shapely

    extract = _Extract()
    with opened(path, what="a world file", largest=LARGEST_OSM, error=WorldError) as file:
        try:
            extract.read(ElementTree.iterparse(file, events=("start", "end")))
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            if isinstance(error, WorldError):
                raise
            raise WorldError(f"not XML: {error}") from None
    features = [feature for feature in extract.features() if feature.shapes]
    if not features:
        raise WorldError("holds no whole building, so there is no wall")
    centre, extent = centre_of(
        shapely.get_coordinates([s for each in features for s in each.shapes])
    )
    if extent > WIDEST_EXTRACT:
        raise WorldError(
            f"buildings {extent:.1f}° apart, expected at most {WIDEST_EXTRACT:g}°; cut out a part"
        )
    features = [feature.moved(partial(lay_flat, centre=centre)) for feature in features]
    if trees and extract.trees:
        places = lay_flat(np.array([place for place, _ in extract.trees]), centre)
        buildings = [polygon for feature in features for polygon in feature.shapes]
        features += trunks(places, [tags for _, tags in extract.trees], buildings)
    return world_of_features(features, own_name(path), place=(float(centre[0]), float(centre[1])))


@dataclass(slots=True)
class _Way:
    """The nodes of a way, and its tags."""

    nodes: list[int]
    tags: Tags


@dataclass(slots=True)
class _Extract:
    """The nodes, ways and relations of a file, and its trees."""

    # Arrays take a tenth of the memory of numbers and pairs: most nodes are of no building.
    ids: "array[int]" = field(default_factory=lambda: array("q"))
    degrees: "array[float]" = field(default_factory=lambda: array("d"))
    trees: list[tuple[tuple[float, float], Tags]] = field(default_factory=list)
    ways: dict[int, _Way] = field(default_factory=dict)
    relations: list[tuple[list[tuple[int, str]], Tags]] = field(default_factory=list)

    def read(self, events: Iterable[tuple[str, Element]]) -> None:
        """Collect the elements of a file; each is forgotten when it is read."""
        root: Element | None = None
        for event, element in events:
            if root is None:
                root = element
                if root.tag != "osm":
                    raise WorldError(
                        f"<{root.tag[:40]}> where <osm> was expected: not an OpenStreetMap file"
                    )
            if event == "end" and element.tag in ("node", "way", "relation"):
                if element.get("visible") != "false" and element.get("action") != "delete":
                    self.add(element)
                root.clear()

    def add(self, element: Element) -> None:
        number = _whole(element, "id", element)
        tags = {tag.get("k", ""): tag.get("v", "") for tag in element.iter("tag")}
        if element.tag == "node":
            place = _degrees(element, "lon", 180.0), _degrees(element, "lat", 90.0)
            self.ids.append(number)
            self.degrees.extend(place)
            if is_tree(tags):
                self.trees.append((place, tags))
        elif element.tag == "way":
            nodes = [_whole(each, "ref", element) for each in element.iter("nd")]
            self.ways[number] = _Way(nodes, tags)
        elif tags.get("type") == "multipolygon":
            members = [
                (_whole(each, "ref", element), each.get("role", ""))
                for each in element.iter("member")
                if each.get("type") == "way"
            ]
            self.relations.append((members, tags))

    def features(self) -> Iterator[Feature]:
        """The buildings, in degrees of longitude and latitude."""
        import shapely

        ids = np.frombuffer(self.ids, dtype=np.int64)
        order = np.argsort(ids, kind="stable")
        degrees = np.frombuffer(self.degrees, dtype=np.float64).reshape(-1, 2)

        def points(nodes: list[int]) -> Float | None:
            """The places of nodes [°], or None where some are not in the extract."""
            place = np.searchsorted(ids, nodes, sorter=order)
            if not len(ids) or (place == len(ids)).any() or (ids[order[place]] != nodes).any():
                return None
            return degrees[order[place]]

        def areas(members: list[tuple[int, str]], inner: bool) -> Any:
            """What the ways of a role enclose together."""
            ways = {number for number, role in members if (role == "inner") == inner}
            found = [points(self.ways[n].nodes) for n in sorted(ways) if n in self.ways]
            lines = [
                shapely.LineString(line) for line in found if line is not None and len(line) > 1
            ]
            return shapely.union_all(shapely.get_parts(shapely.polygonize(lines)))

        outlines: set[int] = set()
        for members, tags in self.relations:
            ways = [self.ways[n].tags for n, role in members if n in self.ways and role != "inner"]
            # Old relations have the tags of the building on an outer way.
            own = [tags] if "building" in tags else ways
            building = next((each for each in own if is_building(each)), None)
            if building is not None:
                outlines |= {number for number, _ in members}
                yield _feature(
                    building, shapely.difference(areas(members, False), areas(members, True))
                )
        for number, way in self.ways.items():
            if number in outlines or not is_building(way.tags):
                continue
            line = (
                points(way.nodes) if len(way.nodes) > 3 and way.nodes[0] == way.nodes[-1] else None
            )
            yield _feature(way.tags, None if line is None else shapely.Polygon(line))


def _feature(tags: Tags, area: Any) -> Feature:
    import shapely

    parts = [] if area is None else shapely.get_parts([area]).tolist()
    shapes = tuple(part for part in parts if shapely.make_valid(part).area > 0.0)
    material = osm_material(tags.get("building:material"))
    colour = parse_colour(tags.get("building:colour"))
    return Feature(shapes, tag_height(tags), name_of(tags), colour, None, material)


def _whole(element: Element, key: str, owner: Element) -> int:
    try:
        number = int(element.get(key, ""))
    except ValueError:
        number = 1 << 63
    if not -(1 << 63) <= number < 1 << 63:
        raise WorldError(f"{_called(owner)}: {key} is {shown(element.get(key))}, no number")
    return number


def _degrees(node: Element, key: str, most: float) -> float:
    try:
        value = float(node.get(key, ""))
    except ValueError:
        value = float("nan")
    if not -most <= value <= most:
        raise WorldError(
            f"{_called(node)}: {key} is {shown(node.get(key))}, expected degrees within ±{most:g}"
        )
    return value


def _called(element: Element) -> str:
    return f"{element.tag} {element.get('id', 'without id')[:40]}"


def is_building(tags: Tags) -> bool:
    """Whether tags describe a building whose walls reach the ground."""
    if tags.get("building", "no") in NO_WALLS or tags.get("location") == "underground":
        return False
    above = metres_of(tags.get("min_height", ""))
    if above is None:
        above = LEVEL_HEIGHT * (metres_of(tags.get("building:min_level", "")) or 0.0)
    return above < ABOVE_BEAMS


def tag_height(tags: Tags) -> float | None:
    """Height [m] of a building above the ground, or None if not given."""
    height = metres_of(tags.get("height", "")) or metres_of(tags.get("building:height", ""))
    if height is None:
        levels = metres_of(tags.get("building:levels", "")) or 0.0
        height = LEVEL_HEIGHT * (levels + (metres_of(tags.get("roof:levels", "")) or 0.0))
    return height if 0.0 < height <= HIGHEST else None


def name_of(tags: Tags) -> str:
    """The name of a building, or its street and number."""
    address = f"{tags.get('addr:street', '')} {tags.get('addr:housenumber', '')}".strip()
    return tags.get("name") or address
