"""Programs that use ROS 2, and print what they saw as JSON: client.py NAME [ARGUMENT ...]"""

import json
import sys
import time
from itertools import pairwise
from math import atan2, hypot, nan, pi, remainder

import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def nanoseconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


class Watcher:
    """Keeps what a simulator publishes."""

    def __init__(self, namespace=""):
        rclpy.init()
        self.node = rclpy.create_node("watcher", namespace=namespace)
        self.scans, self.odometry, self.truth, self.clock, self.maps = [], [], [], [], []
        self.latency, self.frames, self.moved_at = [], set(), set()
        listen = self.node.create_subscription
        listen(LaserScan, "scan", self.hear_scan, qos_profile_sensor_data)
        listen(TFMessage, "tf", self.hear_frames, QoSProfile(depth=100))
        listen(TFMessage, "tf_static", self.hear_frames, LATCHED)
        listen(OccupancyGrid, "map", self.maps.append, LATCHED)
        listen(Odometry, "odom", self.odometry.append, 10)
        listen(Odometry, "ground_truth", self.truth.append, 10)
        listen(Clock, "/clock", self.hear_clock, qos_profile_sensor_data)
        self.spin(60, lambda: self.scans and self.truth and self.odometry and self.moved_at)

    def hear_scan(self, message, info):
        self.latency.append((time.time_ns() - info["source_timestamp"]) / 1e6)
        self.scans.append(message)

    def hear_frames(self, message):
        for one in message.transforms:
            self.frames.add((one.header.frame_id, one.child_frame_id))
            if one.child_frame_id.endswith("base_link"):
                self.moved_at.add(nanoseconds(one.header.stamp))

    def hear_clock(self, message):
        self.clock.append(nanoseconds(message.clock))

    def spin(self, seconds, until=lambda: False):
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def here(self, messages=None):
        pose = (self.truth if messages is None else messages)[-1].pose.pose
        turn = 2 * atan2(pose.orientation.z, pose.orientation.w)
        return pose.position.x, pose.position.y, turn

    def speed(self):
        return self.truth[-1].twist.twist.linear.x

    def report(self, **more):
        self.spin(0.3)
        stamps = [nanoseconds(scan.header.stamp) for scan in self.scans]
        # Transforms are not heard while their publisher is being found, and may lag at the end.
        since = min(self.moved_at) + 500_000_000
        last = max(self.moved_at)
        print(json.dumps({
            "scans": len(stamps),
            "steps": sorted({b - a for a, b in pairwise(stamps)}),
            "unplaced": sum(since <= t <= last and t not in self.moved_at for t in stamps),
            "latency": sorted(self.latency)[len(self.latency) // 2],
            "back": sum(b < a for a, b in pairwise(self.clock)),
            "frames": sorted(self.frames), "maps": len(self.maps),
            "beams": len(self.scans[-1].ranges), "frame": self.scans[-1].header.frame_id, **more,
        }))  # fmt: skip


def watch(seconds, namespace="", until=""):
    """Watch for a time, or until the robot moves or rests."""
    watcher = Watcher(namespace)
    begin = watcher.here()
    reached = {"": lambda: 0, "moves": watcher.speed, "rests": lambda: not watcher.speed()}
    watcher.spin(float(seconds), reached[until])
    end = watcher.here()
    watcher.report(moved=hypot(end[0] - begin[0], end[1] - begin[1]), speed=watcher.speed())


def square(kind, side=0.5):
    """Drive a square by odometry alone."""
    watcher, message = Watcher(), {"Twist": Twist, "TwistStamped": TwistStamped}[kind]
    publisher = watcher.node.create_publisher(message, "cmd_vel", 10)
    watcher.spin(60, publisher.get_subscription_count)

    def go(speed, turn):
        command = message()
        twist = getattr(command, "twist", command)
        twist.linear.x, twist.angular.z = speed, turn
        publisher.publish(command)
        watcher.spin(0.03)
        return watcher.here(watcher.odometry)

    start = here = go(0.0, 0.0)
    for leg in range(4):
        corner, aim = here, start[2] + leg * pi / 2
        while (left := side - hypot(here[0] - corner[0], here[1] - corner[1])) > 0.002:
            here = go(min(0.5, max(0.02, 1.5 * left)), 2.0 * remainder(aim - here[2], 2 * pi))
        while abs(turn := remainder(aim + pi / 2 - here[2], 2 * pi)) > 0.002:
            here = go(0.0, max(-1.2, min(1.2, 2.5 * turn)))
    end, true = go(0.0, 0.0), watcher.here()
    apart = [hypot(end[0] - x, end[1] - y) for x, y, _ in (start, true)]
    watcher.report(closed=apart[0], off=apart[1])


def push(kind="Twist"):
    """Publish a command until somebody ends this."""
    rclpy.init()
    node = rclpy.create_node("push")
    if kind == "PoseStamped":
        message = PoseStamped()
    else:
        message = Twist()
        message.linear.x = 0.1
    publisher = node.create_publisher(type(message), "cmd_vel", 5)
    while True:
        publisher.publish(message)
        time.sleep(0.05)


def record(folder, scans):
    """Record topics into a bag, as ros2 bag record does, until it has so many scans."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    rclpy.init()
    node, count = rclpy.create_node("record"), 0
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=8) as bag:

        def listen(kind, topic, quality):
            name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            connection = bag.add_connection(f"/{topic}", name, typestore=store)

            def write(data):
                nonlocal count
                bag.write(connection, time.time_ns(), data)
                count += topic == "scan"

            node.create_subscription(kind, topic, write, quality, raw=True)

        listen(LaserScan, "scan", 50)
        listen(Odometry, "odom", 500)
        listen(TFMessage, "tf", 500)
        listen(TFMessage, "tf_static", LATCHED)
        end = time.monotonic() + 300
        while count < int(scans) and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
    print(json.dumps({"scans": count}))


def orders(x, y):
    """Call each service, send valid and invalid poses and commands; a wall is at (x, y)."""
    watcher = Watcher()
    node, start, seen = watcher.node, watcher.here(), {}
    pause = node.create_client(SetBool, "pause")
    reset, step = (node.create_client(Trigger, name) for name in ("reset", "step"))
    to, command = (node.create_publisher(PoseStamped, "set_pose", 1),
                   node.create_publisher(Twist, "cmd_vel", 5))  # fmt: skip
    for client in (pause, reset, step):
        assert client.wait_for_service(60)
    watcher.spin(60, lambda: to.get_subscription_count() and command.get_subscription_count())

    def call(client, request):
        answer = client.call_async(request)
        rclpy.spin_until_future_complete(node, answer, timeout_sec=60)
        assert answer.result().success
        watcher.spin(1.0)
        return watcher.clock[-1]

    def place(frame, x, y=start[1]):
        message = PoseStamped()
        message.header.frame_id, message.pose.orientation.w = frame, 1.0
        message.pose.position.x, message.pose.position.y = x, y
        to.publish(message)
        watcher.spin(1.0)
        return watcher.here()[0] - start[0]

    stopped = call(pause, SetBool.Request(data=True))
    watcher.spin(0.5)
    seen["paused"] = watcher.clock[-1] - stopped
    seen["stepped"] = call(step, Trigger.Request()) - stopped
    call(pause, SetBool.Request(data=False))
    seen["placed"] = place("map", start[0] + 0.2)
    refused = ("base_link", 0.0), ("map", nan), ("map", float(x), float(y))
    seen["kept"] = [place(*where) for where in refused]
    fast, wrong = Twist(), Twist()
    fast.linear.x, wrong.linear.x = 0.1, nan
    fast.linear.y = 0.1
    command.publish(fast)
    watcher.spin(60.0, watcher.speed)
    seen["fast"] = watcher.speed()
    command.publish(wrong)
    watcher.spin(60.0, lambda: not watcher.speed())
    seen["stopped"] = watcher.speed()
    call(reset, Trigger.Request())
    seen["reset"] = [a - b for a, b in zip(watcher.here(), start, strict=True)]
    watcher.report(**seen)


if __name__ == "__main__":
    name, *words = sys.argv[1:]
    {each.__name__: each for each in (watch, square, push, record, orders)}[name](*words)
