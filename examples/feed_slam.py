"""Feed the scans and wheels of a bag to any SLAM, and write its poses for `lrf3d score`.

lrf3d run city --no-video && lrf3d export out/city --to mcap
python examples/feed_slam.py out/city/run.mcap theirs.tum
lrf3d score out/city --trajectory theirs.tum
"""

import sys
from math import atan2, cos, sin
from pathlib import Path

from rosbags.highlevel import AnyReader


def update(scan, wheels):
    """The pose (x, y, theta) after a LaserScan and an Odometry: put your SLAM here."""
    turn, where = wheels.pose.pose.orientation, wheels.pose.pose.position
    return where.x, where.y, 2.0 * atan2(turn.z, turn.w)


with AnyReader([Path(sys.argv[1])]) as bag, open(sys.argv[2], "w") as tum:
    chosen = [each for each in bag.connections if each.topic in ("/odom", "/scan")]
    for connection, _, data in bag.messages(chosen):
        message = bag.deserialize(data, connection.msgtype)
        if connection.topic == "/odom":
            wheels = message
            continue
        x, y, theta = update(message, wheels)
        at, z, w = message.header.stamp, sin(theta / 2), cos(theta / 2)
        print(f"{at.sec}.{at.nanosec:09} {x} {y} 0 0 0 {z} {w}", file=tum)
