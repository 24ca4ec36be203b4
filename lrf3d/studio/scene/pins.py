"""Pins: which walls maps miss in the end, marked from the side that is missed.

The runs of maps and a look enter; ribbons along these walls, pins and what these say leave.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry.lines import LEFT, Float, directions, lengths
from lrf3d.studio.scene.found import lost_walls
from lrf3d.studio.scene.look import FALSE_COLOUR
from lrf3d.studio.scene.shapes import Soft, single
from lrf3d.studio.scene.timeline import metres

# Width of ribbons along walls that the map misses, in the distance of the eye.
_RIBBON = 0.006

# Length of the pins that point at these, likewise.
_PIN = 0.025

# Half the width of the end of a pin, in its length.
_WIDE = 0.6

# Width of a picture, in its height, from which on all of that is as large as it may be.
_WIDE_PICTURE = 16.0 / 9.0

# Number of pins at most, at the longest of these walls: more would hide the map.
_PINS = 8


def share_of(size: tuple[int, int]) -> float:
    """How large pins are in a picture of a size [pixels]: in a narrow one they would hide more."""
    width, height = size
    return min(1.0, width / height / _WIDE_PICTURE)


class Pins(NamedTuple):
    """Ribbons and pins at the walls that maps miss."""

    mark: Soft
    # (k, 3) where pins touch their walls, and where they end on the side that is missed [m].
    tips: Float
    ends: Float
    # What they say: how long a wall is, and why it is missed or, where maps have names, by which.
    words: list[str]

    @classmethod
    def of(cls, runs: Mapping[str, Any], away: float, place: Float) -> "Pins | None":
        """Those of maps of some runs from a distance, in a frame with an origin (3,) below them."""
        missed = dict[tuple[float, ...], list[str]]()
        for name, run in runs.items():
            parts, _, reasons = lost_walls(run)
            for wall, reason in zip(parts.tolist(), reasons, strict=True):
                missed.setdefault(tuple(wall), []).append(name or reason)
        lost = sorted(missed, key=lambda wall: -lengths(np.array([wall])).item())
        if not lost:
            return None
        walls = np.array(lost)
        start, end = (np.insert(each, 2, 0.0, axis=1) - place for each in np.hsplit(walls, 2))
        aside = away * np.insert(directions(walls) @ LEFT, 2, 0.0, axis=1)
        outer = end + _RIBBON * aside, start + _RIBBON * aside
        quads = np.stack([start, end, *outer], axis=1)[:, [0, 1, 2, 0, 2, 3]]
        tips = 0.5 * (start + end)[:_PINS]
        ends = tips + _PIN * aside[:_PINS]
        across = _WIDE * (ends - tips)[:, [1, 0, 2]] * [-1.0, 1.0, 0.0]
        pins = np.stack([tips, ends + across, ends - across], axis=1)
        corners = np.concatenate([quads.reshape(-1, 3, 3), pins])
        colours = np.tile([*FALSE_COLOUR, 1.0], (len(corners), 3, 1))
        reasons = [", ".join(filter(None, missed[wall])) for wall in lost[:_PINS]]
        said = [
            metres(long) + f" missed: {why}" * bool(why)
            for long, why in zip(lengths(walls).tolist(), reasons, strict=False)
        ]
        return cls(Soft(single(corners), single(colours), on_top=True), tips, ends, said)
