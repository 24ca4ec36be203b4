"""A node of ROS 2 of your own: it follows walls, and maps them from the odometry of the robot.

    lrf3d ros corridor --rate 10            # in one terminal
    python examples/ros_wall_follower.py    # in another, with ROS 2 sourced; Ctrl-C saves the map

The same controller drives in simulations: see wall_follower.py.
"""

import sys
from math import atan2
from pathlib import Path

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

import lrf3d

sys.path.insert(0, str(Path(__file__).parent))
from wall_follower import WallFollower


class Follower(Node):
    """Answers each scan by a command, and maps it at the pose of its stamp."""

    def __init__(self):
        super().__init__("wall_follower")
        self.controller, self.mapper, self.poses = WallFollower(), lrf3d.LineMapper(), {}
        self.commands = self.create_publisher(Twist, "cmd_vel", 5)
        self.create_subscription(Odometry, "odom", self.remember, 50)
        self.create_subscription(LaserScan, "scan", self.follow, 5)

    def remember(self, message):
        """Keep the pose at a stamp."""
        where, turn = message.pose.pose.position, message.pose.pose.orientation
        stamp = message.header.stamp
        self.poses[stamp.sec, stamp.nanosec] = where.x, where.y, 2.0 * atan2(turn.z, turn.w)

    def follow(self, message):
        """Map a scan, and drive on."""
        stamp = message.header.stamp
        pose = self.poses.get((stamp.sec, stamp.nanosec))
        scan = lrf3d.LaserScan.from_ros(message, pose or (0.0, 0.0, 0.0))
        # Topics have no order among each other: a scan may come before its odometry.
        if pose is not None:
            self.mapper.update(scan)
        command = Twist()
        command.linear.x, command.angular.z = map(
            float, self.controller.command(scan.time, scan.pose, scan)
        )
        self.commands.publish(command)


def main():
    """Follow walls until Ctrl-C."""
    rclpy.init()
    node = Follower()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        lrf3d.save_map(node.mapper.map, "map.geojson")
        print(f"map.geojson: {len(node.mapper.map)} segments")


if __name__ == "__main__":
    main()
