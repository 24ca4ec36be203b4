"""Worlds from GeoJSON: footprints of buildings become blocks, lines become walls.

A file in longitude and latitude, as the standard demands, is recognised by its ``crs`` or by its
size and projected around its middle; so are the stretched metres of web maps (EPSG:3857). Heights
above ground (Z) are ignored.

A world is written to the last bit, its walls as lines: polygons would be dissolved into blocks. In
a map of lrf3d walls meet at the corners, and those that touch are one object.
"""

import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import WorldError, shown
from lrf3d.files import own_name, read_text, write_text
from lrf3d.geometry import Float, is_finite
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.features import (
    Feature,
    feature_of,
    laid_flat,
    looks_geographic,
    moved,
    world_of_features,
)
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.gaps import world_of_map
from lrf3d.world.materials import material_value
from lrf3d.world.model import World
from lrf3d.world.pieces import runs_of
from lrf3d.world.schema import at, made, several

DEGREES = {"4326", "4258", "4269"}
"""EPSG codes of longitude and latitude: WGS 84, ETRS89 and NAD83, centimetres to metres apart."""

LONGEST_REFERENCE = 10_000
"""Longest ``crs`` [characters]: descriptions in words have some thousand."""

WEB_MERCATOR = {"3857", "900913", "3785", "102100", "102113"}
"""EPSG's and ESRI's codes of the projection of web maps, which enlarges Delft by 1.6."""


def read_geojson(path: Path) -> World:
    """Read a world: Polygons are dissolved into blocks, each an object; lines follow after them.

    A wall of a block has the height of its footprint. Each feature of lines is an object; if all
    have an integer property ``object``, it is the number of the object.
    """
    data = _parse(path)
    features = list(_features(data))
    if not any(feature.shapes for feature in features):
        raise WorldError("holds no Polygon and no LineString, so there is no wall")
    given: Any = data.get("place")
    known = isinstance(given, list) and len(given) == 2 and is_finite(*given)
    place = (float(given[0]), float(given[1])) if known else None
    if data.get("units") != "m" and not _is_map(data):
        reference = data.get("crs")
        code = _code_of(reference)
        if code in WEB_MERCATOR:
            features = moved(features, _from_web_mercator)
        if code in DEGREES | WEB_MERCATOR or (reference is None and looks_geographic(features)):
            features, centre, _ = laid_flat(features)
            place = (float(centre[0]), float(centre[1]))
    name = data["name"] if isinstance(data.get("name"), str) else own_name(path)
    world = world_of_features(features, name, place=place)
    free = FreeCells.from_dict(data["free"]) if "free" in data else None
    if _is_map(data):
        return world_of_map(world, free)
    cameras = several(made(FixedCamera), "cameras", least=0)(data.get("cameras", []), "cameras")
    return replace(world, cameras=cameras, free=free)


def _code_of(reference: object) -> str:
    """The EPSG code of a ``crs``; 4326 for CRS84, empty without one."""
    text = json.dumps(reference)
    if len(text) > LONGEST_REFERENCE:
        raise WorldError(f"crs: {len(text):,} characters, expected at most {LONGEST_REFERENCE:,}")
    match = re.search(r"(?:EPSG|ESRI)\D.*?(\d{4,6})\b", text)
    return "4326" if "CRS84" in text else match.group(1) if match else ""


def _from_web_mercator(points: Float) -> Float:
    """Longitudes and latitudes (k, 2) [°] of points (k, 2) [m] of a web map."""
    longitude, north = points.T / 6_378_137.0  # The radius [m] of the sphere of web maps.
    degrees: Float = np.degrees(np.column_stack([longitude, np.arctan(np.sinh(north))]))
    return degrees


def _features(data: dict[str, Any]) -> Iterator[Feature]:
    """The features of a FeatureCollection, of a Feature or of a bare geometry."""
    items: Any = data.get("features") if data.get("type") == "FeatureCollection" else [data]
    if not isinstance(items, list):
        raise WorldError("FeatureCollection without a list of features")
    for index, item in enumerate(items):
        with at(f"feature {index}"):
            yield feature_of(item)


def _is_map(data: dict[str, Any]) -> bool:
    """Whether these are the features of a map that lrf3d wrote."""
    features = data.get("features")
    return isinstance(features, list) and all(
        isinstance(properties := feature.get("properties"), dict)
        and {"object", "alpha", "p", "points"} <= set(properties)
        for feature in features
    )


def _parse(path: Path) -> dict[str, Any]:
    text = read_text(path)
    try:
        data = json.loads(text, object_pairs_hook=_unique)
    except RecursionError:
        raise WorldError("nested too deeply for a world file") from None
    except ValueError as error:
        raise WorldError(f"not JSON: {error}") from None
    if not isinstance(data, dict):
        raise WorldError(f"expected a GeoJSON object, found a JSON {type(data).__name__}")
    if isinstance(kind := data.get("type"), str) and kind in _FOREIGN:
        raise WorldError(_FOREIGN[kind])
    return data


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; which of two values of one key is meant, nobody knows."""
    found = dict(pairs)
    if len(found) < len(pairs):
        counts = Counter(key for key, _ in pairs)
        twice = counts.most_common(1)[0][0]
        raise ValueError(f"the key {shown(twice)} stands twice in one object; remove one")
    return found


_FOREIGN = {
    **dict.fromkeys(
        ("CityJSON", "CityJSONFeature"),
        "CityJSON, which is not read; make a mesh of it, as by `cjio FILE export obj city.obj`",
    ),
    "Topology": "TopoJSON, which is not read; make GeoJSON of it, as by `topo2geo`",
}
"""Messages for other kinds of JSON with coordinates, by type."""


def write_geojson(world: World, path: Path) -> None:
    """Write a world as GeoJSON: one feature for each run of walls of one object."""
    # Other readers ignore these members, as the standard allows.
    members: dict[str, Any] = {"type": "FeatureCollection", "name": world.name, "units": "m"}
    if world.place is not None:
        members["place"] = world.place
    if world.cameras:
        members["cameras"] = [asdict(camera) for camera in world.cameras]
    if world.free is not None:
        members["free"] = world.free.as_dict()
    features = []
    for number, looks, lines, height in runs_of(world):
        properties = {"object": number, **looks}
        if "material" in looks:
            properties["material"] = material_value(looks["material"])
        geometry = None
        if lines:
            properties["height"] = height
            kind = "LineString" if len(lines) == 1 else "MultiLineString"
            geometry = {"type": kind, "coordinates": lines[0] if len(lines) == 1 else lines}
        feature = {"type": "Feature", "properties": properties, "geometry": geometry}
        features.append(json.dumps(feature))
    text = ",\n".join(features)
    write_text(path, f'{json.dumps(members)[:-1]}, "features": [\n{text}\n]}}\n')
