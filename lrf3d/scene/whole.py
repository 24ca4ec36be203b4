"""Cameras that show the whole world: from one side, and from straight above."""

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.camera import Look, Track
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.town import STREET

_FREE_ABOVE, _FREE_BELOW, CARD = 0.19, 0.03, 0.15
"""Shares of the picture's height that the panel above has to itself, and what is below, which is
more where there is a card."""

_FILL = 0.94
"""Share of what is left that the world fills."""

_LARGEST, _AROUND = 600.0, 60.0
"""Worlds longer than this [m] are shown as far as something was driven and seen, and what of them
is shown around the path [m]."""

_TALLEST = 14.0
"""Height [m] up to which buildings are in the picture for certain."""


class Overview:
    """Looks at the whole world from one side, and drifts slowly round it."""

    FIELD = float(np.radians(34.0))
    STEEP, STEEP_INDOOR = np.radians(42.0), np.radians(56.0)
    """How steeply it looks down [rad]: more into rooms, so that near walls hide less."""
    SIDES = (np.radians(-112.0), np.radians(-22.0), np.radians(-67.0))
    """Where it may stand [rad]: from each, two sides of houses are seen on which the sun shines."""
    DRIFT, LONGEST = np.radians(1.2), 20.0
    """Angle per second of the film [rad/s], and for how many seconds before and after its middle:
    long films do not end at the back."""
    AIR = 2.6
    """Reach of the air's haze, in distances to the middle: the whole is seen through clear air."""

    def __init__(
        self, timeline: Timeline, structures: Structures, free_below: float = _FREE_BELOW
    ) -> None:
        self._timeline, self._free_below = timeline, free_below
        self._steep = float(self.STEEP_INDOOR if structures.indoor else self.STEEP)
        self._corners = corners_of(timeline, structures)
        self._tracks: dict[float, Track] = {}

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        return self.track(aspect).look(time, near=0.5, plan=False, shot="whole")

    def track(self, aspect: float) -> Track:
        """All looks, for pictures of an aspect."""
        if aspect not in self._tracks:
            fits = [self._fit(np.array([side]), aspect) for side in self.SIDES]
            # From the side from which the whole is as large as from any.
            best = min(range(len(fits)), key=lambda number: fits[number].aways[0])
            drift = self.DRIFT * np.linspace(-self.LONGEST, self.LONGEST, 9)
            self._tracks[aspect] = self._fit(self.SIDES[best] + drift, aspect)
        return self._tracks[aspect]

    def _fit(self, turns: Float, aspect: float) -> Track:
        steep, field, below = self._steep, self.FIELD, self._free_below
        middles, aways = zip(
            *(fit(self._corners, turn, steep, field, aspect, below) for turn in turns), strict=True
        )
        start, end = self._timeline.start, self._timeline.end
        reach = self.LONGEST * self._timeline.playback
        away, ones = np.array(aways), np.ones(len(turns))
        return Track(
            0.5 * (start + end) + np.linspace(-reach, reach, len(turns)),
            np.array(middles),
            turns,
            steep * ones,
            away,
            field * ones,
            (below - _FREE_ABOVE) * ones,
            self.AIR * away,
        )


class Top:
    """Looks down on the whole world."""

    FIELD = float(np.radians(3.0))
    """Nearly parallel rays: walls then do not lean over the map."""
    LONG = 1.2
    """A world this number of times as long as wide is turned where that fits the picture better."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        self._corners = corners_of(timeline, structures) * [1.0, 1.0, 0.0]
        self._tallest = float(structures.heights.max(initial=0.0))

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        wide, tall, _ = np.ptp(self._corners, axis=0)
        turned = (wide > tall) != (aspect > 1.0) and max(wide, tall) > self.LONG * min(wide, tall)
        turn = np.pi if turned else -0.5 * np.pi
        middle, away = fit(self._corners, turn, 0.5 * np.pi, self.FIELD, aspect)
        return Look(
            np.array([*middle[:2], away + self._tallest]),
            middle,
            self.FIELD,
            up=(-float(np.cos(turn)), -float(np.sin(turn)), 0.0),
            shift=_FREE_BELOW - _FREE_ABOVE,
            near=0.5 * away,
            clear=True,
            shows_map=True,
            plan=False,
            shot="whole",
        )


def corners_of(timeline: Timeline, structures: Structures) -> Float:
    """Corners (n, 3) of all that is to be in a picture of the whole [m]."""
    path = timeline.run.trajectory.poses[:, :2] - timeline.origin
    ends = structures.places
    if len(ends) and float(np.ptp(ends, axis=0).max()) > _LARGEST:
        low, high = path.min(axis=0) - _AROUND, path.max(axis=0) + _AROUND
        ends = ends[((ends >= low) & (ends <= high)).all(axis=1)]
    # Streets reach past the houses.
    past = 0.5 if structures.indoor else 0.5 * STREET
    beside = past * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    places = np.concatenate([ends, path])
    level = (places[:, None] + beside).reshape(-1, 2)
    level = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(level)))
    top = min(float(structures.heights.max(initial=0.0)), _TALLEST)
    return np.concatenate(
        [np.column_stack([level, np.full(len(level), height)]) for height in (0.0, top)]
    )


def fit(
    corners: Float,
    turn: float,
    steep: float,
    field: float,
    aspect: float,
    free_below: float = _FREE_BELOW,
) -> tuple[Float, float]:
    """The middle (3,) and distance [m] of the look whose free area shows corners (n, 3) largest.

    It looks from a side and that far down [rad].
    """
    level = np.cos(steep)
    back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.cross(back, right)
    whole = np.tan(0.5 * field)
    tall = _FILL * whole * (1.0 - _FREE_ABOVE - free_below)
    middle, away = 0.5 * (corners.min(axis=0) + corners.max(axis=0)), 1.0
    for _ in range(6):
        local = (corners - middle) @ np.column_stack([right, up, back])
        needed = np.maximum(
            np.abs(local[:, 0]) / (_FILL * whole * aspect), np.abs(local[:, 1]) / tall
        )
        away = max(float((needed + local[:, 2]).max()), 1.0)
        # What is nearer is larger: the middle of the picture is not that of the box.
        seen = local[:, :2] / (away - local[:, 2])[:, None]
        shift = 0.5 * (seen.max(axis=0) + seen.min(axis=0)) * away
        middle = middle + shift[0] * right + shift[1] * up
    return middle, away
