"""The stream of a live robot for Foxglove and Lichtblick, without ROS: the same messages as CDR."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

from lrf3d.errors import OutputError, missing_extra
from lrf3d.interrupts import check
from lrf3d.io.bag_writer import made
from lrf3d.ros.driven import Messages
from lrf3d.ros.settings import Settings
from lrf3d.ros.stream import Stream
from lrf3d.scenario import Scenario

PORT = 8765
"""The port that Foxglove opens by default."""


class Channels:
    """Channels of a server, one for each topic, and what its clients ask for.

    The server calls the methods ``on_…`` in threads of its own.
    """

    def __init__(self, stream: Stream, host: str, port: int) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise missing_extra(f"Foxglove needs its server ({error})", "foxglove") from None
        self._stream, self._store = stream, get_typestore(Stores.ROS2_HUMBLE)
        # Channels end with their context.
        self._context = context = foxglove.Context()
        self._channels = {}
        for topic in stream.topics:
            text, _ = self._store.generate_msgdef(topic.type, ros_version=2)
            self._channels[f"/{topic.name.strip('/')}"] = (
                topic,
                foxglove.Channel(
                    f"/{topic.name.strip('/')}",
                    schema=foxglove.Schema(name=topic.type, encoding="ros2msg", data=text.encode()),
                    message_encoding="cdr",
                    context=context,
                ),
            )
        self._asked = SimpleQueue[Callable[[], None]]()
        self._clients: dict[tuple[int, int], Any] = {}
        listener: Any = self
        try:
            self._server = foxglove.start_server(
                name=stream.scenario.name, host=host, port=port, server_listener=listener,
                capabilities=[Capability.ClientPublish, Capability.Time],
                supported_encodings=["cdr"], context=context,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise OutputError(f"--port {port}: {error}; choose another") from None
        self.address, self.close = f"ws://{host}:{self._server.port}", self._server.stop

    def publish(self, messages: Messages) -> None:
        """Publish messages at the simulated time."""
        for topic, fields in messages:
            time = self._stream.stamp.nanoseconds
            self._server.broadcast_time(time)
            message = made(self._store, topic.type, fields)
            data = bytes(self._store.serialize_cdr(message, topic.type))
            self._channels[f"/{topic.name.strip('/')}"][1].log(data, log_time=time)

    def serve(self, seconds: float) -> None:
        """Do for a time [s] what clients ask for."""
        end = monotonic() + seconds
        while True:
            try:
                self._asked.get(timeout=max(0.0, end - monotonic()))()
            except Empty:
                return

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send a late client what is published once."""
        if self._channels[channel.topic][0].latched:
            self._asked.put(lambda: self.publish(self._stream.first()))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Do nothing: the server sends to those that are left."""

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Remember what a client will publish."""
        self._clients[client.id, channel.id] = channel

    def on_client_unadvertise(self, client: Any, channel: int) -> None:
        """Forget what a client publishes no more."""
        self._clients.pop((client.id, channel), None)

    def on_message_data(self, client: Any, channel: int, data: bytes) -> None:
        """Take a command of a client: a Twist or a TwistStamped in CDR."""
        known, stream = self._clients.get((client.id, channel)), self._stream
        if known is None or known.topic.strip("/") != "cmd_vel":
            return
        stamped = "Stamped" * known.schema_name.endswith("Stamped")
        try:
            message: Any = self._store.deserialize_cdr(data, f"geometry_msgs/msg/Twist{stamped}")
            twist = getattr(message, "twist", message)
            words = twist.linear.x, twist.angular.z, twist.linear.y
        except Exception as error:
            reason = f"cmd_vel of a client cannot be read ({error}); ignored"
            self._asked.put(lambda: stream.say("warning", reason))
        else:
            self._asked.put(lambda: stream.robots[0].command(*words))


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
    channels = Channels(stream, host, port)
    try:
        started(channels.address)
        stream.run(channels.publish, channels.serve)
    finally:
        channels.close()
    check()
