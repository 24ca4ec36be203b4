"""The spaces of a DriveTask: what a robot sees and what it may do."""

import numpy as np
from gymnasium import spaces

from lrf3d.gym.task import DriveTask


def observation_space(task: DriveTask) -> spaces.Dict:
    """What one robot sees.

    ``ranges`` (beams,) [m] from 0 to range_max; ``goal`` (3,): its distance [m], and the cosine
    and the sine of its bearing, 1 and 0 ahead.
    """
    top = np.float32(task.lrf.range_max)
    far = np.float32(task.farthest)
    return spaces.Dict(
        {
            "goal": spaces.Box(
                np.array([0.0, -1.0, -1.0], np.float32), np.array([far, 1.0, 1.0], np.float32)
            ),
            "ranges": spaces.Box(np.float32(0.0), top, (task.lrf.beams,), np.float32),
        }
    )


def action_space() -> spaces.Box:
    """What one robot may do: shares from −1 to 1 of its top speed and of its fastest turn."""
    return spaces.Box(np.float32(-1.0), np.float32(1.0), (2,), np.float32)
