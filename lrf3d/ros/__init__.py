"""ROS 2, live: a robot in a world that other programs see and drive, for ``lrf3d ros``."""

from lrf3d.ros.node import SecondClockError as SecondClockError
from lrf3d.ros.node import serve as serve
