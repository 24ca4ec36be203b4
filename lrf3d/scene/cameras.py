"""The cameras of a film by name: those of every world, and fixed ones that a world has."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lrf3d.scene.camera import Camera, Look, SmoothPath
from lrf3d.scene.following import Chase, First, Orbit
from lrf3d.scene.story import CLOSING, OPENING, Story
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.whole import Overview, Top
from lrf3d.world.cameras import FixedCamera, check_view

CAMERAS: dict[str, Callable[[Timeline, Structures], Camera]] = {
    "chase": Chase,
    "first": First,
    "orbit": Orbit,
    "overview": Overview,
    "story": Story,
    "top": Top,
}


def margins(view: str) -> tuple[float, float]:
    """How long a film goes on before the run starts and after it has ended [s of the film]."""
    return (OPENING, CLOSING) if view == "story" else (0.0, 0.0)


class Fixed:
    """Stands where the world says, and looks where it says, or turns with the robot.

    The farther off the robot is, the narrower is then its field: the robot stays in sight.
    """

    CALM = 12.5
    """Distance [m] from which on its field narrows."""
    NARROWEST = 0.15
    """What is left of its field at the least."""

    def __init__(self, camera: FixedCamera, timeline: Timeline) -> None:
        origin = timeline.origin
        place = np.array([*origin, 0.0])
        eye, target = np.array(camera.position) - place, np.array(camera.target) - place
        ahead = target - eye
        # Straight down or up there is no side that is up but the north.
        level = np.hypot(ahead[0], ahead[1]) > 1e-6 * abs(ahead[2])
        up = (0.0, 0.0, 1.0) if level else (0.0, 1.0, 0.0)
        field = float(np.radians(camera.field_deg))
        self._look = Look(eye, target, field, up=up, shot=camera.name)
        self._path = SmoothPath(timeline) if camera.track else None

    def look(self, time: float, aspect: float) -> Look:
        """The look at a time [s] of the run."""
        if self._path is None:
            return self._look
        eye, target = self._look.eye, np.array([*self._path.place(time), 0.4])
        narrow = np.clip(self.CALM / np.linalg.norm(target - eye), self.NARROWEST, 1.0)
        return replace(self._look, target=target, field=self._look.field * float(narrow))


def make_camera(view: str, timeline: Timeline, structures: Structures) -> Camera:
    """Make the camera of a name for a run, and what stands in its world.

    Raises:
        InputError: There is no camera of that name.
    """
    world = timeline.run.world
    check_view(view, world.cameras)
    if view in CAMERAS:
        return CAMERAS[view](timeline, structures)
    return Fixed(next(c for c in world.cameras if c.name == view), timeline)
