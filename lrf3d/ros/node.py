"""The stream of a live robot as a node of ROS 2: publishers, subscribers and services.

Only this module imports rclpy.
"""

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from time import monotonic
from typing import Any

import numpy as np

from lrf3d.errors import MissingLibraryError
from lrf3d.interrupts import asked
from lrf3d.ros.driven import DrivenRobot, Messages, Topic
from lrf3d.ros.pace import Pace
from lrf3d.ros.settings import Settings
from lrf3d.ros.stream import CLOCK, SecondClockError, Stream
from lrf3d.scenario import Scenario

DISCOVERY = 1.0
"""How long another publisher of the clock is looked for [s]; one on this machine is found in a
tenth."""

CHECKED_EVERY = 2.0
"""Wall time from one check of pace and of foreign topics to the next [s]."""

COMMANDS = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
"""Types of commands that are obeyed."""


class Node:
    """Publishers, subscribers and services of a stream; it spins in the calling thread."""

    def __init__(self, settings: Settings, arguments: Sequence[str]) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._settings, self._rclpy = settings, rclpy
        self._nodes, self._executors = list[Any](), list[Any]()
        # Fast DDS knows one type a topic in each participant, so TwistStamped has its own.
        for name in ("lrf3d", "lrf3d_stamped"):
            context = rclpy.Context()
            rclpy.init(
                args=list(arguments),
                context=context,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self._nodes.append(
                rclpy.create_node(name, namespace=settings.namespace, context=context)
            )
            self._executors.append(SingleThreadedExecutor(context=context))
            self._executors[-1].add_node(self._nodes[-1])
        log = self._nodes[0].get_logger()
        # rclpy lets a line of code log at one level only.
        self._levels: dict[str, Callable[[str], object]] = {
            "info": lambda text: log.info(text),
            "warning": lambda text: log.warning(text),
            "error": lambda text: log.error(text),
        }
        self._publishers: dict[Topic, tuple[Any, type]] = {}
        self._said, self._commanded = dict[str, float](), list[str]()

    def close(self) -> None:
        """Leave the network."""
        for node in self._nodes:
            context = node.context
            node.destroy_node()
            self._rclpy.try_shutdown(context=context)

    def say(self, level: str, text: str) -> None:
        """Log a message; the same one at most every five seconds."""
        now = monotonic()
        if level == "info" or now > self._said.get(text, -np.inf) + 5.0:
            self._said[text] = now
            self._levels[level](text)

    def check_clock(self) -> None:
        """Check that nobody else publishes the simulated time.

        Raises:
            SecondClockError: Somebody does.
        """
        end, node = monotonic() + DISCOVERY, self._nodes[0]
        while monotonic() < end and not asked():
            if node.count_publishers(CLOCK.name):
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
            quality = QoSProfile(depth=topic.depth)
            if topic.latched:
                quality.durability = DurabilityPolicy.TRANSIENT_LOCAL
            kind = _type(topic.type)
            self._publishers[topic] = node.create_publisher(kind, topic.name, quality), kind

        for robot in stream.robots:
            self._hear(robot)

        def pause(request: Any, answer: Any) -> Any:
            stream.paused = request.data
            answer.success, answer.message = True, "paused" if request.data else "goes on"
            return answer

        def service(work: Callable[[], object]) -> Callable[[Any, Any], Any]:
            def answered(request: Any, answer: Any) -> Any:
                work()
                answer.success = True
                return answer

            return answered

        trigger = _type("std_srvs/srv/Trigger")
        node.create_service(_type("std_srvs/srv/SetBool"), "pause", pause)
        node.create_service(trigger, "reset", service(stream.reset))
        node.create_service(trigger, "step", service(lambda: self.publish(stream.step())))

    def _hear(self, robot: DrivenRobot) -> None:
        """Let a robot obey the topics of its commands."""

        def obey(twist: Any) -> None:
            robot.command(twist.linear.x, twist.angular.z, twist.linear.y)

        def place(message: Any) -> None:
            where, turn = message.pose.position, message.pose.orientation
            theta = 2.0 * np.arctan2(turn.z, turn.w)
            robot.set_pose(message.header.frame_id, (where.x, where.y, float(theta)))

        name = f"{robot.prefix}cmd_vel"
        for node, kind in zip(self._nodes, COMMANDS, strict=True):
            hear = obey if kind == COMMANDS[0] else lambda message: obey(message.twist)
            node.create_subscription(_type(kind), name, hear, 5)
        kind = _type("geometry_msgs/msg/PoseStamped")
        self._nodes[0].create_subscription(kind, f"{robot.prefix}set_pose", place, 1)
        self._commanded.append(name)

    def publish(self, messages: Messages) -> None:
        """Publish messages in their order."""
        for topic, fields in messages:
            publisher, kind = self._publishers[topic]
            publisher.publish(_filled(kind(), fields))

    def spin(self, seconds: float) -> None:
        """Serve callbacks for a time [s]; at least those that are waiting."""
        end = monotonic() + seconds
        for executor in self._executors:
            executor.spin_once(timeout_sec=0.0)
        while (left := end - monotonic()) > 0.0 and not asked():
            self._executors[0].spin_once(timeout_sec=min(left, 0.1))

    def check_topics(self) -> None:
        """Warn about commands of a type that nobody hears."""
        node = self._nodes[0]
        for name in map(node.resolve_topic_name, self._commanded):
            for each in node.get_publishers_info_by_topic(name):
                if each.topic_type not in COMMANDS:
                    expected = " or ".join(COMMANDS)
                    self.say("warning", f"{name} of type {each.topic_type}: expected {expected}")


def serve_node(
    scenario: Scenario, settings: Settings, arguments: Sequence[str], started: Callable[[str], None]
) -> None:
    """Serve a scenario until the program is interrupted."""
    with _node(settings, arguments) as node:
        stream = Stream(scenario, settings, node.say)
        if settings.clock:
            node.check_clock()
        node.connect(stream)
        node.publish(stream.first())
        beams, rate = scenario.lrf.beams, 1.0 / stream.interval
        started(f"{scenario.name}: {beams} beams at {rate:g} Hz; Ctrl-C ends it")
        speed_up = settings.speed_up
        pace = Pace(stream.interval / stream.ticks / speed_up if speed_up else 0.0)
        checked = monotonic()
        while not asked():
            if not stream.paused:
                node.publish(stream.tick())
            node.spin(pace.next(0.01 if stream.paused else None))
            if monotonic() > checked + CHECKED_EVERY:
                checked = monotonic()
                node.check_topics()
                if speed_up and (share := pace.share()) < 0.97:
                    node.say("warning", f"behind: only {share:.2f} of the speed; scan less often")


@contextmanager
def _node(settings: Settings, arguments: Sequence[str]) -> Iterator[Node]:
    try:
        import rclpy
        import tf2_msgs.msg  # noqa: F401
    except ImportError as error:
        raise MissingLibraryError(
            f"ROS 2 is not there ({error}); source it (. /opt/ros/DISTRO/setup.sh), or install its"
            " wheels into an environment of their own, as scripts/ros does"
        ) from None
    del rclpy
    node = Node(settings, arguments)
    try:
        yield node
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
