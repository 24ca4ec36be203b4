"""The page's server: whom it answers, and what it makes of messages that no page sends."""

import http.client
import json
import socket
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest
from browser import served
from waiting import PATIENCE

pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lrf3d.base.errors import InputError
from lrf3d.studio.page.server import bound, is_own

SOCKET = "/lrf3d/moments"


@pytest.fixture(scope="module")
def address():
    """Where a world is shown."""
    with served("paper_room") as address:
        yield address


def asked(address, path="/", method="GET", **headers):
    """The answer to a request, and its body."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=PATIENCE)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, headers=headers)
    response = connection.getresponse()
    body = response.read().decode(errors="replace")
    connection.close()
    return response, body


def status(address, path="/", **headers):
    return asked(address, path, **headers)[0].status


def page(address, *, origin=None, host=None):
    """A websocket as a page opens it, which can send what no page sends."""
    netloc = urlsplit(address).netloc
    name, _, port = netloc.rpartition(":")
    door = socket.create_connection((name, int(port)), timeout=PATIENCE)
    return connect(f"ws://{host or netloc}{SOCKET}", sock=door, origin=origin or address)


def test_requests_of_other_sites_or_by_other_names_are_refused(address):
    port = urlsplit(address).port
    for host in (f"LocalHost:{port}", "[::1]:80", "localhost"):
        assert status(address) == status(address, Host=host) == 200
    assert status(address, "/lrf3d/world", Origin=address) == 200
    for path in ("/", "/lrf3d/world", "/lrf3d/page.js", SOCKET, "/nowhere"):
        for host in ("evil.com", "localhost.evil.com", "127.0.0.1.nip.io", "2130706433", ""):
            assert status(address, path, Host=f"{host}:{port}") == 400
        for origin in ("http://evil.com", "null", f"http://localhost:{port}"):
            response, text = asked(address, path, Origin=origin)
            assert response.status == 403 and text.count("\n") == 1


@pytest.mark.parametrize("names", [[], ["localhost", "evil.com"]])
def test_a_request_has_one_host_name(address, names):
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=PATIENCE)
    connection.putrequest("GET", "/", skip_host=True)
    for name in names:
        connection.putheader("Host", name)
    connection.endheaders()
    assert connection.getresponse().status == 400
    connection.close()


def test_a_foreign_page_opens_no_websocket(address):
    port = urlsplit(address).port
    with page(address):
        pass
    for headers in (
        {"origin": "http://evil.com"},
        {"origin": f"http://localhost:{port}"},
        {"origin": f"http://evil.com:{port}", "host": f"evil.com:{port}"},
    ):
        with pytest.raises(InvalidStatus) as refused:
            page(address, **headers)
        assert refused.value.response.status_code in (400, 403)


def test_a_server_open_to_others_answers_to_the_names_of_its_machine(monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Vega.lab.example.org")
    for name in ("vega", "vega.local", "Vega.lab.example.org"):
        assert is_own(name, "0.0.0.0") and not is_own(name, "127.0.0.1")
    assert is_own("192.168.0.7", "0.0.0.0") and is_own("robot.lan", "robot.lan")
    assert not is_own("vega.evil.com", "0.0.0.0")


def test_files_beside_those_of_the_page_stay_here(address):
    for path in ("/server.py", "/..%2fserver.py", "/../server.py", "/%2fetc%2fpasswd"):
        for folder in ("", "/lrf3d", "/lrf3d/page.js"):
            assert status(address, folder + path) == 404


def test_malformed_messages_do_not_stop_a_drive(address):
    with page(address) as opened:
        for text in (
            "[" * 9_000,
            '{"view": ' * 1_000,
            "[]",
            "[8, 9]",
            "drive",
            '{"forward": 1e300, "turn": 0}',
            '{"forward": NaN}',
        ):
            opened.send(text)
            opened.recv(PATIENCE)
        for _ in range(9):
            opened.send('{"forward": 0.5, "turn": 0}')
            data = opened.recv(PATIENCE)
        words = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])["words"]
        assert float(words["v"]) > 0.0


def test_no_other_site_may_frame_the_page_or_load_its_files(address):
    for path in ("/", "/lrf3d/ground.jpg", "/lrf3d/world", "/lrf3d/page.js", "/nowhere"):
        response, _ = asked(address, path)
        assert "frame-ancestors 'none'" in response.headers["Content-Security-Policy"]
        assert response.headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert response.headers["X-Content-Type-Options"] == "nosniff"


def test_a_page_is_only_read(address):
    length = asked(address)[0].headers["Content-Length"]
    response, body = asked(address, method="HEAD")
    assert (response.status, body, response.headers["Content-Length"]) == (200, "", length)
    for method in ("POST", "DELETE", "PUT", "OPTIONS", "TRACE"):
        for path in ("/", "/lrf3d/world", SOCKET):
            response, body = asked(address, path, method)
            assert (response.status, response.headers["Allow"]) == (405, "GET, HEAD")


@pytest.mark.slow
def test_pages_that_have_stopped_reading_do_not_keep_the_server_from_ending():
    """Nor do those that never ask, as of a laptop that sleeps; `served` waits for the end."""
    opening = (
        f"GET {SOCKET} HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    with ExitStack() as pages, served("paper_room") as address:
        place = "127.0.0.1", urlsplit(address).port
        _silent, asking = (pages.enter_context(socket.create_connection(place)) for _ in "12")
        asking.sendall(opening.encode())
        assert asking.recv(12) == b"HTTP/1.1 101"
        # Each message asks for a drive of its own, whose answer nobody reads.
        for number in range(50):
            words = json.dumps({"drive": number}).encode()
            asking.sendall(bytes([0x81, 0x80 | len(words), 0, 0, 0, 0]) + words)


def test_too_long_a_message_ends_its_page_alone(address):
    with page(address) as opened, pytest.raises(ConnectionClosed):
        opened.send("1" * 20_000)
        while True:
            opened.recv(PATIENCE)
    assert status(address) == 200


@pytest.mark.parametrize("host", ["", "a" * 300, "a\0b", "nowhere.invalid", "192.0.2.1"])
def test_an_address_or_port_that_cannot_be_used_is_reported(host):
    with pytest.raises(InputError, match="--host"):
        bound(host, None)
