"""The camera that stands still where a world has one."""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.look import Look
from lrf3d.world.cameras import FixedCamera


class Fixed:
    """Stands where the world says, and looks where it says."""

    def __init__(self, camera: FixedCamera, origin: Float) -> None:
        place = np.array([*origin, 0.0])
        eye, target = np.array(camera.position) - place, np.array(camera.target) - place
        ahead = target - eye
        # Straight down or up there is no side that is up but the north.
        level = np.hypot(ahead[0], ahead[1]) > 1e-6 * abs(ahead[2])
        up = (0.0, 0.0, 1.0) if level else (0.0, 1.0, 0.0)
        self._look = Look(eye, target, float(np.radians(camera.field_deg)), up=up)

    def look(self, time: float, aspect: float) -> Look:
        """The look, at any time."""
        return self._look
