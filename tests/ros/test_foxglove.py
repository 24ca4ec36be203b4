"""A world for Foxglove, with a client that speaks its protocol."""

import json
import struct
import threading
import time

import pytest

from lrf3d import load_scenario
from lrf3d.base import interrupts

connect = pytest.importorskip("websockets.sync.client").connect
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402

# A busy machine may be late.
WANTED = {"subprotocols": ["foxglove.sdk.v1"], "max_size": None, "open_timeout": 300}


@pytest.fixture
def server():
    """The address of a server in a thread, and what it said."""
    from lrf3d.ros.foxglove import serve_foxglove

    scenario, said, ready = load_scenario("paper_room"), [], threading.Event()
    addresses = []

    def started(address):
        addresses.append(address)
        ready.set()

    def run():
        # As Ctrl-C ends a command.
        with pytest.raises(KeyboardInterrupt):
            serve_foxglove(scenario, port=0, say=lambda *line: said.append(line), started=started)

    thread = threading.Thread(target=run)
    thread.start()
    assert ready.wait(300)
    yield addresses[0], said
    interrupts._asked = 2
    thread.join(300)
    assert not thread.is_alive()


def twist(speed):
    """A Twist in CDR."""
    return struct.pack("<4B6d", 0, 1, 0, 0, speed, 0, 0, 0, 0, 0)


def test_a_client_gets_the_topics_and_drives_the_robot(server):
    address, said = server
    with connect(address, **WANTED) as client:
        topics, seen = {}, {}

        def command(data):
            client.send(b"\1" + struct.pack("<I", 7) + data)

        advertised = {"id": 7, "topic": "/cmd_vel", "encoding": "cdr",
                      "schemaName": "geometry_msgs/msg/Twist"}  # fmt: skip
        client.send(json.dumps({"op": "advertise", "channels": [advertised]}))
        command(b"\0")
        end, positions = time.monotonic() + 300, []
        wanted_topics = {"/scan", "/odom", "/tf", "/tf_static", "/map", "/clock"}
        while time.monotonic() < end and (len({*positions}) < 3 or not wanted_topics <= {*seen}):
            message = client.recv(timeout=300)
            if isinstance(message, str):
                for each in json.loads(message).get("channels", ()):
                    topics[each["id"]] = each
                    wanted = [{"id": each["id"], "channelId": each["id"]}]
                    client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                continue
            if message[0] == 1:
                topic = topics[struct.unpack_from("<I", message, 1)[0]]
                data = message[13:]
                seen[topic["topic"]] = topic["schemaName"]
                if topic["topic"] == "/odom":
                    # The position follows the header, two frames and their padding.
                    positions.append(data[44:68])
                    command(twist(0.4))
    assert len({*positions}) >= 3
    assert wanted_topics <= {*seen}
    assert seen["/scan"] == "sensor_msgs/msg/LaserScan"
    assert any("cannot be read" in line for _, line in said)


@pytest.mark.parametrize(
    ("origin", "allowed"),
    [
        ("https://evil.example", False),
        ("http://localhost.evil.example", False),
        ("null", False),
        ("http://localhost:8080", True),
        ("https://app.foxglove.dev", True),
        ("file://", True),
    ],
)
def test_pages_of_other_sites_may_not_connect(server, origin, allowed):
    address, said = server
    wanted = WANTED | {"subprotocols": ["foxglove.websocket.v1"], "origin": origin}
    if allowed:
        with connect(address, **wanted) as client:
            assert json.loads(client.recv())["op"] == "serverInfo"
    else:
        with pytest.raises(InvalidStatus, match="403"):
            connect(address, **wanted).close()
        assert any(origin in line for _, line in said)


@pytest.mark.slow
def test_a_flooding_client_is_cut_off_and_others_are_served(server):
    address, said = server
    with connect(address, **WANTED) as calm, connect(address, **WANTED) as flood:
        wrong = (
            '{"op": 3}',
            "[",
            "{}",
            '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
            b"",
            b"\1",
        )
        for each in wrong:
            calm.send(each)
        with pytest.raises(ConnectionClosed):
            for _ in range(100_000):
                flood.send(b"\1\7\0\0\0" + twist(1.0))
        times = []
        while len(times) < 5:
            message = calm.recv(timeout=300)
            if isinstance(message, bytes) and message[0] == 2:
                times.append(struct.unpack("<Q", message[1:])[0])
    assert times == sorted({*times}) and any("over 500 messages" in line for _, line in said)
