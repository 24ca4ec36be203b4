"""The page's server: whom it answers, and what it makes of messages that no page sends."""

import http.client
import json
import socket
from urllib.parse import urlsplit

import pytest
from browser import PATIENCE, served

pytest.importorskip("uvicorn")

from wsproto import ConnectionType, WSConnection
from wsproto.events import AcceptConnection, RejectConnection, Request, TextMessage

from lrf3d.errors import InputError
from lrf3d.view.server import bound, own_names

SOCKET = "/lrf3d/moments"


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

    def __init__(self, address, *, origin=None, host=None):
        netloc = urlsplit(address).netloc
        name, _, port = netloc.rpartition(":")
        self._socket = socket.create_connection((name, int(port)), timeout=PATIENCE)
        self._protocol = WSConnection(ConnectionType.CLIENT)
        self._events = iter(())
        extra = [(b"origin", (origin or address).encode())]
        target = SOCKET
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

    def messages(self):
        """The headers of the messages that come."""
        data = b""
        while (event := self.next()) is not None:
            data += event.data
            if event.message_finished:
                yield json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
                data = b""


def test_a_foreign_page_or_name_gets_nothing(address):
    port = urlsplit(address).port
    assert get(address)[0] == get(address, Host=f"localhost:{port}")[0] == 200
    assert get(address, "/lrf3d/world", Origin=address)[0] == 200
    for path in ("/", "/lrf3d/world", "/lrf3d/page.js", SOCKET, "/nowhere"):
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
    for path in ("/server.py", "/..%2fserver.py", "/../server.py", "/%2fetc%2fpasswd"):
        for folder in ("", "/lrf3d", "/lrf3d/page.js"):
            assert get(address, folder + path)[0] == 404


def test_malformed_messages_do_not_stop_a_drive(address):
    with Page(address) as page:
        for text in ("[]", "[8, 9]", "drive", '{"forward": 1e300, "turn": 0}', '{"forward": NaN}'):
            page.send(text)
        page.send('{"forward": 0.5, "turn": 0}')
        speeds = (each["words"]["v"] for each in page.messages() if "words" in each)
        assert next(speed for speed in speeds if float(speed) > 0.0)


def test_too_long_a_message_ends_its_page_alone(address):
    with Page(address) as page:
        page.send("1" * 20_000)
        assert not any(isinstance(event, TextMessage) for event in iter(page.next, None))
    assert get(address)[0] == 200


@pytest.mark.parametrize("host", ["", "a" * 300, "a\0b", "nowhere.invalid", "192.0.2.1"])
def test_where_nobody_can_listen_is_named(host):
    with pytest.raises(InputError, match="--host"):
        bound(host, None)
