"""The page's server: whom it answers, and what it makes of messages that no page sends."""

import http.client
import json
import re
import socket
from urllib.parse import urlsplit

import pytest
from browser import PATIENCE, served

pytest.importorskip("nicegui")

from wsproto import ConnectionType, WSConnection
from wsproto.events import AcceptConnection, RejectConnection, Request, TextMessage

from lrf3d.errors import InputError
from lrf3d.view.server import free_port, own_names, wish_of

SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport="


@pytest.fixture(scope="module")
def address():
    """Where a world is shown."""
    with served("paper_room") as address:
        yield address


def get(address, path="/", **headers):
    """The status and the body that a path is answered with."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=PATIENCE)
    connection.request("GET", path, headers={k.replace("_", "-"): v for k, v in headers.items()})
    response = connection.getresponse()
    status, content = response.status, response.read().decode(errors="replace")
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
        self._socket.close()

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


def test_a_foreign_page_or_name_gets_nothing(address):
    port = urlsplit(address).port
    assert get(address)[0] == get(address, Host=f"localhost:{port}")[0] == 200
    assert get(address, SOCKET + "polling", Origin=address)[0] == 200
    for path in ("/", "/lrf3d/scene.glb", "/favicon.ico", SOCKET + "polling", "/nowhere"):
        for host in ("evil.com", "localhost.evil.com", "127.0.0.1.nip.io", "2130706433", ""):
            assert get(address, path, Host=f"{host}:{port}")[0] == 400
        for origin in ("http://evil.com", "null", f"http://localhost:{port}"):
            status, text = get(address, path, Origin=origin)
            assert status == 403 and text.count("\n") == 1


def test_a_foreign_page_opens_no_websocket(address):
    port = urlsplit(address).port
    with Page(address) as page:
        assert isinstance(page.answer, AcceptConnection)
    for headers in (
        {"origin": "http://evil.com"},
        {"origin": f"http://localhost:{port}"},
        {"origin": f"http://evil.com:{port}", "host": f"evil.com:{port}"},
    ):
        with Page(address, **headers) as page:
            assert isinstance(page.answer, RejectConnection) and page.answer.status_code >= 400


def test_where_others_are_let_in_the_machine_s_own_names_are_theirs(monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Vega.lab.example.org")
    assert own_names("127.0.0.1") == own_names("localhost") == ["localhost", "127.0.0.1", "[::1]"]
    names = own_names("0.0.0.0")
    assert {"127.0.0.1", "vega", "vega.local", "vega.lab.example.org"} <= set(names)
    assert "robot.lan" in own_names("robot.lan") and "*" not in names


def test_files_beside_those_of_the_page_stay_here(address):
    version = re.search(r"/_nicegui/[^/]+", get(address)[1]).group()
    for path in ("/server.py", "/..%2fserver.py", "/../server.py", "/%2fetc%2fpasswd"):
        for folder in ("", "/lrf3d", f"{version}/esm/lrf3d-view", f"{version}/static"):
            status, text = get(address, folder + path)
            assert status in (403, 404) and "import asyncio" not in text and "root:" not in text


def test_visitors_who_left_keep_no_place(address):
    for _ in range(100):
        assert get(address)[0] == 200
    assert get(address)[0] == 200


def drive_on(address, *messages):
    """Open a page, send messages, and drive; gives what the page is then told of its speed."""
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
        page.until(lambda text: "runMethod" in text)
        for args in messages:
            page.say("event", {**event, "args": args})
        page.say("event", {**event, "args": ['{"forward": 0.5, "turn": 0}']})
        return page.until(lambda text: re.search(r'speed\\":0\.0*[1-9]', text))


def test_malformed_wishes_do_not_stop_a_drive(address):
    malformed = ([], [8, 9], ['"drive"'], ['{"forward": "nan", "turn": 0}'], ["[1,1]"])
    assert drive_on(address, *malformed, ['{"forward": 1e300, "turn": 0}'])


@pytest.mark.parametrize(
    "args",
    [
        *(None, 1, "drive", [], [1, 0], {}, {"forward": 1}, {"forward": None, "turn": 0}),
        *({"forward": value, "turn": 0} for value in ("1", "nan", float("nan"), 10**400, 2, [0])),
    ],
)
def test_what_is_no_wish_is_not_obeyed(args):
    assert wish_of(args) is None


def test_a_wish_is_two_numbers():
    wish = wish_of({"forward": 1, "turn": -0.5})
    assert (wish.forward, wish.turn) == (1.0, -0.5)


@pytest.mark.parametrize("host", ["", "a" * 300, "a\0b", "nowhere.invalid", "192.0.2.1"])
def test_where_nobody_can_listen_is_named(host):
    with pytest.raises(InputError, match="--host"):
        free_port(host, None)
