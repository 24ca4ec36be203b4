"""The stream of a live robot for Foxglove and Lichtblick, without ROS."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

from lrf3d.base.errors import OutputError, missing_extra
from lrf3d.base.interrupts import check
from lrf3d.ros.stream import Encoded, Settings, Stream
from lrf3d.simulation.scenario import Scenario

# The port that Foxglove opens by default.
PORT = 8765


class Channels:
    """Channels of a server, one for each topic, and what its clients ask for.

    The server calls the methods ``on_…`` in threads of its own.
    """

    def __init__(self, stream: Stream, host: str, port: int) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError as error:
            raise missing_extra(f"Foxglove needs its server ({error})", "foxglove") from None
        self._stream = stream
        # Channels end with their context.
        self._context = context = foxglove.Context()
        self._channels = dict[str, Any]()
        for topic in stream.topics:
            text, _ = stream.types.generate_msgdef(topic.type, ros_version=2)
            schema = foxglove.Schema(name=topic.type, encoding="ros2msg", data=text.encode())
            self._channels[topic.name] = foxglove.Channel(
                f"/{topic.name.strip('/')}", schema=schema, message_encoding="cdr", context=context
            )
        self._latched = {self._channels[t.name].topic() for t in stream.topics if t.latched}
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

    def publish(self, messages: Encoded) -> None:
        """Publish messages at the simulated time."""
        for topic, data in messages:
            time = self._stream.stamp.nanoseconds
            self._server.broadcast_time(time)
            self._channels[topic.name].log(data, log_time=time)

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
        if channel.topic in self._latched:
            stream = self._stream
            self._asked.put(lambda: self.publish(stream.encoded(stream.first())))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Do nothing: the server sends to those that are left."""

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Remember what a client will publish."""
        self._clients[client.id, channel.id] = channel

    def on_client_unadvertise(self, client: Any, channel: int) -> None:
        """Forget what a client no longer publishes."""
        self._clients.pop((client.id, channel), None)

    def on_message_data(self, client: Any, channel: int, data: bytes) -> None:
        """Take a command of a client: a Twist or a TwistStamped in CDR."""
        known = self._clients.get((client.id, channel))
        stream = self._stream
        if known is None or known.topic.strip("/") != "cmd_vel":
            return
        kind = "TwistStamped" if known.schema_name.endswith("Stamped") else "Twist"
        try:
            message: Any = stream.types.deserialize_cdr(data, f"geometry_msgs/msg/{kind}")
        except Exception as error:
            reason = f"cmd_vel of a client cannot be read ({error}); ignored"
            self._asked.put(lambda: stream.say("warning", reason))
        else:
            self._asked.put(lambda: stream.robots[0].obey(message))


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
