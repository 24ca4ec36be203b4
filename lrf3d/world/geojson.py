"""Worlds from GeoJSON: footprints of buildings become blocks, lines become walls.

A file in longitude and latitude, as the standard demands, is recognised by its ``crs`` or by its
size and laid flat around its middle; other systems are named by the ``crs``. Elevations (Z) are
ignored.

A world is written to the last bit, its walls as lines: polygons would be dissolved into blocks. In
a map of lrf3d walls meet at the corners, and those that touch are one object.
"""

import json
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from lrf3d.errors import Lrf3dNote, WorldError, shown
from lrf3d.files import own_name, read_text, write_text
from lrf3d.geometry import is_finite
from lrf3d.text import counted
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.crs import in_metres
from lrf3d.world.features import Feature, feature_of, world_of_features
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.gaps import world_of_map
from lrf3d.world.materials import material_value
from lrf3d.world.model import World
from lrf3d.world.pieces import runs_of
from lrf3d.world.schema import at, made, several


def read_geojson(path: Path) -> World:
    """Read a world: Polygons are dissolved into blocks, each an object; lines follow after them.

    A wall of a block has the height of its footprint. Each feature of lines is an object; if all
    have an integer property ``object``, it is the number of the object.
    """
    data = _parse(path)
    features = list(_features(data))
    flat = sum(feature.flat for feature in features)
    if not any(feature.shapes for feature in features):
        what = "that stands" if flat else "at all"
        raise WorldError(f"holds no Polygon and no LineString {what}, so there is no wall")
    if flat:
        left = counted(flat, "feature") + " of roads, water and land"
        warnings.warn(f"{path}: left out: {left}", Lrf3dNote, stacklevel=2)
    given: Any = data.get("place")
    known = isinstance(given, list) and len(given) == 2 and is_finite(*given)
    place = (float(given[0]), float(given[1])) if known else None
    if data.get("units") != "m" and not _is_map(data):
        features, found = in_metres(features, data.get("crs"))
        place = found or place
        if found is None and data.get("crs") is None:
            assumed = "coordinates without a crs, too large for degrees, are taken as metres"
            warnings.warn(f"{path}: {assumed}", Lrf3dNote, stacklevel=2)
    name = data["name"] if isinstance(data.get("name"), str) else own_name(path)
    world = world_of_features(features, name, place=place)
    free = FreeCells.from_dict(data["free"]) if "free" in data else None
    if _is_map(data):
        return world_of_map(world, free)
    cameras = several(made(FixedCamera), "cameras", least=0)(data.get("cameras", []), "cameras")
    return replace(world, cameras=cameras, free=free)


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
