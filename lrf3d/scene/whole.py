"""Cameras that show the whole world: from one side, and from straight above."""

from dataclasses import replace

import numpy as np
import shapely

from lrf3d.geometry import Float
from lrf3d.scene.camera import Look, SmoothPath
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.town import STREET

_FREE_ABOVE, _FREE_BELOW, CARD = 0.17, 0.03, 0.14
"""Shares of the picture's height that the panel above has to itself, and what is below, which is
more where there is a card."""

_FILL = 0.94
"""Share of what is left that the world fills."""

_LARGEST = 600.0
"""Worlds longer than this [m] are shown as far as something was driven and seen."""

_AROUND = 60.0
"""What of these is shown around the path [m]."""

_TALLEST = 14.0
"""Height [m] up to which buildings are in the picture for certain."""


class Overview:
    """Looks at the whole world from one side, and drifts slowly round it."""

    FIELD = float(np.radians(34.0))
    STEEP, STEEP_INDOOR = np.radians(42.0), np.radians(56.0)
    """How steeply it looks down [rad]: more into rooms, so that near walls hide less."""
    SIDES = (np.radians(-112.0), np.radians(-22.0), np.radians(-67.0))
    """Where it may stand [rad]: from each, two sides of houses are seen on which the sun shines."""
    DRIFT = np.radians(1.2)
    """Angle per second of the film [rad/s]."""
    AIR = 2.6
    """Reach of the air's haze, in distances to the middle: the whole is seen through clear air."""

    def __init__(
        self, timeline: Timeline, structures: Structures, free_below: float = _FREE_BELOW
    ) -> None:
        self._timeline, self._free_below = timeline, free_below
        self._steep = self.STEEP_INDOOR if structures.indoor else self.STEEP
        self._corners = corners_of(timeline, structures)
        self._sides: dict[float, float] = {}

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        if aspect not in self._sides:
            # From the side from which the whole is as large as from any.
            away = [np.linalg.norm(self._from(turn, aspect).eye) for turn in self.SIDES]
            self._sides[aspect] = self.SIDES[int(np.argmin(away))]
        passed = (time - self._timeline.start) / self._timeline.playback
        length = (self._timeline.end - self._timeline.start) / self._timeline.playback
        # At its middle time it stands at that side; long films do not end at the back.
        drift = self.DRIFT * float(np.clip(passed - 0.5 * length, -20.0, 20.0))
        return self._from(self._sides[aspect] + drift, aspect)

    def _from(self, turn: float, aspect: float) -> Look:
        fitted = fit(self._corners, turn, self._steep, self.FIELD, aspect, self._free_below)
        away = float(np.linalg.norm(fitted.eye - fitted.target))
        return replace(fitted, air=self.AIR * away)


class Top:
    """Looks down on the whole world, or follows the robot where the world is large."""

    FIELD = float(np.radians(3.0))
    """Nearly parallel rays: walls then do not lean over the map."""
    WINDOW = 70.0
    """Shorter side [m] of what is seen of a large world."""
    LONG = 1.2
    """A world so many times as long as wide is turned where that fits the picture better."""

    def __init__(self, timeline: Timeline, structures: Structures) -> None:
        ends = structures.places if len(structures.places) else np.array([[-1.0, -1], [1, 1]])
        self._size = np.ptp(ends, axis=0)
        level = ends if float(self._size.max()) <= _LARGEST else None
        self._ends = None if level is None else np.column_stack([level, np.zeros(len(level))])
        self._path = SmoothPath(timeline)
        self._tallest = float(structures.heights.max(initial=0.0))

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        turn, corners = -0.5 * np.pi, self._ends
        if corners is None:
            side = 0.5 * self.WINDOW * np.array([[-1, -1, 0], [1, 1, 0]])
            corners = side + np.append(self._path.place(time), 0.0)
        elif (self._size[0] > self._size[1]) != (aspect > 1.0) and (
            self._size.max() > self.LONG * self._size.min()
        ):
            turn = np.pi
        seen = fit(corners, turn, 0.5 * np.pi, self.FIELD, aspect)
        rise = np.array([0.0, 0.0, self._tallest])
        near = 0.5 * float(seen.eye[2])
        return replace(seen, eye=seen.eye + rise, near=near, clear=True, shows_map=True)


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
) -> Look:
    """The look from a side, that far down [rad], whose free area shows corners (n, 3) largest."""
    level = np.cos(steep)
    back = np.array([np.cos(turn) * level, np.sin(turn) * level, np.sin(steep)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.cross(back, right)
    whole = np.tan(0.5 * field)
    tall = _FILL * whole * (1.0 - _FREE_ABOVE - free_below)
    target, away = 0.5 * (corners.min(axis=0) + corners.max(axis=0)), 1.0
    for _ in range(6):
        local = (corners - target) @ np.column_stack([right, up, back])
        needed = np.maximum(
            np.abs(local[:, 0]) / (_FILL * whole * aspect), np.abs(local[:, 1]) / tall
        )
        away = max(float((needed + local[:, 2]).max()), 1.0)
        # What is nearer is larger: the middle of the picture is not that of the box.
        seen = local[:, :2] / (away - local[:, 2])[:, None]
        shift = 0.5 * (seen.max(axis=0) + seen.min(axis=0)) * away
        target = target + shift[0] * right + shift[1] * up
    return Look(
        target + away * back,
        target,
        field,
        up=tuple(up.tolist()),
        shift=free_below - _FREE_ABOVE,
        near=0.5,
        plan=False,
        shot="whole",
    )
