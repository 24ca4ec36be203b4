"""Longitudes and latitudes: telling them from metres, and laying them flat."""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float

EARTH_RADIUS = 6_371_008.8
"""Mean radius of the Earth [m]."""

WIDEST = 0.5
"""Extent [°] up to which a file is taken for degrees: as metres it would be half a pace wide."""

LARGEST_BUILDING = 0.01
"""Median extent of the outlines [°] up to which a file is taken for degrees: about 1 km, or as
metres the width of a finger."""


def looks_geographic(outlines: Sequence[Float]) -> bool:
    """Whether outlines (k, 2) are in degrees of longitude and latitude rather than in metres."""
    points = np.concatenate(outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    if (np.maximum(-low, high) > [180.0, 90.0]).any() or (high - low).max() > WIDEST:
        return False
    return float(np.median([np.ptp(outline, axis=0).max() for outline in outlines])) < (
        LARGEST_BUILDING
    )


def centre_of(outlines: Sequence[Float]) -> Float:
    """The middle (2,) of the box around outlines (k, 2)."""
    points = np.concatenate(outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(0.5 * (low + high), dtype=np.float64)


def lay_flat(degrees: Float, centre: Float) -> Float:
    """Metres (k, 2) east and north of a centre (2,), by the equirectangular projection.

    Over 10 km its lengths are right to about one part in a thousand at middle latitudes, which
    turns no wall by more than a beam's width.
    """
    scale = np.radians(1.0) * EARTH_RADIUS * np.array([np.cos(np.radians(centre[1])), 1.0])
    return np.asarray((degrees - centre) * scale, dtype=np.float64)
