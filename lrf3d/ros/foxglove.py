"""The stream of a live robot for Foxglove and Lichtblick, without ROS.

Foxglove's WebSocket protocol advertises channels in JSON; messages are binary, and begin with an
opcode. Everything runs in the thread of the stream, between two ticks.
"""

import asyncio
import contextlib
import json
import logging
import struct
from collections.abc import Callable
from time import monotonic
from typing import Any
from urllib.parse import urlsplit

from lrf3d.base.errors import OutputError, missing_extra, shown
from lrf3d.base.interrupts import check
from lrf3d.ros.stream import CLOCK, Encoded, Settings, Stream
from lrf3d.simulation.scenario import Scenario

# The port that Foxglove opens by default.
PORT = 8765

# Sites whose pages may connect, in addition to pages of this machine and to programs. Otherwise any
# page that the user visits could read the scans and drive the robot.
SITES = (
    "https://app.foxglove.dev",
    "https://studio.foxglove.dev",
    "https://lichtblick-suite.github.io",
)

# Names of this machine, whose pages may connect.
OWN_NAMES = ("localhost", "127.0.0.1", "::1")

# Names by which newer and older programs request the protocol.
PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")

# Longest message of a client [bytes]; a list of all topics has a few hundred.
MESSAGE_SIZE = 100_000

# Largest rate of a client's messages [1/s], above which it is disconnected; a joystick sends 100.
MOST_MESSAGES = 500

# Unsent data [bytes] above which a client misses messages; a city's map has some megabytes.
BACKLOG = 20_000_000

# Opcodes of binary messages: data, in both directions, and the time.
DATA = 1
TIME = 2

# Least time for clients between two ticks [s], also if the robot is late: a handshake takes several
# rounds of the event loop.
LEAST_WAIT = 0.002

# Time for clients to close their connections at the end [s].
LAST_WORDS = 0.5


class Client:
    """A client's connection, with its subscriptions and its channel of commands."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.subscriptions: dict[int, int] = {}
        # The first bytes of the messages of its channel, and their type.
        self.commands: tuple[bytes, str] | None = None
        # The newest command, which is obeyed at the next tick.
        self.command: bytes | None = None
        self._second = monotonic()
        self._count = 0

    def floods(self) -> bool:
        """Count a message; returns whether it is one too many in this second."""
        if (now := monotonic()) > self._second + 1.0:
            self._second = now
            self._count = 0
        self._count += 1
        return self._count > MOST_MESSAGES

    def send(self, data: bytes) -> None:
        """Send binary data without waiting; a client that reads too slowly misses it."""
        from websockets.asyncio.server import broadcast

        if self.page.transport.get_write_buffer_size() < BACKLOG:
            broadcast([self.page], data)


class Channels:
    """A server with a channel for each topic, and its clients."""

    def __init__(self, stream: Stream, host: str, port: int) -> None:
        try:
            from websockets.asyncio.server import serve as listen
        except ImportError as error:
            raise missing_extra(f"Foxglove needs a server ({error})", "foxglove") from None
        self._stream = stream
        self._numbers = {topic.name: number for number, topic in enumerate(stream.topics, 1)}
        self._clients = list[Client]()
        # Time and data of the last message for late subscribers, by channel.
        self._latched: dict[int, tuple[int, bytes]] = {}
        names: Any = PROTOCOLS

        async def opened() -> Any:
            return await listen(
                self._hear,
                host,
                port,
                subprotocols=names,
                process_request=self._refusal,
                max_size=MESSAGE_SIZE,
                # A short message could unpack to gigabytes.
                compression=None,
                close_timeout=LAST_WORDS,
                logger=logging.Logger("foxglove", logging.CRITICAL),
            )

        self._loop = asyncio.new_event_loop()
        try:
            self._server = self._loop.run_until_complete(opened())
        except OSError as error:
            self._loop.close()
            raise OutputError(f"--port {port}: {error.strerror}; choose another") from None
        self.address = f"ws://{host}:{self._server.sockets[0].getsockname()[1]}"

    def close(self) -> None:
        """Close the connections."""
        self._server.close()
        # Clients that have stopped reading would block the end forever.
        ending = self._loop.create_task(self._server.wait_closed())
        self._loop.run_until_complete(asyncio.wait({ending}, timeout=2.0 * LAST_WORDS))
        for client in self._clients:
            client.page.transport.abort()
        self._loop.run_until_complete(ending)
        self._loop.close()

    def publish(self, messages: Encoded) -> None:
        """Publish messages at the simulated time."""
        for topic, data in messages:
            number = self._numbers[topic.name]
            time = self._stream.stamp.nanoseconds
            if topic.latched:
                self._latched[number] = time, data
            for client in self._clients:
                if topic is CLOCK:
                    client.send(struct.pack("<BQ", TIME, time))
                if (subscription := client.subscriptions.get(number)) is not None:
                    client.send(struct.pack("<BIQ", DATA, subscription, time) + data)

    def serve(self, seconds: float) -> None:
        """Serve clients for a time [s], then apply the newest command of each."""
        self._loop.run_until_complete(asyncio.sleep(max(LEAST_WAIT, seconds)))
        for client in self._clients:
            if client.command is not None:
                self._obey(client, client.command)
            client.command = None

    def _obey(self, client: Client, data: bytes) -> None:
        stream = self._stream
        _, kind = client.commands or (b"", "")
        try:
            message: Any = stream.types.deserialize_cdr(data, f"geometry_msgs/msg/{kind}")
        except Exception as error:
            stream.say("warning", f"cmd_vel of a client cannot be read ({error}); ignored")
        else:
            stream.robots[0].obey(message)

    def _refusal(self, connection: Any, request: Any) -> Any:
        """Refuse pages of other sites; programs send no origin, or one that no page can have."""
        for origin in request.headers.get_all("Origin"):
            site = urlsplit(origin)
            is_page = site.scheme in ("http", "https", "")
            if is_page and site.hostname not in OWN_NAMES and origin not in SITES:
                self._stream.say("warning", f"a page of {shown(origin)} was refused")
                return connection.respond(403, "pages of other sites may not drive the robot\n")
        return None

    async def _hear(self, page: Any) -> None:
        """Handle the messages of a client until it disconnects."""
        stream = self._stream
        about = {"op": "serverInfo", "name": stream.scenario.name, "supportedEncodings": ["cdr"]}
        await page.send(json.dumps({**about, "capabilities": ["clientPublish", "time"]}))
        await page.send(json.dumps({"op": "advertise", "channels": self._channels()}))
        client = Client(page)
        self._clients.append(client)
        try:
            async for message in page:
                if client.floods():
                    stream.say(
                        "warning", f"a client sent over {MOST_MESSAGES} messages in a second"
                    )
                    await page.close(1008, "too many messages")
                    return
                self._take(client, message)
        finally:
            self._clients.remove(client)

    def _channels(self) -> list[dict[str, Any]]:
        return [
            {
                "id": self._numbers[topic.name],
                "topic": f"/{topic.name.strip('/')}",
                "encoding": "cdr",
                "schemaName": topic.type,
                "schema": self._stream.types.generate_msgdef(topic.type, ros_version=2)[0],
                "schemaEncoding": "ros2msg",
            }
            for topic in self._stream.topics
        ]

    def _take(self, client: Client, message: str | bytes) -> None:
        """Handle a message of a client; a malformed one changes nothing."""
        if isinstance(message, bytes):
            if client.commands and message[:5] == client.commands[0]:
                client.command = message[5:]
            return
        works = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "advertise": self._advertised,
        }
        with contextlib.suppress(
            AttributeError,
            LookupError,
            OverflowError,
            RecursionError,
            struct.error,
            TypeError,
            ValueError,
        ):
            asked = json.loads(message)
            works[asked["op"]](client, asked)

    def _subscribe(self, client: Client, asked: Any) -> None:
        """Subscribe a client: send what is published from now on, and the last message if kept."""
        for each in asked["subscriptions"]:
            number = int(each["channelId"])
            subscription = int(each["id"])
            if number not in self._numbers.values() or number in client.subscriptions:
                continue
            # A number that does not fit is refused before anything changes.
            header = struct.pack("<BI", DATA, subscription)
            client.subscriptions[number] = subscription
            if number in self._latched:
                time, data = self._latched[number]
                client.send(header + struct.pack("<Q", time) + data)

    def _unsubscribe(self, client: Client, asked: Any) -> None:
        gone = {int(each) for each in asked["subscriptionIds"]}
        client.subscriptions = {k: n for k, n in client.subscriptions.items() if n not in gone}

    def _advertised(self, client: Client, asked: Any) -> None:
        """Remember the channel in which a client commands the robot."""
        for each in asked["channels"]:
            if each["topic"].strip("/") == "cmd_vel":
                stamped = each["schemaName"].endswith("Stamped")
                number = struct.pack("<BI", DATA, int(each["id"]))
                client.commands = number, "TwistStamped" if stamped else "Twist"


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

    Programs, pages of this machine and pages of `SITES` may connect; others are refused.

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
