"""Coordinate reference systems: the ``crs`` of a GeoJSON file, and its features in metres.

Longitude and latitude, and the metres of UTM, are known here, all other systems, with their feet,
to pyproj (an extra). Where a system shows lengths as they are, coordinates stay those of the file,
in metres; else the features are laid flat around their middle.
"""

import re
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from lrf3d.errors import WorldError, missing_extra, shown
from lrf3d.geometry import Float
from lrf3d.world.features import Feature, laid_flat, looks_geographic, moved

DEGREES = {"4326", "4258", "4269"}
"""EPSG codes of longitude and latitude: WGS 84, ETRS89 and NAD83, centimetres to metres apart."""

UTM = re.compile(r"32[67]\d\d|258[23]\d")
"""EPSG's codes of the zones of UTM, by WGS 84 and ETRS89."""

LONGEST_NAME = 500
"""Longest name of a system [characters] that is looked for."""

DISTORTED = 0.005
"""Largest part by which lengths may be off in coordinates that stay; national systems are off by a
thousandth at most."""


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
    elif code not in DEGREES and (name or not looks_geographic(features)):
        return list(features), None
    flat, centre, _ = laid_flat(features)
    return flat, (float(centre[0]), float(centre[1]))


def _name_of(reference: Any) -> str:
    """What a ``crs`` names: a text, or that in its properties; empty where there is none."""
    if reference is None:
        return ""
    values = reference
    if isinstance(reference, dict):
        values = reference.get("properties") or {}
        if isinstance(values, dict):
            values = values.get("name") or values.get("href") or values.get("code")
    name = f"EPSG:{values}" if type(values) is int else values
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST_NAME:
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
    import shapely

    try:
        from pyproj import CRS, Proj, Transformer
        from pyproj.exceptions import ProjError
    except ImportError:
        what = f"crs {shown(name)} is neither longitude and latitude nor UTM"
        raise missing_extra(what, "geo") from None
    authority = "ESRI" if re.search("esri", name, re.IGNORECASE) else "EPSG"
    try:
        # A text may be a system itself, in words or numbers, but must name no file.
        if not code and re.search(r"grids|init|file", name, re.IGNORECASE):
            raise ProjError("names a file")
        system = CRS.from_authority(authority, code) if code else CRS.from_user_input(name)
        system = system.sub_crs_list[0] if system.is_compound else system
        if not (system.is_geographic or system.is_projected):
            raise ProjError("is no system of places on Earth")
        to_degrees = Transformer.from_crs(system, "OGC:CRS84", always_xy=True)
    except (ProjError, ValueError) as error:
        reason = str(error) if len(str(error)) < 50 else "is not known"
        raise WorldError(
            f"crs {shown(name)}: {reason}; name a system of EPSG, or leave it out"
        ) from None
    degrees = moved(features, partial(_transformed, to_degrees))
    points = shapely.get_coordinates([shape for each in degrees for shape in each.shapes])
    if not (np.abs(points) <= [360.0, 90.0]).all():
        raise WorldError(f"crs {shown(name)}: coordinates are outside of where it is used")
    axes = {axis.direction for axis in system.axis_info[:2]}
    if system.is_geographic or axes != {"east", "north"}:
        return 0.0, degrees
    factors = Proj(system).get_factors(*np.median(points, axis=0).tolist())
    scales = np.array([factors.meridional_scale, factors.parallel_scale])
    plane = bool((np.abs(scales - 1.0) < DISTORTED).all())
    return (system.axis_info[0].unit_conversion_factor, features) if plane else (0.0, degrees)


def _transformed(transformer: Any, points: Float) -> Float:
    return np.column_stack(transformer.transform(*points.T))
