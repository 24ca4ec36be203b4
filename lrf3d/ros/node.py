"""The stream of a live robot as a node of ROS 2: publishers, subscribers and services.

Only this module imports rclpy.
"""

from array import array
from collections.abc import Callable, Sequence
from importlib import import_module
from time import monotonic
from typing import Any

import numpy as np

from lrf3d.errors import InputError, MissingLibraryError
from lrf3d.interrupts import asked
from lrf3d.ros.driven import DrivenRobot, Messages
from lrf3d.ros.settings import Settings
from lrf3d.ros.stream import CLOCK, Stream
from lrf3d.scenario import Scenario

DISCOVERY = 1.0
"""How long another publisher of the clock is looked for [s]; one on this machine is found in a
tenth."""

CHECKED_EVERY, SAID_EVERY = 2.0, 5.0
"""Wall time from a check of foreign topics to the next, and from a warning to the same one [s]."""

COMMANDS = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
"""Types of commands that are obeyed."""


class SecondClockError(InputError):
    """Another program publishes the simulated time."""


class Node:
    """Publishers, subscribers and services of a stream; it spins in the calling thread."""

    def __init__(self, namespace: str, arguments: Sequence[str]) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._contexts, self._nodes, self._executors = list[Any](), list[Any](), list[Any]()
        # Fast DDS knows one type a topic in each participant, so TwistStamped has its own.
        for name in ("lrf3d", "lrf3d_stamped"):
            context, options = rclpy.Context(), SignalHandlerOptions.NO
            rclpy.init(args=list(arguments), context=context, signal_handler_options=options)
            self._contexts.append(context)
            self._nodes.append(rclpy.create_node(name, namespace=namespace, context=context))
            self._executors.append(SingleThreadedExecutor(context=context))
            self._executors[-1].add_node(self._nodes[-1])
        log = self._nodes[0].get_logger()
        # rclpy lets a line of code log at one level only.
        self._levels: dict[str, Callable[[str], object]] = {
            "info": lambda text: log.info(text),
            "warning": lambda text: log.warning(text),
            "error": lambda text: log.error(text),
        }
        self._publishers, self._said = dict[str, tuple[Any, type]](), dict[str, float]()
        self._commands, self._checked = list[str](), monotonic()

    def close(self) -> None:
        """Leave the network."""
        for node, context in zip(self._nodes, self._contexts, strict=True):
            node.destroy_node()
            context.try_shutdown()

    def say(self, level: str, text: str) -> None:
        """Log a message; the same warning not again for a while."""
        now = monotonic()
        if level == "info" or now > self._said.get(text, -np.inf) + SAID_EVERY:
            self._said[text] = now
            self._levels[level](text)

    def check_clock(self) -> None:
        """Check that nobody else publishes the simulated time.

        Raises:
            SecondClockError: Somebody does.
        """
        end = monotonic() + DISCOVERY
        while monotonic() < end and not asked():
            if self._nodes[0].count_publishers(CLOCK.name):
                raise SecondClockError(
                    f"another program publishes {CLOCK.name}; pass --no-clock, or set another"
                    " ROS_DOMAIN_ID"
                )
            # A spin may return at once.
            self.spin(0.05)

    def connect(self, stream: Stream) -> None:
        """Make the publishers of a stream, and let it hear commands and services."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        node = self._nodes[0]
        for topic in stream.topics:
            # Reliable publishers serve subscribers of either kind.
            quality, kind = QoSProfile(depth=topic.depth), _type(topic.type)
            if topic.latched:
                quality.durability = DurabilityPolicy.TRANSIENT_LOCAL
            publisher = node.create_publisher(kind, topic.name, quality)
            self._publishers[topic.name] = publisher, kind
        for robot in stream.robots:
            self._hear(robot)

        def serve(kind: str, name: str, work: Callable[[Any], object]) -> None:
            def answered(request: Any, answer: Any) -> Any:
                work(request)
                answer.success = True
                return answer

            node.create_service(_type(f"std_srvs/srv/{kind}"), name, answered)

        serve("SetBool", "pause", lambda request: setattr(stream, "paused", request.data))
        serve("Trigger", "reset", lambda _: stream.reset())
        serve("Trigger", "step", lambda _: self.publish(stream.step()))

    def _hear(self, robot: DrivenRobot) -> None:
        """Let a robot obey the topics of its commands."""

        def obey(message: Any) -> None:
            twist = getattr(message, "twist", message)
            robot.command(twist.linear.x, twist.angular.z, twist.linear.y)

        def place(message: Any) -> None:
            where, turn = message.pose.position, message.pose.orientation
            theta = 2.0 * float(np.arctan2(turn.z, turn.w))
            robot.set_pose(message.header.frame_id, (where.x, where.y, theta))

        for node, kind in zip(self._nodes, COMMANDS, strict=True):
            heard = node.create_subscription(_type(kind), f"{robot.prefix}cmd_vel", obey, 5)
        self._commands.append(heard.topic_name)
        kind = _type("geometry_msgs/msg/PoseStamped")
        self._nodes[0].create_subscription(kind, f"{robot.prefix}set_pose", place, 1)

    def publish(self, messages: Messages) -> None:
        """Publish messages in their order."""
        for topic, fields in messages:
            publisher, kind = self._publishers[topic.name]
            publisher.publish(_filled(kind(), fields))

    def spin(self, seconds: float) -> None:
        """Serve callbacks for a time [s]; at least those that are waiting."""
        end = monotonic() + seconds
        for executor in self._executors:
            executor.spin_once(timeout_sec=0.0)
        while (left := end - monotonic()) > 0.0 and not asked():
            self._executors[0].spin_once(timeout_sec=min(left, 0.1))
        if monotonic() > self._checked + CHECKED_EVERY:
            self._checked = monotonic()
            self._check_commands()

    def _check_commands(self) -> None:
        """Warn about commands of a type that nobody hears."""
        for name in self._commands:
            for each in self._nodes[0].get_publishers_info_by_topic(name):
                if each.topic_type not in COMMANDS:
                    expected = " or ".join(COMMANDS)
                    self.say("warning", f"{name} of type {each.topic_type}: expected {expected}")


def serve_node(
    scenario: Scenario, settings: Settings, arguments: Sequence[str], started: Callable[[str], None]
) -> None:
    """Serve a scenario until the program is interrupted."""
    try:
        import_module("rclpy")
        import_module("tf2_msgs.msg")
    except ImportError as error:
        raise MissingLibraryError(
            f"ROS 2 is not there ({error}); source it (. /opt/ros/DISTRO/setup.sh), or install its"
            " wheels into an environment of their own, as scripts/ros does"
        ) from None
    node = Node(settings.namespace, arguments)
    try:
        stream = Stream(scenario, settings, node.say)
        if settings.clock:
            node.check_clock()
        node.connect(stream)
        rate = 1.0 / stream.interval
        started(f"{scenario.name}: {scenario.lrf.beams} beams at {rate:g} Hz; Ctrl-C ends it")
        stream.run(node.publish, node.spin)
    finally:
        node.close()


def _type(name: str) -> Any:
    """A message type by its name in ROS."""
    package, kind, name = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def _filled(message: Any, fields: dict[str, Any]) -> Any:
    """A message with the fields of nested dicts."""
    for name, value in fields.items():
        if isinstance(value, dict):
            _filled(getattr(message, name), value)
        elif isinstance(value, np.ndarray):
            # Any other kind is checked element by element.
            setattr(message, name, array(value.dtype.char, value.tobytes()))
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inner = message.get_fields_and_field_types()[name]
            kind = _type(inner.removeprefix("sequence<").rstrip(">").replace("/", "/msg/"))
            setattr(message, name, [_filled(kind(), each) for each in value])
        else:
            setattr(message, name, value)
    return message
