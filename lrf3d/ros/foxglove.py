"""The stream of a live robot for Foxglove and Lichtblick, without ROS: the same messages as CDR."""

from collections.abc import Callable, Iterable
from queue import SimpleQueue
from time import monotonic, sleep
from typing import Any

from lrf3d.errors import OutputError, missing_extra
from lrf3d.interrupts import asked, check
from lrf3d.io.bag_writer import made
from lrf3d.ros.driven import Message, Topic
from lrf3d.ros.pace import Pace
from lrf3d.ros.settings import Settings
from lrf3d.ros.stream import Stream
from lrf3d.scenario import Scenario

PORT = 8765
"""The port that Foxglove opens by default."""

TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


class Channels:
    """Channels of a server, one for each topic, and what its clients ask for."""

    def __init__(self, topics: list[Topic], name: str, host: str, port: int) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise missing_extra(f"Foxglove needs its server ({error})", "foxglove") from None
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        # Channels end with their context.
        self._context = context = foxglove.Context()
        self._channels = {
            topic: foxglove.Channel(
                f"/{topic.name.strip('/')}",
                schema=foxglove.Schema(
                    name=topic.type, encoding="ros2msg", data=self._definition(topic.type)
                ),
                message_encoding="cdr",
                context=context,
            )
            for topic in topics
        }
        self.asked = SimpleQueue[Callable[[Stream], None]]()
        """What clients want of the stream, in the order in which they said so."""
        self._clients: dict[tuple[int, int], Any] = {}
        listener: Any = self
        try:
            self._server = foxglove.start_server(
                name=name,
                host=host,
                port=port,
                capabilities=[Capability.ClientPublish, Capability.Time],
                supported_encodings=["cdr"],
                server_listener=listener,
                context=context,
            )
        except (OSError, RuntimeError) as error:
            raise OutputError(f"--port {port}: {error}; choose another") from None
        self.address = f"ws://{host}:{self._server.port}"

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    def publish(self, messages: Iterable[Message], nanoseconds: int) -> None:
        """Publish messages at a simulated time [ns]."""
        self._server.broadcast_time(nanoseconds)
        for topic, fields in messages:
            message = made(self._store, topic.type, fields)
            data = bytes(self._store.serialize_cdr(message, topic.type))
            self._channels[topic].log(data, log_time=nanoseconds)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send a late client what is published once; called by the server in its own thread."""
        if any(topic.latched and f"/{topic.name}" == channel.topic for topic in self._channels):
            self.asked.put(lambda stream: self.publish(stream.first(), stream.stamp.nanoseconds))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Do nothing: the server sends to those that are left."""

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Remember what a client will publish."""
        self._clients[client.id, channel.id] = channel

    def on_client_unadvertise(self, client: Any, channel: int) -> None:
        """Forget what a client publishes no more."""
        self._clients.pop((client.id, channel), None)

    def on_message_data(self, client: Any, channel: int, data: bytes) -> None:
        """Take a command of a client."""
        known = self._clients.get((client.id, channel))
        if known is None or known.topic.strip("/") != "cmd_vel":
            return
        try:
            speed, turn, left = self._twist(known.schema_name, data)
        except Exception as error:
            reason = f"cmd_vel of a client cannot be read ({error}); ignored"
            self.asked.put(lambda stream: stream.say("warning", reason))
            return
        self.asked.put(lambda stream: stream.robots[0].command(speed, turn, left))

    def _twist(self, kind: str, data: bytes) -> tuple[float, float, float]:
        """Speed, turn rate and sideways speed of a Twist or TwistStamped in CDR."""
        kind = TWIST_STAMPED if kind.endswith("Stamped") else TWIST
        message: Any = self._store.deserialize_cdr(data, kind)
        twist = getattr(message, "twist", message)
        return twist.linear.x, twist.angular.z, twist.linear.y

    def _definition(self, kind: str) -> bytes:
        """The text of a message type with all that it contains."""
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        return text.encode()


def serve_foxglove(
    scenario: Scenario,
    *,
    host: str = "127.0.0.1",
    port: int = PORT,
    rng: int = 0,
    say: Callable[[str, str], None],
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve a robot to Foxglove until the program is interrupted.

    Raises:
        MissingLibraryError: The libraries of the extra ``foxglove`` are not installed.
        OutputError: The port is taken.
    """
    stream = Stream(scenario, Settings(rng=rng, lines=True), say)
    channels = Channels(stream.topics, scenario.name, host, port)
    try:
        started(channels.address)
        channels.publish(stream.first(), 0)
        pace = Pace(stream.interval / stream.ticks)
        while not asked():
            while not channels.asked.empty():
                channels.asked.get()(stream)
            messages = [*stream.tick()]
            channels.publish(messages, stream.stamp.nanoseconds)
            end = monotonic() + pace.next()
            while (left := end - monotonic()) > 0.0 and not asked():
                sleep(min(left, 0.05))
    finally:
        channels.close()
    check()
