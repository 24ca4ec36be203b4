"""Worlds from OpenStreetMap extracts (XML, Overpass's JSON): buildings become blocks, in metres.

The point (0, 0) is the middle of the buildings; ``place`` is where on Earth that is. Buildings are
closed ways and relations with a tag ``building``; their height is ``height``, or three metres for
each of ``building:levels``. Where a ``building:part`` stands on the ground it takes the place of
its building, with its own height. Elements that an extract of Overpass holds twice, as ``out body``
and ``out skel``, are merged; places may stand in the ways (``out geom``). Where they are asked for,
nodes ``natural=tree`` become trunks, slender blocks of bark as high as the tree. Ways
``barrier=wall`` or ``fence`` are walls, and so are the outlines of indoor rooms on one level, which
doors open. Tags are free text, which OpenStreetMap's wiki defines; a value that cannot be read
counts as not given. An element with tags is used, or left out and counted.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from lrf3d.base.balance import Balance
from lrf3d.base.errors import WorldError, shown
from lrf3d.base.files import own_name
from lrf3d.geometry.lines import Float
from lrf3d.world.materials import BUILT_IN, material_of
from lrf3d.world.model import World
from lrf3d.world.pieces import pairs_within
from lrf3d.world.schema import parse_colour
from lrf3d.world.towns.features import (
    POLE,
    TURN,
    Feature,
    encloses,
    laid_flat,
    lay_flat,
    shapes_of,
    with_rooms,
    world_of_features,
)
from lrf3d.world.towns.tags import (
    LEVEL_HEIGHT,
    is_building,
    kind_of,
    left_out,
    metres_of,
    role_in_storey,
    storeys_of,
)

# Height [m] of a tree of which nothing is given: one along a street, some decades old.
DEFAULT_TREE = 8.0

# The kinds of elements.
ELEMENTS = ("node", "way", "relation")

# The tags of an element, by their keys.
Tags = dict[str, str]

# A longitude and latitude [°].
Place = tuple[float, float]

# A node by its number, or by its place where it has none, as within a relation.
Node = int | Place


def read_osm(path: Path, *, trees: bool = False, level: str | None = None) -> World:
    """Read the buildings of an OpenStreetMap extract in XML, and the trunks of its trees if asked.

    Buildings that stand above the beams (``min_height`` of two metres or more) and mere roofs are
    left out, and so are outlines of which the extract holds a part only.
    """
    return _world(path, _read(path), trees, level)


def read_overpass(path: Path, data: dict[str, Any], trees: bool, level: str | None) -> World:
    """Read what Overpass answers in JSON as `read_osm` reads it in XML."""
    extract = _Extract()
    extract.remark = data.get("remark")
    for item in data["elements"]:
        if not isinstance(item, dict) or not isinstance(item.get("type"), str):
            raise WorldError(f"element {shown(item)}, expected a {', a '.join(ELEMENTS)}")
        if item["type"] not in ELEMENTS:
            extract.others.append(item["type"])
            continue
        try:
            element = _element(item)
        except (AttributeError, KeyError, TypeError):
            raise WorldError(f"element {shown(item)}: expected the form of Overpass") from None
        _add(extract, element)
    return _world(path, extract, trees, level)


def _element(item: dict[str, Any]) -> Element:
    """An element of Overpass' JSON as the XML has it; what is nested may have places of its own."""
    # What is null is not given.
    item = {key: value for key, value in item.items() if value is not None}
    plain = {key: str(value) for key, value in item.items() if type(value) in (int, float, str)}
    element = Element(item["type"], plain)
    for key, value in item.get("tags", {}).items():
        element.append(Element("tag", {"k": key, "v": str(value)}))
    nodes = item.get("nodes", [])
    places = item.get("geometry") or [None] * len(nodes)
    for node, place in zip_longest(nodes, places):
        number = {} if node is None else {"ref": str(node)}
        known = {key: str(value) for key, value in (place or {}).items()}
        element.append(Element("nd", number | known))
    for member in item.get("members", []):
        inner = _element({"geometry": member.get("geometry", []), **member})
        inner.tag = "member"
        element.append(inner)
    return element


def _world(path: Path, extract: "_Extract", trees: bool, level: str | None) -> World:
    """The world of an extract."""
    fates = dict[int, str]()
    features = [each for each in _buildings(extract, fates) if each.shapes]
    features += [*_lines(extract, fates), *_rooms(extract, fates)]
    if not any(feature.role != "opening" for feature in features):
        held = _balance(extract, fates, trees).words() or "nothing"
        raise WorldError(f"holds no whole building, so there is no wall; it holds {held}")
    features, centre, extent = laid_flat(features)
    # Farther apart the projection is too inaccurate.
    if extent > 2.0:
        raise WorldError(f"buildings {extent:.1f}° apart, expected at most 2°; cut out a part")
    if trees and extract.trees:
        places, tags = zip(*extract.trees.values(), strict=True)
        features += trunks(lay_flat(np.array(places), centre), tags, shapes_of(features))
    balance = _balance(extract, fates, trees)
    features, said = with_rooms(features, level, balance)
    cut_short = f"the extract may be cut short: {extract.remark}" if extract.remark else ""
    balance.note(path, said, cut_short)
    return world_of_features(features, own_name(path), place=(float(centre[0]), float(centre[1])))


class _Extract:
    """The places [°] of nodes, the trees, the nodes of ways, and the ways of relations."""

    def __init__(self) -> None:
        self.nodes = dict[Node, Place]()
        self.trees = dict[int, tuple[Place, Tags]]()
        # The tags of the nodes that have some.
        self.points = dict[int, Tags]()
        # The kind and the number of each element with tags, as the file has them.
        self.held = set[tuple[str, str]]()
        self.ways = dict[int, tuple[list[Node], Tags]]()
        self.relations = dict[int, tuple[list[tuple[int, str]], Tags]]()
        # The kinds of elements that are no part of a map, as a count or an area that was asked for.
        self.others = list[str]()
        # What the server says of an answer that it did not finish.
        self.remark: str | None = None

    def add(self, element: Element) -> None:
        """Add an element to what is known of it."""
        tags = {tag.get("k", ""): tag.get("v", "") for tag in element.iter("tag")}
        number = int(element.get("id", ""))
        if element.tag == "node":
            place = self.nodes[number] = _place(element)
            if tags:
                self.points[number] = tags
            if tags.get("natural") == "tree" and tags.get("location") != "underground":
                self.trees[number] = place, tags
        elif element.tag == "way":
            self._add_way(number, element, tags)
        else:
            members, before = self.relations.get(number, ([], {}))
            for each in element.iter("member"):
                if each.get("type") == "way":
                    way = int(each.get("ref", ""))
                    members.append((way, each.get("role", "")))
                    self._add_way(way, each, {})
            self.relations[number] = members, before | tags

    def _add_way(self, number: int, element: Element, tags: Tags) -> None:
        nodes = list[Node]()
        for each in element.iter("nd"):
            # Beyond the border of an extract places are missing.
            place = _place(each) if "lat" in each.attrib else None
            nodes.append(
                int(each.get("ref", "")) if "ref" in each.attrib else place or (np.nan,) * 2
            )
            if place is not None:
                self.nodes[nodes[-1]] = place
        before, known = self.ways.get(number, ([], {}))
        self.ways[number] = nodes or before, known | tags

    def area(self, members: list[tuple[int, str]]) -> Any:
        """The area of a relation: what its outer ways enclose, without what inner ones do."""
        inner = [n for n, role in members if role == "inner"]
        outer = [n for n, role in members if role not in ("inner", "part")]
        return shapely.difference(self.enclosed(outer), self.enclosed(inner))

    def enclosed(self, ways: Iterable[int]) -> Any:
        """The area that some ways enclose together; those that are not whole are ignored."""
        whole = [self.ways[n][0] for n in sorted({*ways}) if self.is_whole(n)]
        lines = [[self.nodes[n] for n in refs] for refs in whole if len(refs) > 1]
        enclosed = shapely.polygonize([shapely.LineString(line) for line in lines])
        return shapely.union_all(shapely.get_parts(enclosed))

    def is_whole(self, way: int) -> bool:
        """Whether the places of all nodes of a way are known."""
        return self.nodes.keys() >= set(self.ways[way][0])

    def is_ring(self, way: int) -> bool:
        """Whether a whole way encloses an area."""
        refs = self.ways[way][0]
        return len(refs) > 3 and refs[0] == refs[-1] and self.is_whole(way)


def _read(path: Path) -> _Extract:
    """The elements of a file; each is forgotten when it is read."""
    extract = _Extract()
    elements = ElementTree.iterparse(path, events=("start", "end"))
    _, root = next(elements)
    if root.tag != "osm":
        raise WorldError(f"<{root.tag[:40]}> where <osm> was expected")
    for event, element in elements:
        if event == "end" and element.tag == "remark":
            extract.remark = (element.text or "").strip()
        if event == "end" and element.tag in ELEMENTS:
            _add(extract, element)
            root.clear()
    return extract


def _add(extract: _Extract, element: Element) -> None:
    """Add an element that is not marked as deleted."""
    if element.get("visible") == "false" or element.get("action") == "delete":
        return
    if element.find("tag") is not None:
        extract.held.add((element.tag, element.get("id", "")))
    try:
        extract.add(element)
    except ValueError as error:
        called = f"{element.tag} {element.get('id', 'without id')[:40]}"
        raise WorldError(f"{called}: {error}; export the extract again") from None


def _place(element: Element) -> Place:
    place = float(element.get("lon", "")), float(element.get("lat", ""))
    if not (abs(place[0]) <= 0.5 * TURN and abs(place[1]) <= POLE):
        raise ValueError(f"longitude and latitude {place}, expected degrees")
    return place


def _balance(extract: _Extract, fates: dict[int, str], trees: bool) -> Balance:
    """The balance of the elements with tags; the total is counted in the file."""
    balance = Balance("element", len(extract.held) + len(extract.others))
    for kind in extract.others:
        balance.leave(kind)
    fates |= {id(tags): "" for _, tags in extract.trees.values() if trees}
    ways = (tags for _, tags in (*extract.ways.values(), *extract.relations.values()))
    for tags in filter(None, (*extract.points.values(), *ways)):
        key = next((each for each in MAIN if each in tags), next(iter(tags)))
        reason = fates.get(id(tags), key)
        balance.used += not reason
        balance.leave(reason, bool(reason))
    return balance


# Keys that say what an element is; the first match counts.
MAIN = (
    "building building:part barrier indoor door entrance highway railway waterway aeroway natural"
    " landuse leisure amenity shop power man_made boundary place public_transport route type"
).split()


def _lines(extract: _Extract, fates: dict[int, str]) -> Iterator[Feature]:
    """The walls and fences whose coordinates are known, in degrees."""
    for nodes, tags in extract.ways.values():
        if tags.get("barrier", "no") == "no" or id(tags) in fates:
            continue
        lines = tuple(_known_lines(extract, nodes))
        reason = left_out(tags) or ("" if lines else "incomplete barrier")
        fates[id(tags)] = reason
        if not reason:
            yield Feature(lines, tag_height(tags), tags.get("name", ""))


def _known_lines(extract: _Extract, nodes: Iterable[Any]) -> Iterator[Any]:
    """The lines along the nodes of a way, as far as these are known."""
    for known, run in groupby(nodes, extract.nodes.__contains__):
        places = [extract.nodes[n] for n in run] if known else []
        if len(set(places)) > 1:
            yield shapely.LineString(places)


def _rooms(extract: _Extract, fates: dict[int, str]) -> Iterator[Feature]:
    """The rooms, walls and doors of Simple Indoor Tagging, in degrees."""
    drawn = [(tags, partial(_indoor, extract, n)) for n, (_, tags) in extract.ways.items()]
    drawn += [
        (tags, partial(_indoor_area, extract, members))
        for members, tags in extract.relations.values()
        if tags.get("type") == "multipolygon"
    ]
    for tags, shape_of in drawn:
        if id(tags) in fates or not tags:
            continue
        reason = left_out(tags) if "indoor" in tags else ""
        role = role_in_storey(tags)
        if role and not reason:
            shape = shape_of(role)
            reason = f"incomplete indoor {role}" if shape is None else ""
            if shape is not None:
                parts = tuple(shapely.get_parts([shape]))
                yield Feature(parts, tag_height(tags), role=role, levels=storeys_of(tags))
        if role or reason:
            fates[id(tags)] = reason
    for number, tags in extract.points.items():
        entrance = tags.get("entrance", "no") != "no"
        if entrance or role_in_storey(tags) == "opening":
            fates[id(tags)] = ""
            place = shapely.Point(extract.nodes[number])
            levels = storeys_of(tags) or (("0",) if entrance else ())
            yield Feature((place,), role="opening", levels=levels)


def _indoor(extract: _Extract, number: int, role: str) -> Any:
    """The area or the line of a way with a role in a storey; None if it is incomplete."""
    closed = extract.is_ring(number)
    if not closed and (role == "room" or not extract.is_whole(number)):
        return None
    places = [extract.nodes[n] for n in extract.ways[number][0]]
    if closed and role != "opening":
        return shapely.Polygon(places)
    return shapely.LineString(places) if len(set(places)) > 1 else None


def _indoor_area(extract: _Extract, members: list[tuple[int, str]], role: str) -> Any:
    """The area of a relation in a storey; None if it is incomplete."""
    area = extract.area(members)
    return area if encloses(area) else None


def _buildings(extract: _Extract, fates: dict[int, str]) -> Iterator[Feature]:
    """The buildings, in degrees of longitude and latitude; notes whether each is used."""
    found, outlines = _of_relations(extract, fates)
    fates |= {id(extract.ways[n][1]): "" for n in outlines}
    for number, (refs, tags) in extract.ways.items():
        if number not in outlines and kind_of(tags):
            closed = extract.is_ring(number)
            fates[id(tags)] = "" if closed else "incomplete building"
            if closed:
                found.append((tags, shapely.Polygon([extract.nodes[n] for n in refs])))
    for tags, area in _with_parts(found):
        fates[id(tags)] = left_out(tags)
        if not fates[id(tags)]:
            yield _feature(tags, area)


def _of_relations(
    extract: _Extract, fates: dict[int, str]
) -> tuple[list[tuple[Tags, Any]], set[int]]:
    """The tags and areas of buildings that are relations, and the ways that outline them."""
    outlines = set[int]()
    found = list[tuple[Tags, Any]]()
    ways = extract.ways
    for members, tags in extract.relations.values():
        if tags.get("type") not in ("multipolygon", "building"):
            continue
        outer = [n for n, role in members if role not in ("inner", "part")]
        # Old relations have the tags of the building on an outer way.
        own = [tags] if kind_of(tags) else [ways[n][1] for n in outer]
        building = next(filter(is_building, own), None)
        if any(map(kind_of, own)):
            # A way within that has tags of its own is a building in the courtyard.
            outlines |= {n for n, _ in members if n in outer or ways[n][1] == building}
        if building is not None:
            fates[id(tags)] = ""
            found.append((building, extract.area(members)))
    return found, outlines


def _with_parts(found: list[tuple[Tags, Any]]) -> Iterator[tuple[Tags, Any]]:
    """Buildings and their parts; a part takes its place from the building around it."""
    parts = [
        (tags, shapely.make_valid(area))
        for tags, area in found
        if "building" not in tags and encloses(area)
    ]
    tree = shapely.STRtree([area for _, area in parts])
    for tags, area in found:
        own = tree.query(area, predicate="intersects") if parts and "building" in tags else ()
        if len(own) and encloses(area):
            area = shapely.make_valid(area)
            stands = shapely.union_all([parts[n][1] for n in own if is_building(parts[n][0])])
            every = shapely.union_all([parts[n][1] for n in own])
            # Parts of nearly all of it replace a building, also where they leave the ground open.
            whole = shapely.area(shapely.intersection(area, every)) >= 0.95 * shapely.area(area)
            rest = shapely.get_parts(shapely.difference(area, every if whole else stands))
            # Rounding leaves slivers of centimetres between a building and its parts.
            area = shapely.union_all(rest[~shapely.is_empty(shapely.buffer(rest, -1e-7))])
        yield tags, area


def _feature(tags: Tags, area: Any) -> Feature:
    return Feature(
        tuple(part for part in shapely.get_parts([area]).tolist() if encloses(part)),
        tag_height(tags),
        tags.get("name")
        or f"{tags.get('addr:street', '')} {tags.get('addr:housenumber', '')}".strip(),
        parse_colour(tags.get("building:colour")),
        material=material_of(tags.get("building:material")),
    )


def _metres(tags: Tags, key: str) -> float:
    return metres_of(tags.get(key, "")) or 0.0


def tag_height(tags: Tags) -> float | None:
    """Height [m] of a building above the ground, or None if not given."""
    height = metres_of(tags.get("height", "")) or metres_of(tags.get("building:height", ""))
    if height is None:
        height = LEVEL_HEIGHT * (_metres(tags, "building:levels") + _metres(tags, "roof:levels"))
    # A building of over a kilometre is an error.
    return height if 0.0 < height <= 1000.0 else None


def tree_height(tags: Tags) -> float:
    """Height [m] of a tree: given, or as its crown is wide, or that of most."""
    height = metres_of(tags.get("height", ""))
    if height is None:
        height = _metres(tags, "diameter_crown") / 0.6
    return height if 1.0 <= height <= 100.0 else DEFAULT_TREE


def trunk_radius(tags: Tags) -> float:
    """Radius [m] of the trunk of a tree: by its circumference, or as such trees have it."""
    usual = tree_height(tags) * (1.0 / 45.0)
    return float(np.clip(_metres(tags, "circumference") / (2.0 * np.pi) or usual, 0.05, 1.2))


def trunks(places: Float, tags: Sequence[Tags], buildings: list[Any]) -> list[Feature]:
    """The trunks of trees at places (k, 2) [m] that stand free of buildings and of each other."""
    radii = np.array([trunk_radius(each) for each in tags])
    points = shapely.points(places)
    # Maps are not as exact as a decimetre, and what touches a wall would be a part of it.
    houses = shapely.STRtree(shapely.make_valid(np.array(buildings)))
    near = houses.query(points, predicate="dwithin", distance=radii + 0.1)[0]
    # Of a tree that is mapped twice, the first one counts. Of trunks of one size class whose
    # centres are in one square, as wide as the least radius of the class, the second touches the
    # first.
    side = 2.0 ** np.floor(np.log2(radii))
    squares = np.column_stack([side, np.floor(places / side[:, None])])
    single = np.sort(np.unique(squares, axis=0, return_index=True)[1])
    circles = shapely.buffer(points[single], radii[single])
    first, second = pairs_within(circles, 0.0, "trees")
    once = {*single.tolist()} - {*single[second[first < second]].tolist()}
    turn = np.arange(7) % 6 * (2.0 * np.pi / 6)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    return [
        Feature(
            (shapely.LineString(places[number] + radii[number] * circle),),
            tree_height(own := tags[number]),
            own.get("name") or own.get("species") or own.get("genus") or "",
            material=BUILT_IN["bark"],
        )
        for number in sorted(once - {*near.tolist()})
    ]
