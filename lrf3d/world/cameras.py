"""Cameras: fixed ones in a world, by name, and the default camera of a film."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from lrf3d.base.errors import WorldError, check_names, expect, shown
from lrf3d.geometry.lines import LARGEST_COORDINATE, is_finite, number

# Names of the cameras that every world has; they follow the robot or show everything.
MOVING_VIEWS = ("chase", "first", "orbit", "overview", "story", "top")

# Largest angle of view of a fixed camera [degrees].
_WIDEST = 170.0

# Least number of simulated seconds in a second of a film without a playback of its own.
_PLAYBACK = 4.0

# Longest time that a run takes in such a film [s]: a story takes 40 s, also of a log of an hour.
_LONGEST = 31.0


@dataclass(frozen=True, slots=True)
class FixedCamera:
    """A fixed camera.

    Args:
        name: Its name, other than those of the cameras that every world has.
        position: x, y, z of the camera [m].
        target: x, y, z of the point in the middle of the picture [m].
        field_deg: Angle of view from the bottom to the top of the picture [degrees], below 170.
        track: Whether it turns with the robot, which is then in the middle.
    """

    name: str
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field_deg: float = 50.0
    track: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name in ("", *MOVING_VIEWS):
            expected = f"expected a name other than {', '.join(MOVING_VIEWS)}"
            raise WorldError(f"camera name {shown(self.name)}: {expected}")
        for key in ("position", "target"):
            point: Any = getattr(self, key)
            try:
                x, y, z = map(float, point)
            except (TypeError, ValueError, OverflowError):
                x = y = z = math.nan
            near = all(abs(each) <= LARGEST_COORDINATE for each in (x, y, z))
            self._check(near, key, "x, y, z [m]")
            object.__setattr__(self, key, (x, y, z))
        self._check(self.position != self.target, "target", "another point than the position")
        fits = is_finite(self.field_deg) and 0.0 < self.field_deg < _WIDEST
        self._check(fits, "field_deg", "more than 0 and less than 170")
        self._check(self.track in (False, True), "track", "a bool")

    def _check(self, good: bool, key: str, expected: str) -> None:
        if not good:
            found = f"{key} is {shown(getattr(self, key))}"
            raise WorldError(f"camera {self.name!r}: {found}, expected {expected}")

    def scaled(self, factor: float) -> "FixedCamera":
        """The camera with x and y scaled; heights stay the same."""
        x, y, z = self.position
        x2, y2, z2 = self.target
        return replace(
            self, position=(factor * x, factor * y, z), target=(factor * x2, factor * y2, z2)
        )


@dataclass(frozen=True, slots=True)
class FilmPlan:
    """The default settings of a film.

    Its view is a camera that every world has, or one of the world's; its playback is the number of
    simulated seconds in a second, None for 4 or, of long runs, as many as keep the film short. The
    colour of hit points shows their ``range`` or ``intensity``.
    """

    view: str = "story"
    playback: float | None = None
    points_by: Annotated[str, ("range", "intensity")] = "range"

    def __post_init__(self) -> None:
        expect(self.view, str, "film: view")
        if self.playback is not None:
            number(self.playback, "film: playback", positive=True)

    def playback_of(self, duration: float) -> float:
        """The playback of a run that takes some time [s]."""
        return max(_PLAYBACK, duration / _LONGEST) if self.playback is None else self.playback


# The default settings of films without others.
USUAL_FILM = FilmPlan()


def check_view(view: str, cameras: Sequence[FixedCamera]) -> None:
    """Check that a view is one that every world has, or one of the cameras."""
    check_names("view", [view], [*MOVING_VIEWS, *(camera.name for camera in cameras)])
