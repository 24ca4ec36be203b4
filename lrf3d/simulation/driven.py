"""Driven bodies: how a robot moves that holds a twist among walls and obstacles.

Twists enter; poses and collisions leave. Drives of controllers, live robots and fleets each have a
`Driven`, and environments drive arrays of bodies by `hold_all`: a body that touches something rests
there until it gets its next twist.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.collision import Body, Collision, CollisionChecker
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.geometry.pose import Pose
from lrf3d.robot.kinematics import Twist, arcs, hold

# The twist of a robot at rest.
STILL: Twist = (0.0, 0.0, 0.0)


class Driven:
    """A body at a pose and a time [s], which drives on exact arcs, one twist after the other.

    Without a checker it drives through everything. Its attribute ``twist`` is the current one,
    ``since`` the time [s] and the pose at which it began, and ``collision`` that of the last twist.
    """

    def __init__(
        self, pose: Pose, time: float, body: Body | None, checker: CollisionChecker | None
    ) -> None:
        self.time = time
        self._body = body
        self._checker = checker
        self.place(pose)

    def place(self, pose: Pose) -> None:
        """Put the body at rest at a pose."""
        self.pose = pose
        self.collision: Collision | None = None
        self.rest()

    def rest(self) -> None:
        """Rest from now on."""
        self.twist = STILL
        self.since = self.time, self.pose

    def hold(
        self, twist: Twist, seconds: float, *, ahead: float = 0.0, end: Pose | None = None
    ) -> Collision | None:
        """Hold a twist for a time [s]; a body that touches something rests there.

        Args:
            twist: The twist.
            seconds: The time [s], at the end of which the robot is.
            ahead: Further time [s] in which it may drive on by `at`, and touch something.
            end: Where the twist leads, if it is known; its arc if not given.

        Returns:
            The collision, or None.
        """
        start = self.pose
        self.rest()
        self.twist = twist
        self.collision = self.touched(start, twist, seconds + ahead)
        self.time += seconds
        if self.collision is not None and self.collision.time < self.time:
            self.stop(self.collision)
        else:
            self.pose = hold(start, twist, seconds) if end is None else end
        return self.collision

    def touched(self, pose: Pose, twist: Twist, seconds: float) -> Collision | None:
        """The first collision in a time [s] in which a twist is held from a pose, or None."""
        if self._checker is None or self._body is None:
            return None
        return self._checker.held(self._body, pose, twist, self.time, seconds)

    def stop(self, collision: Collision) -> None:
        """Rest where a collision is on the arc of the twist."""
        self.collision = collision
        self.pose = self.passed(collision.time)
        self.twist = STILL
        self.since = collision.time, self.pose

    def passed(self, time: float) -> Pose:
        """Where the body was at a time [s] since the twist began."""
        begin, start = self.since
        return hold(start, self.twist, time - begin) if time > begin else start

    def at(self, times: Float) -> Float:
        """Poses (n, 3) at times (n,) [s] from now on: farther on the arc, up to a collision."""
        end = np.inf if self.collision is None else self.collision.time
        held = np.maximum(np.minimum(times, end) - self.time, 0.0)
        return np.array([hold(self.pose, self.twist, seconds) for seconds in held.tolist()])

    def go_on(self, time: float) -> None:
        """Drive on along the arc to a time [s]."""
        self.pose = Pose(*self.at(np.array([time]))[0].tolist())
        self.time = time


def hold_all(
    checker: CollisionChecker, body: Body, moves: Records, seconds: Float, own: Int
) -> tuple[Float, NDArray[np.bool_]]:
    """Hold moves (k,) of unicycles for times (k,) [s], as `Driven.hold` does for each.

    Own (k,) are the obstacles that are the bodies themselves, or −1. It returns the poses (k, 3)
    after that time, and which bodies have touched something.
    """
    touched = checker.touch(body, moves, seconds, own)[0]
    poses = np.column_stack([moves["x"], moves["y"], moves["theta"]])
    ends = arcs(poses, moves["ahead"], moves["turn"], np.minimum(seconds, touched))
    return ends, touched < np.inf
