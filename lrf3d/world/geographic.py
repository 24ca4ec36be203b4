"""Longitudes and latitudes: recognising and projecting them."""

import json
import re
from collections.abc import Sequence
from functools import partial

import numpy as np

from lrf3d.geometry import Float
from lrf3d.world.features import Feature

EARTH_RADIUS = 6_371_008.8
"""Mean radius of the Earth [m]."""

WIDEST_DEGREES = 0.5
"""Largest extent [°] of a file in degrees: in metres it would be half a pace wide."""

LARGEST_BUILDING = 0.01
"""Largest median extent of the outlines [°] of a file in degrees: about 1 km; in metres it would be
the width of a finger."""

DEGREES = {"4326", "4258", "4269"}
"""EPSG codes of longitude and latitude: WGS 84, ETRS89 and NAD83, centimetres to metres apart."""

WEB_MERCATOR = {"3857", "900913", "3785", "102100", "102113"}
"""EPSG's and ESRI's codes of the projection of web maps, which enlarges Delft by 1.6."""

MERCATOR_RADIUS = 6_378_137.0
"""Radius [m] of the sphere of web maps."""

_CODE = re.compile(r"(?:EPSG|ESRI)\D.*?(\d{4,6})\b")


def code_of(reference: object) -> str:
    """The EPSG code of a GeoJSON ``crs``; 4326 for CRS84, empty without one."""
    text = json.dumps(reference)
    match = _CODE.search(text)
    return "4326" if "CRS84" in text else match.group(1) if match else ""


def from_web_mercator(points: Float) -> Float:
    """Longitudes and latitudes (k, 2) [°] of points (k, 2) [m] of a web map."""
    longitude = points[:, 0] / MERCATOR_RADIUS
    latitude = np.arctan(np.sinh(points[:, 1] / MERCATOR_RADIUS))
    return np.asarray(np.degrees(np.column_stack([longitude, latitude])), dtype=np.float64)


def looks_geographic(features: Sequence[Feature]) -> bool:
    """Whether the coordinates of features are in degrees and not in metres."""
    import shapely

    shapes = [shape for feature in features for shape in feature.shapes]
    points, boxes = shapely.get_coordinates(shapes), shapely.bounds(shapes)
    if (np.abs(points) > [180.0, 90.0]).any():
        return False
    sizes = np.abs(_from(boxes[:, 2:], boxes[:, :2])).max(axis=1)
    widest = np.ptp(_from(points, points[0]), axis=0).max()
    return bool(widest <= WIDEST_DEGREES and np.median(sizes) < LARGEST_BUILDING)


def laid_flat(features: Sequence[Feature]) -> tuple[list[Feature], Float, float]:
    """Features in degrees laid flat around their middle (2,) [°], and their largest extent [°]."""
    import shapely

    points = shapely.get_coordinates([shape for feature in features for shape in feature.shapes])
    local = _from(points, points[0])
    low, high = local.min(axis=0), local.max(axis=0)
    longitude, latitude = points[0] + 0.5 * (low + high)
    centre = np.array([(longitude + 180.0) % 360.0 - 180.0, latitude])
    flat = [feature.moved(partial(lay_flat, centre=centre)) for feature in features]
    return flat, centre, float((high - low).max())


def lay_flat(points: Float, centre: Float) -> Float:
    """Metres (k, 2) east and north of a centre (2,) [°], by the equirectangular projection.

    Over 10 km its lengths are accurate to about one part in a thousand at middle latitudes, which
    turns no wall by more than the width of a beam.
    """
    scale = np.radians(1.0) * EARTH_RADIUS * np.array([np.cos(np.radians(centre[1])), 1.0])
    return np.asarray(_from(points, centre) * scale, dtype=np.float64)


def _from(points: Float, centre: Float) -> Float:
    """Points (k, 2) [°] from a centre (2,) [°], the short way round, also across the dateline."""
    local = points - centre
    # Only what lies on the other side is turned, so that rounding touches nothing else.
    local[:, 0] -= 360.0 * np.round(local[:, 0] / 360.0)
    return np.asarray(local, dtype=np.float64)
