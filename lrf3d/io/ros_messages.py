"""Messages of ROS 2, made from lrf3d's own values by the definitions of rosbags."""

from math import cos, sin
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.io.bag_messages import ECHOES, ODOMETRY, SCAN, TRANSFORMS
from lrf3d.laser import LaserScan, RosEchoScan, RosScan, Stamp
from lrf3d.pose import Pose

MAP, WORLD, BASE, LASER = "map", "odom", "base_link", "laser"
"""The frames: of the map and of the world, which are the same; of the robot, and of its laser."""


class Messages:
    """The messages of a bag, made from lrf3d's own values."""

    def __init__(self, types: dict[str, Any]) -> None:
        self._types = types

    def make(self, kind: str, *values: Any) -> Any:
        """A message of a type with these values, in their order."""
        return self._types[kind](*values)

    def header(self, stamp: Stamp, frame: str) -> Any:
        """The header of a message in a frame."""
        time = self.make("builtin_interfaces/msg/Time", stamp.sec, stamp.nanosec)
        return self.make("std_msgs/msg/Header", time, frame)

    def turn(self, theta: float) -> Any:
        """The quaternion of a heading [rad]."""
        return self.make(
            "geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * theta), cos(0.5 * theta)
        )

    def transform(
        self, stamp: Stamp, parent: str, child: str, pose: Pose, height: float = 0.0
    ) -> Any:
        """The transform of a frame in its parent, at a height [m] above it."""
        place = self.make("geometry_msgs/msg/Vector3", pose.x, pose.y, height)
        moved = self.make("geometry_msgs/msg/Transform", place, self.turn(pose.theta))
        header = self.header(stamp, parent)
        return self.make("geometry_msgs/msg/TransformStamped", header, child, moved)

    def transforms(self, *stamped: Any) -> Any:
        """The message of some transforms."""
        return self.make(TRANSFORMS, list(stamped))

    def clock(self, stamp: Stamp) -> Any:
        """What time it is in the bag."""
        time = self.make("builtin_interfaces/msg/Time", stamp.sec, stamp.nanosec)
        return self.make("rosgraph_msgs/msg/Clock", time)

    def odometry(self, stamp: Stamp, pose: Pose, speed: Float) -> Any:
        """The robot in the world, and its speed ahead [m/s] and about itself [rad/s]."""
        certain = np.zeros(36)
        vector = "geometry_msgs/msg/Vector3"
        place = self.make("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        where = self.make("geometry_msgs/msg/Pose", place, self.turn(pose.theta))
        ahead = self.make(vector, float(speed[0]), 0.0, 0.0)
        about = self.make(vector, 0.0, 0.0, float(speed[1]))
        return self.make(
            ODOMETRY,
            self.header(stamp, WORLD),
            BASE,
            self.make("geometry_msgs/msg/PoseWithCovariance", where, certain),
            self.make(
                "geometry_msgs/msg/TwistWithCovariance",
                self.make("geometry_msgs/msg/Twist", ahead, about),
                certain,
            ),
        )

    def scan(self, scan: LaserScan, scan_time: float) -> Any:
        """The scan as a ROS message."""
        content = scan.as_ros(LASER, scan_time=scan_time)
        return self._scan(SCAN, content, content.ranges, content.intensities)

    def echoes(self, scan: LaserScan, scan_time: float) -> Any:
        """The echoes of the scan as a ROS message."""
        content = scan.as_ros_echoes(LASER, scan_time=scan_time)
        columns = [
            [self.make("sensor_msgs/msg/LaserEcho", beam.echoes) for beam in column]
            for column in (content.ranges, content.intensities)
        ]
        return self._scan(ECHOES, content, *columns)

    def _scan(self, kind: str, content: RosScan | RosEchoScan, *columns: Any) -> Any:
        """A message of a kind with the fields that both have, and its columns."""
        return self.make(
            kind,
            self.header(content.header.stamp, content.header.frame_id),
            content.angle_min,
            content.angle_max,
            content.angle_increment,
            content.time_increment,
            content.scan_time,
            content.range_min,
            content.range_max,
            *columns,
        )
