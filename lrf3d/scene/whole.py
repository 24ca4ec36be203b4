"""Cameras that show the whole world: from one side, and from straight above."""

from functools import cache

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.camera import Track, Tracked
from lrf3d.scene.ground import STREET
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline

_FREE_ABOVE, _FREE_BELOW, CARD = 0.05, 0.06, 0.10
"""Shares of the picture's height that are free above, and below for text, more for a card."""

_FILL = 0.94
"""Share of what is left that the world fills."""

_LARGEST, _AROUND = 600.0, 60.0
"""Worlds longer than this [m] are shown as far as something was driven and seen, and what of them
is shown around the path [m]."""

_TALLEST = 14.0
"""Height [m] up to which buildings are in the picture for certain."""


_FIELD = float(np.radians(34.0))
"""Angle of view of an overview [rad]."""

_STEEP, _STEEP_INDOOR = float(np.radians(42.0)), float(np.radians(56.0))
"""How steeply it looks down [rad]: more into rooms, so that near walls hide less."""

_SIDES = np.radians([-112.0, -22.0, -67.0])
"""Where it may stand [rad]: from each, two sides of houses are seen on which the sun shines."""

_ALL_SIDES = np.radians(np.arange(-100.0, 0.0, 5.0))
"""Where it stands in a story [rad]: there the whole is seen for seconds, so it is to be large."""

_DRIFT, _LONGEST = np.radians(1.2), 20.0
"""Angle per second of the film [rad/s] by which it goes round, and for how many seconds before and
after its middle: long films do not end at the back."""

_TOP_FIELD, _LONG = float(np.radians(3.0)), 1.2
"""Angle of view from straight above [rad]: rays are nearly parallel, so that no wall leans over
the map; and how many times as long as wide a world is that is turned to fit the picture better."""


def overview(
    timeline: Timeline,
    structures: Structures,
    free_below: float = _FREE_BELOW,
    at: float | None = None,
) -> Tracked:
    """Looks at the whole world from one side, and drifts slowly round it.

    It stands at that side at a time [s] of a story, or else in the middle of the run.
    """
    corners = corners_of(timeline, structures)
    passed = np.linspace(-_LONGEST, _LONGEST, 9)
    middle = 0.5 * (timeline.start + timeline.end) if at is None else at
    times = middle + passed * timeline.playback
    steep = _STEEP_INDOOR if structures.indoor else _STEEP

    @cache
    def track(aspect: float) -> Track:
        shape = steep, _FIELD, aspect, free_below
        # From the side from which the whole is as large as from any.
        sides = (_SIDES if at is None else _ALL_SIDES)[:, None]
        tracks = [_fit(corners, times[:1], side, *shape) for side in sides]
        side = min(tracks, key=lambda track: float(track.aways[0])).turns[0]
        return _fit(corners, times, side + _DRIFT * passed, *shape)

    return Tracked(track, {"cuts": True, "shot": "whole"})


def top(timeline: Timeline, structures: Structures) -> Tracked:
    """Looks down on the whole world."""
    corners = corners_of(timeline, structures) * [1.0, 1.0, 0.0]
    wide, tall, _ = np.ptp(corners, axis=0)

    @cache
    def track(aspect: float) -> Track:
        turned = (wide > tall) != (aspect > 1.0) and max(wide, tall) > _LONG * min(wide, tall)
        turn = np.array([np.pi if turned else -0.5 * np.pi])
        found = _fit(corners, np.zeros(1), turn, 0.5 * np.pi, _TOP_FIELD, aspect, _FREE_BELOW)
        tallest = float(structures.heights.max(initial=0.0))
        return found._replace(aways=found.aways + tallest)

    return Tracked(track, {"shows_map": True, "plan": False, "shot": "whole"})


def corners_of(timeline: Timeline, structures: Structures) -> Float:
    """Corners (n, 3) of all that is to be in a picture of the whole [m]."""
    path = timeline.run.trajectory.poses[:, :2] - timeline.origin
    ends = structures.places
    if len(ends) and float(np.ptp(ends, axis=0).max()) > _LARGEST:
        low, high = path.min(axis=0) - _AROUND, path.max(axis=0) + _AROUND
        ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
    # Streets reach past the houses.
    past = 0.5 if structures.indoor else 0.5 * STREET
    square = past * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    level = (np.concatenate([ends, path])[:, None] + square).reshape(-1, 2)
    level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
    top = min(float(structures.heights.max(initial=0.0)), _TALLEST)
    return np.concatenate(
        [np.column_stack([level, np.full(len(level), height)]) for height in (0.0, top)]
    )


def _fit(
    corners: Float,
    times: Float,
    turns: Float,
    steep: float,
    field: float,
    aspect: float,
    free_below: float,
) -> Track:
    """Looks from sides (k,) [rad], that steep [rad], that show corners (n, 3) as large as fits."""
    found = []
    whole = np.tan(0.5 * field)
    room = _FILL * whole * np.array([aspect, 1.0 - _FREE_ABOVE - free_below])
    for turn in turns:
        level = np.cos(steep)
        back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        axes = np.column_stack([right, np.cross(back, right)])
        middle, away = 0.5 * (corners.min(axis=0) + corners.max(axis=0)), 1.0
        for _ in range(6):
            local, near = (corners - middle) @ axes, (corners - middle) @ back
            away = max(float(((np.abs(local) / room).max(axis=1) + near).max()), 1.0)
            # What is nearer is larger: the middle of the picture is not that of the box.
            seen = local / (away - near)[:, None]
            middle = middle + axes @ (0.5 * away * (seen.max(axis=0) + seen.min(axis=0)))
        found.append((*middle, away))
    *place, aways = np.array(found).T
    steeps, fields, shifts = (
        np.full(len(turns), each) for each in (steep, field, free_below - _FREE_ABOVE)
    )
    return Track(times, np.column_stack(place), turns, steeps, aways, fields, shifts)
