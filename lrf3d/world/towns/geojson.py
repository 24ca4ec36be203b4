"""Worlds from GeoJSON: footprints of buildings become blocks, lines become walls.

A file in longitude and latitude, as the standard demands, is recognised by its ``crs`` or by its
size and laid flat around its middle. UTM is known here, other systems that the ``crs`` names, with
their feet, to pyproj (an extra): where they show lengths as they are, coordinates stay, in metres.
Elevations (Z) are ignored.

A world is written to the last bit, its walls as lines: polygons would be dissolved into blocks. In
a map of lrf3d walls meet at the corners, and those that touch are one object.
"""

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from lrf3d.base.balance import Balance
from lrf3d.base.errors import WorldError, missing_extra, shown
from lrf3d.base.files import own_name, read_text, write_text
from lrf3d.geometry.lines import is_finite
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.gaps import world_of_map
from lrf3d.world.materials import material_value
from lrf3d.world.model import World
from lrf3d.world.pieces import runs_of
from lrf3d.world.schema import at, made, several
from lrf3d.world.towns.features import (
    POLE,
    TURN,
    Feature,
    feature_of,
    joined_areas,
    laid_flat,
    lay_flat,
    looks_geographic,
    metres_of_degree,
    moved,
    shapes_of,
    with_rooms,
    world_of_features,
)
from lrf3d.world.towns.osm import read_overpass

# EPSG codes of longitude and latitude: WGS 84, ETRS89 and NAD83, centimetres to metres apart.
DEGREES = {"4326", "4258", "4269"}

# Matches EPSG's codes of the zones of UTM, by WGS 84 and ETRS89.
UTM = re.compile(r"32[67]\d\d|258[23]\d")


def read_geojson(path: Path, trees: bool = False, level: str | None = None) -> World:
    """Read a world: Polygons are dissolved into blocks, each an object; lines follow after them.

    A wall of a block has the height of its footprint. Each feature of lines is an object; if all
    have an integer property ``object``, it is the number of the object. Rooms of OpenStreetMap or
    IMDF are not dissolved: their outlines are walls, on one level.
    """
    data = _parse(path)
    # An answer of Overpass has no type; GeoJSON may have any members.
    if data.get("type") is None and isinstance(data.get("elements"), list):
        return read_overpass(path, data, trees, level)
    if trees:
        raise WorldError("trees are read from OpenStreetMap's extracts alone")
    features = list(_features(data))
    balance = Balance("feature", len(features))
    for feature in features:
        balance.used += not feature.left_out
        balance.leave(feature.left_out, bool(feature.left_out))
    if not any(feature.shapes for feature in features if feature.role != "opening"):
        raise WorldError(
            "holds no Polygon and no LineString, so there is no wall; it holds"
            f" {balance.words() or 'nothing'}"
        )
    features, place, assumed = _placed(features, data)
    joined = joined_areas(features)
    features, said = with_rooms(features, level, balance)
    balance.note(path, assumed, said, joined)
    name = data.get("name")
    world = world_of_features(
        features, name if isinstance(name, str) else own_name(path), place=place
    )
    free = FreeCells.from_dict(data["free"]) if "free" in data else None
    if _is_map(data):
        return world_of_map(world, free)
    cameras = several(made(FixedCamera), "cameras", least=0)(data.get("cameras", []), "cameras")
    return replace(world, cameras=cameras, free=free)


def _placed(
    features: list[Feature], data: dict[str, Any]
) -> tuple[list[Feature], tuple[float, float] | None, str]:
    """The features in metres, the longitude and latitude of (0, 0), if known, and what is assumed.

    Longitude and latitude may be swapped in a file: the place shows it.
    """
    given = data.get("place")
    place = None
    if isinstance(given, list) and len(given) == 2 and is_finite(*given):
        place = float(given[0]), float(given[1])
        if data.get("units") == "deg":
            return moved(features, partial(lay_flat, centre=np.array(place))), place, ""
    if data.get("units") == "m" or _is_map(data):
        return features, place, ""
    reference = data.get("crs")
    features, found = in_metres(features, reference)
    if found is not None:
        where = "longitude first, so around latitude"
        return features, found, f"{where} {found[1]:.4f}°, longitude {found[0]:.4f}°"
    wide, high = np.ptp(shapely.get_coordinates(shapes_of(features)), axis=0)
    assumed = (
        "coordinates without a crs, too large for degrees, are taken as metres:"
        f" {wide:,.6g} m by {high:,.6g} m"
    )
    return features, place, assumed if reference is None else ""


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
    except ValueError as error:
        data = _of_lines(text)
        if data is None:
            raise WorldError(f"not JSON: {error}") from None
    if not isinstance(data, dict):
        raise WorldError(f"expected a GeoJSON object, found a JSON {type(data).__name__}")
    kind = data.get("type")
    if isinstance(kind, str) and kind in _FOREIGN:
        raise WorldError(_FOREIGN[kind])
    return data


def _of_lines(text: str) -> dict[str, Any] | None:
    """The collection of features of a file with one in each line, or None."""
    lines = [line.strip("\x1e ") for line in text.splitlines() if line.strip()]
    try:
        items = [json.loads(line, object_pairs_hook=_unique) for line in lines[1:] and lines]
    except (ValueError, RecursionError):
        return None
    features = [isinstance(item, dict) and item.get("type") == "Feature" for item in items]
    return {"type": "FeatureCollection", "features": items} if all(features) and items else None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; which of two values of one key is meant, nobody knows."""
    found = dict(pairs)
    if len(found) < len(pairs):
        [(twice, _)] = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {shown(twice)} stands twice in one object; remove one")
    return found


# Messages for other kinds of JSON with coordinates, by type.
_FOREIGN = {
    **dict.fromkeys(
        ("CityJSON", "CityJSONFeature"),
        "CityJSON, which is not read; make a mesh of it, as by `cjio FILE export obj city.obj`",
    ),
    "Topology": "TopoJSON, which is not read; make GeoJSON of it, as by `topo2geo`",
}


def write_geojson(world: World, path: Path) -> None:
    """Write a world as GeoJSON: one feature for each run of walls of one object.

    Coordinates are degrees, as the standard wants them, where these are the same walls.
    """
    drawn = world if world.place is None else _in_degrees(world)
    units = "m" if drawn is world else "deg"
    # Other readers ignore these members, as the standard allows.
    members: dict[str, Any] = {"type": "FeatureCollection", "name": world.name, "units": units}
    if world.place is not None:
        members["place"] = world.place
    if world.cameras:
        members["cameras"] = [asdict(camera) for camera in world.cameras]
    if world.free is not None:
        members["free"] = world.free.as_dict()
    features = ",\n".join(json.dumps(_feature(*run)) for run in runs_of(drawn))
    write_text(path, f'{json.dumps(members)[:-1]}, "features": [\n{features}\n]}}\n')


def _in_degrees(world: World) -> World:
    """A world with degrees for metres, if these are the same walls, to the bit; or else itself."""
    centre = np.array(world.place)
    degrees = centre + world.segments.reshape(-1, 2) / metres_of_degree(centre)
    same = lay_flat(degrees, centre).tobytes() == world.segments.tobytes()
    return replace(world, segments=degrees.reshape(-1, 4)) if same else world


def _feature(number: int, looks: dict[str, Any], lines: list[Any], height: Any) -> dict[str, Any]:
    """The feature of a run of walls; without walls it has no geometry."""
    properties = {"object": number, **looks}
    if "material" in looks:
        properties["material"] = material_value(looks["material"])
    geometry = None
    if lines:
        properties["height"] = height
        kind = "LineString" if len(lines) == 1 else "MultiLineString"
        geometry = {"type": kind, "coordinates": lines[0] if len(lines) == 1 else lines}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def in_metres(
    features: Sequence[Feature], reference: object
) -> tuple[list[Feature], tuple[float, float] | None]:
    """Features in metres, and the longitude and latitude of (0, 0) where they were laid flat.

    Without a reference, degrees are recognised; other coordinates are taken as metres.

    Raises:
        WorldError: The reference names no system of places on Earth.
        MissingLibraryError: The system is one for which pyproj is needed.
    """
    name = _name_of(reference)
    code = _code_of(name)
    if name and code not in DEGREES and not UTM.fullmatch(code):
        metre, features = _by_pyproj(features, name, code)
        if metre:
            return moved(features, lambda points: points * metre), None
    elif not name and looks_geographic(moved(features, np.fliplr)) > looks_geographic(features):
        raise WorldError("latitude stands before longitude; swap the two in each position")
    elif code not in DEGREES and (name or not looks_geographic(features)):
        return list(features), None
    flat, centre, _ = laid_flat(features)
    return flat, (float(centre[0]), float(centre[1]))


def _name_of(reference: Any) -> str:
    """The name in a ``crs``: a text, or one in its properties; empty where there is none."""
    if reference is None:
        return ""
    values = reference
    if isinstance(reference, dict):
        values = reference.get("properties") or {}
        if isinstance(values, dict):
            values = values.get("name") or values.get("href") or values.get("code")
    name = f"EPSG:{values}" if type(values) is int else values
    if not isinstance(name, str) or not 0 < len(name) <= 500:
        raise WorldError(f"crs is {shown(reference)}, expected a name such as EPSG:4326, or none")
    return name


def _code_of(name: str) -> str:
    """The code of EPSG or ESRI in a name, such as a URN; 4326 for OGC's longitude and latitude."""
    if re.search(r"CRS:?8[34]", name, re.IGNORECASE):
        return "4326"
    # Of a plane system with heights the plane one comes first.
    match = re.search(r"(?:EPSG|ESRI)\W(?:[^,]*?\W)?(\d{4,6})(?!\d|\.\d)", name, re.IGNORECASE)
    return match.group(1) if match else ""


def _by_pyproj(
    features: Sequence[Feature], name: str, code: str
) -> tuple[float, Sequence[Feature]]:
    """The unit [m] and the features of a plane system; or 0 and the features in degrees."""
    try:
        from pyproj import Proj, Transformer
        from pyproj.exceptions import ProjError
    except ImportError:
        what = f"crs {shown(name)} is neither longitude and latitude nor UTM"
        raise missing_extra(what, "geo") from None
    try:
        system = _system(name, code)
        to_degrees = Transformer.from_crs(system, "OGC:CRS84", always_xy=True)
    except (ProjError, ValueError) as error:
        reason = str(error) if len(str(error)) < 50 else "is not known"
        raise WorldError(
            f"crs {shown(name)}: {reason}; name a system of EPSG, or leave it out"
        ) from None
    degrees = moved(features, lambda points: np.column_stack(to_degrees.transform(*points.T)))
    points = shapely.get_coordinates(shapes_of(degrees))
    if not (np.abs(points) <= [TURN, POLE]).all():
        raise WorldError(f"crs {shown(name)}: coordinates are outside of where it is used")
    axes = {axis.direction for axis in system.axis_info[:2]}
    if system.is_geographic or axes != {"east", "north"}:
        return 0.0, degrees
    factors = Proj(system).get_factors(*np.median(points, axis=0).tolist())
    scales = np.array([factors.meridional_scale, factors.parallel_scale])
    # Largest part by which lengths may be off in coordinates that stay; national systems are off by
    # a thousandth at most.
    distorted = 0.005
    plane = bool((np.abs(scales - 1.0) < distorted).all())
    return (system.axis_info[0].unit_conversion_factor, features) if plane else (0.0, degrees)


def _system(name: str, code: str) -> Any:
    """The system of places on Earth of a name, by its code where it has one."""
    from pyproj import CRS

    # A text may be a system itself, in words or numbers, but must name no file.
    if not code and re.search(r"grids|init|file", name, re.IGNORECASE):
        raise ValueError("names a file")
    authority = "ESRI" if "esri" in name.lower() else "EPSG"
    system = CRS.from_authority(authority, code) if code else CRS.from_user_input(name)
    system = system.sub_crs_list[0] if system.is_compound else system
    if not (system.is_geographic or system.is_projected):
        raise ValueError("is no system of places on Earth")
    return system
