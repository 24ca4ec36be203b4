"""Longitudes and latitudes: recognising and projecting them."""

import json
import re
from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float

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
    if "CRS84" in text:
        return "4326"
    match = _CODE.search(text)
    return match.group(1) if match else ""


def from_web_mercator(points: Float) -> Float:
    """Longitudes and latitudes (k, 2) [°] of points (k, 2) [m] of a web map."""
    longitude = points[:, 0] / MERCATOR_RADIUS
    latitude = np.arctan(np.sinh(points[:, 1] / MERCATOR_RADIUS))
    return np.asarray(np.degrees(np.column_stack([longitude, latitude])), dtype=np.float64)


NEAR_DATELINE = 170.0
"""Longitude [°] beyond which points on both sides are on both sides of the dateline: nothing that
is drawn in metres lies only there."""


def crosses_dateline(outlines: Sequence[Float]) -> bool:
    """Whether outlines (k, 2) [°] lie on both sides of the meridian of 180°."""
    longitudes = np.concatenate(outlines)[:, 0]
    return bool(np.ptp(longitudes) > 180.0 > np.ptp(longitudes % 360.0))


def east_of_greenwich(points: Float) -> Float:
    """Points (k, 2) [°] with longitudes from 0° to 360°."""
    return np.asarray(np.column_stack([points[:, 0] % 360.0, points[:, 1]]), dtype=np.float64)


def looks_geographic(outlines: Sequence[Float]) -> bool:
    """Whether outlines (k, 2) are in degrees of longitude and latitude rather than in metres."""
    points = np.concatenate(outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    if (np.maximum(-low, high) > [180.0, 90.0]).any():
        return False
    if crosses_dateline(outlines) and (np.abs(points[:, 0]) >= NEAR_DATELINE).all():
        return True
    if (high - low).max() > WIDEST_DEGREES:
        return False
    return float(np.median([np.ptp(outline, axis=0).max() for outline in outlines])) < (
        LARGEST_BUILDING
    )


def centre_of(outlines: Sequence[Float]) -> Float:
    """The middle (2,) of the box around outlines (k, 2)."""
    points = np.concatenate(outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(0.5 * (low + high), dtype=np.float64)


def place_of(centre: Float) -> tuple[float, float]:
    """Longitude and latitude [°] of a centre (2,), the longitude within ±180°."""
    longitude, latitude = centre.tolist()
    return longitude - 360.0 * (longitude > 180.0), latitude


def lay_flat(degrees: Float, centre: Float) -> Float:
    """Metres (k, 2) east and north of a centre (2,), by the equirectangular projection.

    Over 10 km its lengths are accurate to about one part in a thousand at middle latitudes, which
    turns no wall by more than the width of a beam.
    """
    scale = np.radians(1.0) * EARTH_RADIUS * np.array([np.cos(np.radians(centre[1])), 1.0])
    return np.asarray((degrees - centre) * scale, dtype=np.float64)
