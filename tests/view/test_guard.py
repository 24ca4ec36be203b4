"""The page's server: whom it answers, and what it makes of messages that no page sends."""

import asyncio
import contextlib
import http.client
import json
import logging
import re
import socket
import threading
from contextlib import suppress
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from browser import PATIENCE, served, until

pytest.importorskip("nicegui")

from wsproto import ConnectionType, WSConnection
from wsproto.events import AcceptConnection, RejectConnection, Request, TextMessage

from lrf3d.errors import InputError
from lrf3d.view import guard
from lrf3d.view.server import free_port, wish_of

YARD = """\
name = "yard"

[[object]]
points = [[0, 0], [16, 0], [16, 9], [0, 9]]
closed = true

[robot]
route = [[2, 3], [13, 3]]
speed = 2.0

[laser]
beams = 61
range_max = 30.0
"""
SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport="


# The rule ---------------------------------------------------------------------------------------


def answer(host, headers, kind="http", path="/page", port=8080):
    """The status and the text that a guard answers with, or None where it lets pass."""
    sent = []

    async def application(scope, receive, send):
        sent.append(None)

    async def send(message):
        sent.append(message)

    scope = {
        "type": kind,
        "path": path,
        "headers": [(name.encode(), value.encode("latin-1")) for name, value in headers],
    }
    asyncio.run(guard.Guard(application, host=host, port=port)(scope, None, send))
    if sent == [None]:
        return None
    start, body = sent
    text = body["body"].decode("ascii")
    assert text.startswith("lrf3d: ") and text.endswith("\n") and text.count("\n") == 1
    assert (b"cache-control", b"no-store") in start["headers"]
    return start["status"], text


OTHERS = (
    *("evil.com", "evil.com:8080", "localhost.evil.com:8080", "127.0.0.1.nip.io:8080"),
    *("127.0.0.1", "127.0.0.1:8081", "localhost:80", "127.1:8080", "2130706433:8080"),
    *("", ":8080", "127.0.0.1:", "127.0.0.1:8080:8080", "[::1:8080", "::1:8080", "[]:8080"),
    *("evil.com\x1b[2J\x07:8080", "127.0.0.1:8080/", "user@127.0.0.1:8080", "127.0.0.1:808²"),
)


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LocalHost", "[::1]"])
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "0.0.0.0", "robot.lan"])
def test_this_machine_itself_is_served(host, name):
    assert answer(host, [("host", f"{name}:8080")]) is None
    assert answer(host, [("host", name)], port=80) is None


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0", "robot.lan"])
def test_another_name_or_port_is_refused_in_one_line(host, name):
    for kind in ("http", "websocket"):
        origin = [("origin", f"http://{name}")]
        status, text = answer(host, [("host", name), *origin], kind)
        assert status == 421 and text.isprintable() is False and text[:-1].isprintable()


def test_a_request_names_one_host():
    assert answer("127.0.0.1", [])[0] == 421
    assert answer("127.0.0.1", 2 * [("host", "127.0.0.1:8080")])[0] == 421


def test_where_others_are_let_in_addresses_and_own_names_do(monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Vega.lab.example.org")
    names = ("192.168.1.5", "[fe80::1]", "vega", "vega.local", "Vega.lab.example.org", "vega.lan")
    given = {
        "127.0.0.1": [],
        "0.0.0.0": names[:-1],
        "vega.lan": names,
        "192.168.1.5": names[:-1],
    }
    for host, served_as in given.items():
        for name in names:
            refused = answer(host, [("host", f"{name}:8080")])
            assert (refused is None) == (name in served_as), (host, name)


@pytest.mark.parametrize(
    "origin",
    [
        *("http://evil.com", "http://evil.com:8080", "null", "", "http://127.0.0.1"),
        *("http://localhost:8080", "https://127.0.0.1:8080", "http://127.0.0.1:8080.evil.com"),
    ],
)
def test_pages_of_other_sites_are_refused(origin):
    headers = [("host", "127.0.0.1:8080"), ("origin", origin)]
    for kind in ("http", "websocket"):
        assert answer("127.0.0.1", headers, kind)[0] == 403


def test_a_websocket_comes_with_the_origin_of_its_page():
    host = [("host", "127.0.0.1:8080")]
    assert answer("127.0.0.1", host, "websocket")[0] == 403
    own = [*host, ("origin", "http://127.0.0.1:8080")]
    assert answer("127.0.0.1", own, "websocket") is None and answer("127.0.0.1", own) is None


def test_other_sites_may_link_to_the_page_but_not_embed_it_as_a_picture():
    for site, mode, passes in (
        ("none", "navigate", True),
        ("same-origin", "cors", True),
        ("cross-site", "navigate", True),
        ("cross-site", "no-cors", False),
        ("same-site", "no-cors", False),
    ):
        sent = [("sec-fetch-site", site), ("sec-fetch-mode", mode)]
        refused = answer("127.0.0.1", [("host", "localhost:8080"), *sent])
        assert (refused is None) == passes


def test_pages_are_not_made_without_end(monkeypatch):
    host = [("host", "127.0.0.1:8080")]
    assert answer("127.0.0.1", host, path="/") is None
    monkeypatch.setattr(guard, "PAGES", 0)
    assert answer("127.0.0.1", host, path="/")[0] == 503
    assert answer("127.0.0.1", host, path="/lrf3d/run") is None


@pytest.mark.parametrize(
    "args",
    [
        *(None, 1, "drive", [], [1, 0], {}, {"forward": 1}, {"forward": None, "turn": 0}),
        *({"forward": value, "turn": 0} for value in ("1", "nan", float("nan"), 10**400, 2, [0])),
        {"forward": 0, "turn": [0.0] * 1000},
    ],
)
def test_what_is_no_wish_is_not_obeyed(args):
    assert wish_of(args) is None


def test_a_wish_is_two_numbers():
    wish = wish_of({"forward": 1, "turn": -0.5})
    assert (wish.forward, wish.turn) == (1.0, -0.5)


def test_failures_of_our_own_are_reported_and_others_are_not():
    def record(action):
        try:
            action()
        except Exception as error:
            info = (type(error), error, error.__traceback__)
            return logging.LogRecord("asyncio", logging.ERROR, "", 0, "failed", (), info)

    # A port that is no number fails within our own function.
    assert guard._is_own_failure(record(lambda: free_port("127.0.0.1", "x")))
    assert not guard._is_own_failure(record(lambda: json.loads("{")))
    assert not guard._is_own_failure(logging.LogRecord("a", 40, "", 0, "\x1b[2J", (), None))


class Engine:
    """Stands in for the library's engine: notes what messages get through."""

    def __init__(self, waiting=0):
        self.taken, self.handlers = [], {"message": self.take}
        queue = asyncio.Queue()
        for each in range(waiting):
            queue.put_nowait(each)
        self.sockets = {"e": SimpleNamespace(queue=queue)}

    def on(self, name, handler):
        self.handlers[name] = handler

    async def take(self, session, message):
        self.taken.append(message)


def test_messages_that_announce_attachments_and_attachments_are_dropped(monkeypatch):
    engine = Engine()
    monkeypatch.setattr(guard.core, "sio", SimpleNamespace(eio=engine))
    guard.refuse_attachments()
    for message in ("0", '2["event",{}]', '51-["event"]', "61-[]", b"0", b"", ""):
        asyncio.run(engine.handlers["message"]("s", message))
    assert engine.taken == ["0", '2["event",{}]']


def test_what_waits_for_a_slow_page_is_counted(monkeypatch):
    # The second of its sockets has gone.
    manager = SimpleNamespace(get_participants=lambda space, room: [("s", "e"), ("t", "f")])
    sio = SimpleNamespace(eio=Engine(waiting=3), manager=manager)
    monkeypatch.setattr(guard.core, "sio", sio)
    assert guard.backlog(SimpleNamespace(id="c")) == 3


@pytest.mark.parametrize(
    "host", ["", "a" * 300, "a\0b", "nowhere.invalid", "192.0.2.1", "2001:db8::1"]
)
def test_where_nobody_can_listen_is_named(host):
    with pytest.raises(InputError, match="--host"):
        free_port(host, None)


# The server itself ------------------------------------------------------------------------------


def get(address, path="/", method="GET", body=None, **headers):
    """The status and the body that a path is answered with."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=PATIENCE)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, headers)
    response = connection.getresponse()
    status, content = response.status, response.read().decode()
    connection.close()
    return status, content


class Page:
    """A websocket as a page opens it, which can send what no page sends."""

    def __init__(self, address, query="", *, origin=None, host=None):
        netloc = urlsplit(address).netloc
        name, _, port = netloc.rpartition(":")
        self._socket = socket.create_connection((name, int(port)), timeout=PATIENCE)
        self._protocol = WSConnection(ConnectionType.CLIENT)
        self._events = iter(())
        extra = [(b"origin", (origin or address).encode())]
        target = SOCKET + "websocket" + query
        request = Request(host=host or netloc, target=target, extra_headers=extra)
        self._socket.sendall(self._protocol.send(request))
        self.answer = self.next()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    @property
    def is_open(self):
        return isinstance(self.answer, AcceptConnection)

    def next(self):
        """The next event; None where the server has hung up."""
        while (event := next(self._events, None)) is None:
            try:
                data = self._socket.recv(1 << 16)
            except ConnectionError:
                data = b""
            if not data:
                return None
            self._protocol.receive_data(data)
            self._events = self._protocol.events()
        return event

    def send(self, text):
        self._socket.sendall(self._protocol.send(TextMessage(text)))

    def say(self, *event):
        self.send("42" + json.dumps(event))

    def texts(self):
        """The messages that come, whole."""
        text = ""
        while (event := self.next()) is not None:
            if isinstance(event, TextMessage):
                text += event.data
                if event.message_finished:
                    if text == "2":
                        self.send("3")
                    yield text
                    text = ""

    def until(self, is_so):
        return next(text for text in self.texts() if is_so(text))


def follow(page, states):
    """Note what the page is told of the drive, and answer pings, until the server hangs up."""
    # The test closes the page when it is done with it.
    with contextlib.suppress(OSError):
        for text in page.texts():
            if "runMethod" in text:
                code = json.loads(text[2:])[1]["code"]
                states.extend(json.loads(code[code.index("[") : code.rindex("]") + 1]))


@pytest.fixture
def yard(tmp_path):
    path = tmp_path / "yard.toml"
    path.write_text(YARD)
    return path


def test_a_foreign_page_gets_nothing(yard):
    with served(yard) as address:
        port = urlsplit(address).port
        assert get(address)[0] == 200
        assert get(address, Host=f"localhost:{port}")[0] == 200
        for path in ("/", "/lrf3d/scene.glb", "/favicon.ico", SOCKET + "polling", "/nowhere"):
            assert get(address, path, Host=f"evil.com:{port}")[0] == 421
            assert get(address, path, Origin="http://evil.com")[0] == 403
        assert get(address, SOCKET + "polling")[0] == 200
        with Page(address) as page:
            assert page.is_open
        for headers, status in (
            ({"origin": "http://evil.com"}, 403),
            ({"origin": f"http://localhost:{port}"}, 403),
            ({"origin": f"http://evil.com:{port}", "host": f"evil.com:{port}"}, 421),
        ):
            with Page(address, **headers) as page:
                assert isinstance(page.answer, RejectConnection)
                assert page.answer.status_code == status
        # Files beside those of the page stay here; what no one has asked for so far is not logged.
        version = re.search(r"/_nicegui/[^/]+", get(address)[1]).group()
        for path in (
            *("/server.py", "/..%2fserver.py", "/../server.py", "/%00", "/" + 5000 * "a"),
            *("//etc/passwd", "/%2fetc%2fpasswd"),
        ):
            for folder in ("", "/lrf3d", f"{version}/esm/lrf3d-view", f"{version}/static"):
                status, text = get(address, folder + path)
                assert status in (403, 404, 500) and "import" not in text
        forged = "/%1b%5b2J%0alrf3d:%20all%20is%20lost%0a"
        assert get(address, forged) == (404, "lrf3d: there is no such page\n")


MALFORMED = (
    *("", "x", "4", "4x", "42", "42{", "42[", "42[]", "42{}", "421", "42null", '42["event"]'),
    *('42["event",1]', '42["event",{}]', '42["event","\\u001b[2J"]', '42["handshake",[]]'),
    *('42["ack",{"client_id":1}]', '42["log",{}]', '42["javascript_response",null]'),
    *('42["event",NaN]', "42" + 9000 * "[", '42["disconnect"]', '42["connect",1,2,3]', "43", "44"),
    *('451-["event",{"_placeholder":true,"num":0}]', '459999999999-["event"]', "bAAAA", "6", "9"),
    *("40/nowhere,", "40{", "40[1]", "43-1", "431[]", "42" + 200 * "1" + '["event"]', "\x1b[2J"),
)


def test_malformed_messages_do_not_stop_a_drive_nor_reach_the_terminal(yard):
    with served(yard) as address:
        text = get(address)[1]
        client = re.search(r"'client_id': '([^']+)'", text).group(1)
        number = int(re.search(r'"(\d+)":{"tag":"nicegui-run_view"', text).group(1))
        listener = re.search(r'{"listener_id":"([^"]+)","type":"drive"', text).group(1)
        event = {"id": number, "client_id": client, "listener_id": listener}
        hello = {"client_id": client, "tab_id": "t", "document_id": "d", "next_message_id": 0}
        with Page(address, f"&client_id={client}") as page:
            page.send("40")
            page.until(lambda text: text.startswith("40"))
            page.say("handshake", hello)
            states = []
            threading.Thread(target=follow, args=(page, states), daemon=True).start()
            until(lambda: states)
            for args in (
                *([], {}, "", 1, ["{"], ["\x1b[2J"], ["NaN"], ["[]"], ['"drive"'], ["1e999"]),
                *(['{"forward": "nan", "turn": 0}'], ['{"forward": 1e300, "turn": 0}'], [8, 9]),
                ["[" + "1," * 20000 + "1]"],
            ):
                page.say("event", {**event, "args": args})
            for wrong in ({"id": []}, {"id": 10**9}, {"listener_id": {}}, {"client_id": {}}):
                page.say("event", {**event, "args": ["{}"], **wrong})
            page.say("log", {"client_id": client, "level": "error", "message": "\x1b[2J\nlost"})
            page.say("ack", {"client_id": client, "next_message_id": "x"})
            page.say("handshake", {**hello, "next_message_id": []})
            for message in MALFORMED:
                with Page(address) as other:
                    other.send("40")
                    other.until(lambda text: text.startswith("40"))
                    other.send(message)
                    other.send("4" + message)
            # Longer than any message may be.
            with Page(address) as other:
                other.send("42" + 1_000_000 * " ")
                assert list(other.texts())[1:] == []
            # By polling, too.
            session = json.loads(get(address, SOCKET + "polling")[1][1:])["sid"]
            for message in MALFORMED:
                get(address, f"{SOCKET}polling&sid={session}", "POST", "4" + message)
            for path in ("polling&sid=%1b%5b2J", "x", "websocket", "polling&j=x"):
                assert get(address, SOCKET + path)[0] == 400
            # It stood through all that, and still obeys.
            page.say("event", {**event, "args": ['{"forward": 1, "turn": 0}']})
            until(lambda: states[-1]["pose"]["speed"] == 2.0)
            assert {state["pose"]["turning"] for state in states} == {0.0}
