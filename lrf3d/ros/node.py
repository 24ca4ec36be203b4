"""The stream of a live robot as a node of ROS 2: publishers, subscribers and services.

Only this module imports rclpy.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from math import atan2, inf
from time import monotonic
from typing import Any

from lrf3d.base.errors import InputError, MissingLibraryError, expect
from lrf3d.base.interrupts import MOMENT, asked, check
from lrf3d.ros.stream import CLOCK, DrivenRobot, Encoded, Settings, Stream
from lrf3d.simulation.scenario import Scenario

# The error if another clock is found at the start, and the warning if it is found later.
SECOND_CLOCK = (
    f"another program publishes {CLOCK.name}; pass --no-clock, or set another ROS_DOMAIN_ID"
)

# Wall time from one check of foreign topics to the next [s]: they change when programs start.
CHECKED_EVERY = 2.0

# Wall time from a warning to the same one [s], so that a log stays readable.
SAID_EVERY = 5.0

# How long another publisher of the clock is looked for [s]. One on this machine is found in a
# tenth, but what a busy machine loses is repeated after 3 s.
DISCOVERY = 4.0

# Types of commands that are obeyed.
COMMANDS = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


class SecondClockError(InputError):
    """Another program publishes the simulated time."""


def require_ros() -> None:
    """Check that ROS 2 is installed."""
    try:
        import_module("rclpy")
        import_module("tf2_msgs.msg")
    except ImportError as error:
        raise MissingLibraryError(
            f"ROS 2 is not there ({error}); source it (. /opt/ros/DISTRO/setup.sh), or install its"
            " wheels into an environment of their own, as scripts/ros does"
        ) from None


class Node:
    """Publishers, subscribers and services of a stream; it spins in the calling thread."""

    def __init__(self, namespace: str, arguments: Sequence[str]) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._contexts = list[Any]()
        self._nodes = list[Any]()
        self._executors = list[Any]()
        # Fast DDS knows one type a topic in each participant, so TwistStamped has its own.
        for name in ("lrf3d", "lrf3d_stamped"):
            context = rclpy.Context()
            options = SignalHandlerOptions.NO
            rclpy.init(args=list(arguments), context=context, signal_handler_options=options)
            self._contexts.append(context)
            self._nodes.append(rclpy.create_node(name, namespace=namespace, context=context))
            self._executors.append(SingleThreadedExecutor(context=context))
            self._executors[-1].add_node(self._nodes[-1])
        self._publishers = dict[str, Any]()
        self._said = dict[str, float]()
        self._commands = list[str]()
        # Types of messages that are subscribed to.
        self._heard = list[str]()
        self._checked = monotonic()
        self._discovered = self._checked + DISCOVERY

    def close(self) -> None:
        """Leave the network."""
        for node, context in zip(self._nodes, self._contexts, strict=True):
            node.destroy_node()
            context.try_shutdown()

    def say(self, level: str, text: str) -> None:
        """Log a message; the same warning not again for a while."""
        now = monotonic()
        log = self._nodes[0].get_logger()
        if level == "info":
            log.info(text)
        elif now > self._said.get(text, -inf) + SAID_EVERY:
            self._said[text] = now
            # rclpy lets a line of code log at one level only.
            log.error(text) if level == "error" else log.warning(text)

    def connect(self, stream: Stream) -> None:
        """Make the publishers of a stream, and subscribe it to commands and services.

        Raises:
            SecondClockError: Somebody else publishes the simulated time.
        """
        from rclpy.qos import DurabilityPolicy, QoSProfile

        only = stream.settings.commands
        self._heard = [kind for kind in COMMANDS if only in ("both", kind.split("/")[-1])]
        node = self._nodes[0]
        while stream.settings.clock and monotonic() < self._discovered and not asked():
            if any(each.count_publishers(CLOCK.name) for each in self._nodes):
                raise SecondClockError(SECOND_CLOCK)
            # A spin may return at once.
            self.spin(MOMENT)
        for topic in stream.topics:
            # Reliable publishers serve subscribers of either kind.
            quality = QoSProfile(depth=topic.depth)
            if topic.latched:
                quality.durability = DurabilityPolicy.TRANSIENT_LOCAL
            publisher = node.create_publisher(_type(topic.type), topic.name, quality)
            self._publishers[topic.name] = publisher
        for robot in stream.robots:
            self._subscribe(robot)

        def serve(kind: str, name: str, work: Callable[[Any], object]) -> None:
            def answered(request: Any, answer: Any) -> Any:
                work(request)
                answer.success = True
                return answer

            node.create_service(_type(f"std_srvs/srv/{kind}"), name, answered)

        serve("SetBool", "pause", lambda request: setattr(stream, "paused", request.data))
        serve("Trigger", "reset", lambda _: stream.reset())
        serve("Trigger", "step", lambda _: self.publish(stream.encoded(stream.step())))

    def _subscribe(self, robot: DrivenRobot) -> None:
        def place(message: Any) -> None:
            where = message.pose.position
            turn = message.pose.orientation
            pose = where.x, where.y, 2.0 * atan2(turn.z, turn.w)
            robot.set_pose(message.header.frame_id, pose)

        from rclpy.qos import QoSProfile, ReliabilityPolicy

        # Such a subscriber also works with reliable publishers.
        quality = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        name = f"{robot.prefix}cmd_vel"
        for node, kind in zip(self._nodes, COMMANDS, strict=True):
            if kind in self._heard:
                subscription = node.create_subscription(_type(kind), name, robot.obey, quality)
        self._commands.append(subscription.topic_name)
        kind = _type("geometry_msgs/msg/PoseStamped")
        self._nodes[0].create_subscription(kind, f"{robot.prefix}set_pose", place, 1)

    def publish(self, messages: Encoded) -> None:
        """Publish messages in their order."""
        for topic, data in messages:
            self._publishers[topic.name].publish(data)

    def spin(self, seconds: float) -> None:
        """Serve callbacks for a time [s]; at least those that are waiting."""
        end = monotonic() + seconds
        for executor in self._executors:
            executor.spin_once(timeout_sec=0.0)
        while (left := end - monotonic()) > 0.0 and not asked():
            self._executors[0].spin_once(timeout_sec=min(left, MOMENT))
        if monotonic() > self._checked + CHECKED_EVERY:
            self._checked = monotonic()
            self._check_others()

    def _check_others(self) -> None:
        """Warn about another clock, and about commands of a type that is not subscribed to."""
        if CLOCK.name in self._publishers and self._nodes[0].count_publishers(CLOCK.name) > 1:
            self.say("error", SECOND_CLOCK)
        for name in self._commands:
            for each in self._nodes[0].get_publishers_info_by_topic(name):
                if each.topic_type not in self._heard:
                    expected = " or ".join(self._heard)
                    self.say("warning", f"{name} of type {each.topic_type}: expected {expected}")


def _type(name: str) -> Any:
    package, kind, name = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def serve(
    scenario: Scenario,
    *,
    arguments: Sequence[str] = (),
    started: Callable[[str], None] = lambda text: None,
    **settings: Any,
) -> None:
    """Serve a robot in ROS 2 until the program is interrupted.

    Args:
        scenario: The world, and its robot and laser; a route is not needed.
        arguments: Arguments of ROS, such as ``--ros-args -r scan:=base_scan``.
        started: Called with a line once the topics are there.
        **settings: The fields of :class:`lrf3d.ros.stream.Settings`.

    Raises:
        MissingLibraryError: ROS 2 is not there.
        SecondClockError: Another program publishes the clock.
        InputError: A setting is invalid.
    """
    expect(scenario, Scenario, "scenario")
    require_ros()
    chosen = Settings(**settings)
    node = Node(chosen.namespace, arguments)
    try:
        stream = Stream(scenario.with_route(), chosen, node.say)
        node.connect(stream)
        rate = 1.0 / stream.interval
        started(f"{scenario.name}: {scenario.lrf.beams} beams at {rate:g} Hz; Ctrl-C ends it")
        for robot in stream.robots:
            x, y, theta = robot.robot.start
            started(f"{robot.prefix}start_pose in map: x {x:g} m, y {y:g} m, yaw {theta:g} rad")
        stream.run(node.publish, node.spin)
    finally:
        node.close()
    check()
