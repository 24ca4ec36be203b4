"""Pins: where in the world is what a story was about, and which walls its maps miss.

Places, the runs of maps and a look enter; pins, ribbons along missed walls, and their labels leave.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry.lines import LEFT, Float, directions, lengths
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.found import lost_walls
from lrf3d.studio.scene.look import FALSE_COLOUR, rgb
from lrf3d.studio.scene.shapes import Soft, single
from lrf3d.studio.scene.timeline import metres

# Colour of pins at what a story was about.
_COLOUR = rgb("#ffe9a3")

# Height of these pins, in the distance of the eye.
_HEIGHT = 0.018

# Width of ribbons along walls that the map misses, in the distance of the eye.
_RIBBON = 0.006

# Length of the pins that point at these walls, likewise.
_LENGTH = 0.025

# Half the width of the end of such a pin, in its length.
_WIDE = 0.6

# Width of a picture, in its height, from which on pins and ribbons have their full size.
_WIDE_PICTURE = 16.0 / 9.0

# Largest number of pins at missed walls, of which the longest have them: more would hide the map.
_MOST = 8


def share_of(size: tuple[int, int]) -> float:
    """How large pins are in a picture of a size [pixels]: in a narrow one they would hide more."""
    width, height = size
    return min(1.0, width / height / _WIDE_PICTURE)


def pointing(places: Float, height: float, view: Look, share: float) -> Soft:
    """Pins of a share of the full size that point at places (n, 2) at a height [m], unhidden."""
    tips = np.insert(places, 2, height, axis=1)
    right, up, _ = share * _HEIGHT * view.away * view.pose[:3, :3].T
    corners = np.stack([tips, tips + up - right, tips + up + right], axis=1)
    colours = np.tile([*_COLOUR, 1.0], (len(corners), 3, 1))
    return Soft(single(corners), single(colours), on_top=True)


class Pins(NamedTuple):
    """Ribbons and pins at the walls that maps miss."""

    mark: Soft
    # (k, 3) where pins touch their walls, and where they end on the side that is missed [m].
    tips: Float
    ends: Float
    # Their labels: how long a wall is, and why it is missed or, where maps have names, by which.
    words: list[str]

    @classmethod
    def of(cls, runs: Mapping[str, Any], away: float, place: Float) -> "Pins":
        """Those of maps of some runs from a distance, in a frame with an origin (3,) below them."""
        missed = dict[tuple[float, ...], list[str]]()
        for name, run in runs.items():
            lost = lost_walls(run)
            for wall, reason in zip(lost.parts.tolist(), lost.reasons, strict=True):
                missed.setdefault(tuple(wall), []).append(name or reason)
        longest = sorted(missed, key=lambda wall: -lengths(np.array([wall])).item())
        walls = np.array(longest).reshape(-1, 4)
        start, end = (np.insert(each, 2, 0.0, axis=1) - place for each in np.hsplit(walls, 2))
        aside = away * np.insert(directions(walls) @ LEFT, 2, 0.0, axis=1)
        outer = end + _RIBBON * aside, start + _RIBBON * aside
        quads = np.stack([start, end, *outer], axis=1)[:, [0, 1, 2, 0, 2, 3]]
        tips = 0.5 * (start + end)[:_MOST]
        ends = tips + _LENGTH * aside[:_MOST]
        across = _WIDE * (ends - tips)[:, [1, 0, 2]] * [-1.0, 1.0, 0.0]
        pins = np.stack([tips, ends + across, ends - across], axis=1)
        corners = np.concatenate([quads.reshape(-1, 3, 3), pins])
        colours = np.tile([*FALSE_COLOUR, 1.0], (len(corners), 3, 1))
        reasons = [", ".join(filter(None, missed[wall])) for wall in longest[:_MOST]]
        said = [
            metres(long) + f" missed: {why}" * bool(why)
            for long, why in zip(lengths(walls).tolist(), reasons, strict=False)
        ]
        return cls(Soft(single(corners), single(colours), on_top=True), tips, ends, said)
