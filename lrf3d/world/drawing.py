"""Worlds from drawings: strokes become walls, and walls that touch become objects."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.files import own_name
from lrf3d.geometry import LARGEST_COORDINATE, Float, lengths
from lrf3d.world.model import World
from lrf3d.world.pieces import walls
from lrf3d.world.touching import TOUCHING, connected

CURVE_ERROR = 0.005
"""Largest distance [m] of chords from their curve: about the width of a laser beam."""

FINEST_GAP = 1e-4
"""Largest gap relative to the size of the drawing, for drawings in their size on paper."""

SHORTEST = 1e-9
"""Length [m] up to which a stroke is a point."""


def world_of_strokes(strokes: Sequence[Float], path: Path) -> World:
    """The world of strokes (k, 2) [m]; repeated ones count once.

    Raises:
        WorldError: There are no walls, or they are not finite.
    """
    pieces = [walls(stroke, closed=False) for stroke in strokes if len(stroke) > 1]
    segments = np.concatenate(pieces) if pieces else np.empty((0, 4))
    if not (np.abs(segments) <= LARGEST_COORDINATE).all():
        raise WorldError(f"holds a line that is not finite, or over {LARGEST_COORDINATE:g} m away")
    segments = without_repeats(segments[lengths(segments) > SHORTEST])
    if not len(segments):
        raise WorldError("holds no line and no outline, so there is no wall")
    extent = float(np.ptp(segments.reshape(-1, 2), axis=0).max())
    gap = min(TOUCHING, FINEST_GAP * extent)
    return World(segments, connected(segments, gap), name=own_name(path))


def without_repeats(segments: Float) -> Float:
    """The segments (n, 4) without repeated ones, in either direction."""
    turned = (segments[:, 0] > segments[:, 2]) | (
        (segments[:, 0] == segments[:, 2]) & (segments[:, 1] > segments[:, 3])
    )
    either = np.where(turned[:, None], segments[:, [2, 3, 0, 1]], segments)
    _, kept = np.unique(either, axis=0, return_index=True)
    return np.asarray(segments[np.sort(kept)], dtype=np.float64)
