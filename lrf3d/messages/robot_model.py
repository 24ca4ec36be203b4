"""The robot as URDF, for ROS programs that draw it or compute the poses of its links.

A radius, lasers and a prefix of frames enter; text leaves. The wheels are continuous joints.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lrf3d.laser import LaserRangeFinder
from lrf3d.messages.ros import BASE, FOOTPRINT

# Height of the body, as a share of the robot's radius.
BODY_HEIGHT = 0.6

# Size of a laser's housing [m].
LASER_SIZE = 0.06


class Wheel(NamedTuple):
    """A driven wheel: its name, its offset to the left of the centre [m], and its radius [m]."""

    name: str
    left: float
    radius: float

    @property
    def joint(self) -> str:
        """The name of its joint."""
        return f"{self.name}_joint"

    def angle(self, ahead: float, turn: float) -> float:
        """Its rotation [rad] while the robot drives ahead [m] and turns [rad]."""
        return (ahead - self.left * turn) / self.radius


def wheels_of(radius: float) -> tuple[Wheel, Wheel]:
    """The wheels of a robot with a radius [m]: inside its outline, with a quarter of its radius."""
    size = 0.25 * radius
    left = radius - size
    return Wheel("left_wheel", left, size), Wheel("right_wheel", -left, size)


def urdf(radius: float, lasers: Sequence[LaserRangeFinder], *, prefix: str = "") -> str:
    """The URDF of a robot with a radius [m] and lasers; the prefix precedes all names."""
    height = BODY_HEIGHT * radius
    base = prefix + BASE
    parts = [
        _link(base, f'<cylinder radius="{radius:g}" length="{height:g}"/>', z=0.5 * height),
        _link(prefix + FOOTPRINT),
        _joint(base, prefix + FOOTPRINT),
    ]
    for wheel in wheels_of(radius):
        name = prefix + wheel.name
        shape = f'<cylinder radius="{wheel.radius:g}" length="{0.2 * radius:g}"/>'
        parts.append(_link(name, shape, roll=0.5 * math.pi))
        parts.append(
            _joint(base, name, (0.0, wheel.left, wheel.radius), joint=prefix + wheel.joint)
        )
    for lrf in lasers:
        name = prefix + lrf.name
        parts.append(_link(name, f'<box size="{LASER_SIZE} {LASER_SIZE} {LASER_SIZE}"/>'))
        x, y, theta = lrf.mount
        parts.append(_joint(base, name, (x, y, lrf.height), theta))
    return "\n".join(['<robot name="lrf3d">', *parts, "</robot>\n"])


def _link(name: str, shape: str = "", *, z: float = 0.0, roll: float = 0.0) -> str:
    if not shape:
        return f'  <link name="{name}"/>'
    place = f'<origin xyz="0 0 {z:g}" rpy="{roll:g} 0 0"/>'
    seen = f"<visual>{place}<geometry>{shape}</geometry></visual>"
    return f'  <link name="{name}">{seen}</link>'


def _joint(
    parent: str,
    child: str,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    theta: float = 0.0,
    *,
    joint: str = "",
) -> str:
    """A joint: with a name it turns about a wheel's axis, without one it is fixed."""
    kind = "continuous" if joint else "fixed"
    axis = '<axis xyz="0 1 0"/>' if joint else ""
    x, y, z = place
    return (
        f'  <joint name="{joint or child + "_mount"}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x:g} {y:g} {z:g}" rpy="0 0 {theta:g}"/>'
        f"{axis}</joint>"
    )
