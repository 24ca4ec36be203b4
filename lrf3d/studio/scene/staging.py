"""Stagings: how the camera opens and ends a story, by what that is about."""

from typing import NamedTuple

import numpy as np

from lrf3d.studio.scene.look import Rig

# The side nearly behind the robot, which then does not hide what is ahead of it [rad].
_BEHIND = 3.0

# The side from which things in a line are seen next to each other [rad].
_ACROSS = 0.5 * np.pi


class Staging(NamedTuple):
    """How the camera opens and ends a story."""

    # The camera at first.
    first: Rig
    # Where it stands round the robot, from the direction of what the story is about [rad].
    side: float = _BEHIND
    # The camera after that; from where most of the picture is lit if it is not given.
    then: Rig | None = None
    # Where that stands [rad].
    then_side: float = 0.0
    # Whether walls have their full height at first, and are cut later.
    stands: bool = False
    # Where the camera stands in the end, from the line of what it turns to [rad].
    end_side: float = 0.0


# Stagings by what stories are about.
STAGINGS = {
    # Along the longest line of sight.
    "straight": Staging(Rig(5.5, 24.0, shift=-0.4)),
    # From the roofs down into the street.
    "roofs": Staging(Rig(22.0, 60.0), then=Rig(6.0, 14.0, shift=-0.3), then_side=_BEHIND),
    # At the mirror, which shows the robot.
    "mirror": Staging(
        Rig(3.4, 15.0, 56.0, -0.25),
        then=Rig(8.0, 30.0),
        then_side=2.7,
        stands=True,
        end_side=_ACROSS,
    ),
    # Through the pane.
    "pane": Staging(
        Rig(4.4, 14.0, shift=-0.2),
        side=0.3,
        then=Rig(7.0, 40.0),
        then_side=1.0,
        stands=True,
        end_side=_ACROSS,
    ),
    # Between the racks, and over them.
    "reflectors": Staging(Rig(3.6, 14.0, shift=-0.3), stands=True),
    # Over one robot to another.
    "robots": Staging(Rig(5.0, 22.0), then=Rig(13.0, 50.0), then_side=2.6),
    # From the side of what was recorded.
    "record": Staging(Rig(4.6, 26.0, shift=-0.1), side=0.7),
}
