"""Worlds from OpenStreetMap extracts (``.osm``): buildings become blocks, laid flat in metres.

A path enters; a :class:`World` leaves, whose point (0, 0) is the middle of the buildings and whose
``place`` says where on Earth that is. Buildings are closed ways and multipolygon relations with a
tag ``building``; their height is ``height``, or three metres for each of ``building:levels``.
Tags are free text; a value that cannot be read counts as not given. OpenStreetMap's wiki defines
them on the pages Key:building, Key:height, Key:min_height and Key:building:levels. Trees are read
where they are asked for, see :mod:`lrf3d.world.osm_trees`.
"""

from array import array
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, TypeVar

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.files import own_name
from lrf3d.geometry import Float
from lrf3d.world.buildings import world_of_features
from lrf3d.world.geographic import (
    centre_of,
    crosses_dateline,
    east_of_greenwich,
    lay_flat,
    place_of,
)
from lrf3d.world.geojson_features import LEVEL_HEIGHT, Feature, metres_of
from lrf3d.world.materials import osm_material
from lrf3d.world.model import World
from lrf3d.world.osm_trees import is_tree, trunks
from lrf3d.world.schema import parse_colour
from lrf3d.world.xml_file import go_through

LARGEST_OSM = 1 << 28
"""Largest extract [bytes]: a town of half a million inhabitants, read in half a minute."""

WIDEST_EXTRACT = 2.0
"""Largest extent [°] of the buildings: beyond it the projection is too inaccurate."""

MOST_POINTS = 2_000_000
"""Points of all buildings together: a way may be part of many relations, and be counted in each."""

Refs = list[int]


HIGHEST = 1000.0
"""Height [m] above which a tag counts as an error."""

ABOVE_BEAMS = 2.0
"""Least height above the ground [m] of buildings that the robot passes under."""

NO_WALLS = {"no", "roof", "carport"}
"""Values of the tag building without walls."""


def read_osm(path: Path, *, trees: bool = False) -> World:
    """Read the buildings of an OpenStreetMap extract in XML.

    Buildings that stand above the beams (``min_height`` of two metres or more) and mere roofs are
    left out, and so are outlines of which the extract holds a part only.

    Args:
        path: The file.
        trees: Whether the trunks of its trees are walls too, each an object of bark.

    Raises:
        WorldError: The file cannot be read, or holds no building; the message names the line.
    """
    extract = _Extract(path, trees=trees)
    go_through(path, extract.begin, extract.end, largest=LARGEST_OSM)
    features = [feature for feature in extract.features() if feature.polygons]
    if not features:
        raise WorldError(f"{path}: holds no whole building, so there is no wall")
    outlines = [ring for feature in features for ring in feature.rings]
    if crosses_dateline(outlines):
        features = [feature.moved(east_of_greenwich) for feature in features]
        outlines = [east_of_greenwich(outline) for outline in outlines]
    centre = centre_of(outlines)
    extent = float(np.ptp(np.concatenate(outlines), axis=0).max())
    if extent > WIDEST_EXTRACT:
        raise WorldError(
            f"{path}: buildings {extent:.1f}° apart, expected at most {WIDEST_EXTRACT:g}°; cut out"
            " a part"
        )
    features = [feature.moved(lambda points: lay_flat(points, centre)) for feature in features]
    place = place_of(centre)
    features += extract.trunks(features, centre)
    try:
        return world_of_features(features, own_name(path), place=place)
    except WorldError as error:
        raise WorldError(f"{path}: {error}") from None


@dataclass(slots=True)
class _Item:
    """A way or a relation: its tags, and its nodes or its ways with their roles."""

    tags: dict[str, str] = field(default_factory=dict)
    refs: Refs = field(default_factory=list)
    roles: list[str] = field(default_factory=list)


class _Extract:
    """Collects nodes, ways and relations while a file is read."""

    def __init__(self, path: Path, *, trees: bool) -> None:
        self.path = path
        self.with_trees, self.trees = trees, list[tuple[list[float], dict[str, str]]]()
        # Arrays take a tenth of the memory of numbers and pairs: most nodes are of no building.
        self.ids, self.degrees = array("q"), array("d")
        self.ways: dict[int, _Item] = {}
        self.relations: list[_Item] = []
        self.item: _Item | None = None
        self.root = False
        self.points = 0

    def begin(self, tag: str, attributes: dict[str, str], line: int) -> None:
        if not self.root:
            if tag != "osm":
                self._refuse(
                    line, f"<{tag[:40]}> where <osm> was expected: not an OpenStreetMap file"
                )
            self.root = True
        if tag == "node":
            if attributes.get("visible") == "false":
                return
            self.ids.append(self._number(attributes, "id", line))
            self.degrees.append(self._degrees(attributes, "lon", 180.0, line))
            self.degrees.append(self._degrees(attributes, "lat", 90.0, line))
            if self.with_trees and attributes.get("action") != "delete":
                self.item = _Item()
        elif tag in ("way", "relation"):
            self.item = _Item()
            if attributes.get("visible") == "false" or attributes.get("action") == "delete":
                return
            if tag == "way":
                self.ways[self._number(attributes, "id", line)] = self.item
            else:
                self.relations.append(self.item)
        elif self.item is None:
            return
        elif tag == "nd":
            self.item.refs.append(self._number(attributes, "ref", line))
        elif tag == "member":
            if attributes.get("type") == "way":
                self.item.refs.append(self._number(attributes, "ref", line))
                self.item.roles.append(attributes.get("role", ""))
        elif tag == "tag":
            self.item.tags[attributes.get("k", "")] = attributes.get("v", "")

    def end(self, tag: str) -> None:
        if tag == "node" and self.item is not None and is_tree(self.item.tags):
            self.trees.append((self.degrees[-2:].tolist(), self.item.tags))
        if tag in ("node", "way", "relation"):
            self.item = None

    def features(self) -> list[Feature]:
        """The buildings, in degrees of longitude and latitude."""
        self.order = np.argsort(np.frombuffer(self.ids, dtype=np.int64), kind="stable")
        self.sorted = np.frombuffer(self.ids, dtype=np.int64)[self.order]
        found, outlines = [], set()
        for relation in self.relations:
            tags = self._building_tags(relation)
            if tags is not None:
                found.append(_feature(tags, self._polygons(relation)))
                outlines |= set(relation.refs)
        for number, way in self.ways.items():
            if number not in outlines and is_building(way.tags) and _is_closed(way.refs):
                ring = self._ring(way.refs)
                found.append(_feature(way.tags, () if ring is None else ((ring,),)))
        return found

    def trunks(self, buildings: Sequence[Feature], centre: Float) -> list[Feature]:
        """The trunks of trees that stand free of buildings, which are laid flat about a centre."""
        if not self.trees:
            return []
        places = lay_flat(np.array([place for place, _ in self.trees]), centre)
        polygons = [rings for building in buildings for rings in building.polygons]
        return trunks(places, [tags for _, tags in self.trees], polygons)

    def _building_tags(self, relation: _Item) -> dict[str, str] | None:
        """The tags of a building of several rings; old ones have them on an outer way."""
        if relation.tags.get("type") != "multipolygon":
            return None
        if "building" in relation.tags:
            return relation.tags if is_building(relation.tags) else None
        for number, role in zip(relation.refs, relation.roles, strict=True):
            way = self.ways.get(number)
            if way is not None and role != "inner" and is_building(way.tags):
                return way.tags
        return None

    def _polygons(self, relation: _Item) -> tuple[tuple[Float, ...], ...]:
        rings: dict[bool, list[Float]] = {True: [], False: []}
        members = dict(zip(relation.refs, relation.roles, strict=True)).items()
        for inner in rings:
            ways = [
                self.ways[number].refs
                for number, role in members
                if (role == "inner") == inner and number in self.ways
            ]
            rings[inner] = [
                ring for refs in close_rings(ways) if (ring := self._ring(refs)) is not None
            ]
        return nest_rings(rings[False], rings[True])

    def _ring(self, refs: Refs) -> Float | None:
        """The points (k, 2) [°] of a ring of nodes, or None where some are not in the extract."""
        if not len(self.sorted):
            return None
        self.points += len(refs)
        if self.points > MOST_POINTS:
            raise WorldError(f"{self.path}: buildings of more than {MOST_POINTS:,} points; cut it")
        wanted = np.array(refs[:-1], dtype=np.int64)
        place = np.minimum(np.searchsorted(self.sorted, wanted), len(self.sorted) - 1)
        if not (self.sorted[place] == wanted).all():
            return None
        degrees = np.frombuffer(self.degrees, dtype=np.float64).reshape(-1, 2)
        return valid_ring(degrees[self.order[place]])

    def _number(self, attributes: dict[str, str], key: str, line: int) -> int:
        try:
            number = int(attributes[key])
        except (KeyError, ValueError):
            number = 1 << 63
        if not -(1 << 63) <= number < 1 << 63:
            self._refuse(line, f"{key} is {attributes.get(key, 'missing')[:40]!r}, no number")
        return number

    def _degrees(self, attributes: dict[str, str], key: str, most: float, line: int) -> float:
        try:
            value = float(attributes[key])
        except (KeyError, ValueError):
            value = float("nan")
        if not -most <= value <= most:
            given = attributes.get(key, "missing")[:40]
            self._refuse(line, f"{key} is {given!r}, expected degrees within ±{most:g}")
        return value

    def _refuse(self, line: int, message: str) -> NoReturn:
        raise WorldError(f"{self.path}:{line}: {message}")


def _is_closed(refs: Refs) -> bool:
    return len(refs) > 3 and refs[0] == refs[-1]


def _feature(tags: dict[str, str], polygons: tuple[tuple[Float, ...], ...]) -> Feature:
    material = osm_material(tags.get("building:material"))
    return Feature(polygons, (), tag_height(tags), name_of(tags), tag_colour(tags), None, material)


def is_building(tags: dict[str, str]) -> bool:
    """Whether tags describe a building whose walls reach the ground."""
    if tags.get("building", "no") in NO_WALLS or tags.get("location") == "underground":
        return False
    above = metres_of(tags.get("min_height", ""))
    if above is None:
        above = LEVEL_HEIGHT * (metres_of(tags.get("building:min_level", "")) or 0.0)
    return above < ABOVE_BEAMS


def tag_height(tags: dict[str, str]) -> float | None:
    """Height [m] of a building above the ground, or None if not given."""
    height = metres_of(tags.get("height", "")) or metres_of(tags.get("building:height", ""))
    if height is None:
        levels = metres_of(tags.get("building:levels", "")) or 0.0
        height = LEVEL_HEIGHT * (levels + (metres_of(tags.get("roof:levels", "")) or 0.0))
    return height if 0.0 < height <= HIGHEST else None


def tag_colour(tags: dict[str, str]) -> tuple[float, float, float] | None:
    """The colour of a building, if it is given in a known form."""
    return parse_colour(tags.get("building:colour"))


def name_of(tags: dict[str, str]) -> str:
    """The name of a building, or its street and number."""
    address = f"{tags.get('addr:street', '')} {tags.get('addr:housenumber', '')}".strip()
    return tags.get("name") or address


_Node = TypeVar("_Node", bound=Hashable)


def close_rings(ways: Sequence[Sequence[_Node]]) -> list[list[_Node]]:
    """Closed rings, their first node repeated at the end, of ways that share their end nodes.

    Ways that do not close, as at the edge of an extract, are left out.
    """
    ends: dict[_Node, list[int]] = {}
    for index, way in enumerate(ways):
        for node in way[:1], way[-1:]:
            if len(way) > 1:
                ends.setdefault(node[0], []).append(index)
    left = {index for index, way in enumerate(ways) if len(way) > 1}
    rings = []
    for index in range(len(ways)):
        if index not in left:
            continue
        left.discard(index)
        ring = list(ways[index])
        while ring[0] != ring[-1]:
            # Used ways are dropped, so that a node of many ways takes no quadratic time.
            others = ends[ring[-1]]
            while others and others[-1] not in left:
                others.pop()
            if not others:
                break
            following = others.pop()
            left.discard(following)
            way = list(ways[following])
            ring += way[1:] if way[0] == ring[-1] else way[-2::-1]
        if ring[0] == ring[-1]:
            rings.append(ring)
    return rings


def nest_rings(outer: Sequence[Float], inner: Sequence[Float]) -> tuple[tuple[Float, ...], ...]:
    """Polygons of outer rings (k, 2), each with its inner rings."""
    import shapely

    areas = [shapely.make_valid(shapely.Polygon(ring)) for ring in outer]
    tree = shapely.STRtree(areas)
    polygons: list[list[Float]] = [[ring] for ring in outer]
    for ring in inner:
        within = tree.query(shapely.Point(*ring[0]), predicate="intersects")
        if len(within):
            polygons[int(within.min())].append(ring)
    return tuple(tuple(rings) for rings in polygons)


def valid_ring(points: Float) -> Float | None:
    """The ring (k, 2) without repeated points, or None if it encloses nothing."""
    ring = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
    if len(ring) < 3:
        return None
    arms = ring[1:] - ring[0]
    return ring if (arms[:, 0] * arms[-1, 1] != arms[:, 1] * arms[-1, 0]).any() else None
