"""Who gets in: the gate before a live page, driven by raw requests and by websockets that mean harm."""

import http.client
import random
import time
from socket import IPPROTO_TCP

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from scanwright.design.errors import TaskError
from scanwright.serving.gate import Gate
from scanwright.serving.handshake import MOST_VISITORS, bound
from scanwright.serving.page_server import guarded_server

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 1.0, 1.0],
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


@pytest.fixture(scope="module")
def page():
    with guarded_server("a page") as (server, gate):
        server.slider = server.gui.add_slider("angle", -90.0, 90.0, 0.01, 0.0)
        yield server, gate


def get(gate, path, **headers):
    """Status, headers and body of one request, sent as it is written."""
    connection = http.client.HTTPConnection("127.0.0.1", gate.port, timeout=100)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in ({"Host": f"127.0.0.1:{gate.port}"} | headers).items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def talk(gate, *, origin=None, cookie=None, path="/"):
    """A websocket as the page opens it, with other words where they are given; an empty origin is none."""
    return connect(
        f"ws://127.0.0.1:{gate.port}{path}",
        origin=f"http://127.0.0.1:{gate.port}" if origin is None else origin or None,
        subprotocols=[f"viser-v{viser.__version__}"],
        additional_headers={"Cookie": cookie or f"scanwright-{gate.port}={gate.token}"},
        compression=None,
        max_size=None,
    )


def moves(server, gate, value):
    """Whether a move of the slider comes through."""
    with talk(gate) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        handle = server.slider._impl
        socket.send(
            msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": handle.uuid, "updates": {"value": value}})
        )
        until = time.monotonic() + 100
        while server.slider.value != value and time.monotonic() < until:
            time.sleep(0.01)
    return server.slider.value == value


def test_the_address_opens_the_page_and_leaves_a_cookie_that_scripts_cannot_read(page):
    _, gate = page
    status, headers, body = get(gate, f"/?token={gate.token}")
    assert status == 200 and b"<html" in body and int(headers["Content-Length"]) == len(body)
    assert b"<title>a page</title>" in body and b"Viser</title>" not in body and body.count(b"image/svg+xml") >= 1
    cookie, *rules = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Strict"} <= set(rules)
    assert get(gate, "/", Cookie=cookie)[0] == 200
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert gate.socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/?token=", {}),
        ("/?token=wrong", {}),
        ("/?token=TOKENx", {}),
        ("/", {"Cookie": "scanwright-PORT=wrong"}),
        ("/?token=TOKEN", {"Host": "evil.example"}),
        ("/?token=TOKEN", {"Host": "127.0.0.1:1"}),
        ("/?token=TOKEN", {"Origin": "http://evil.example"}),
        ("/?token=TOKEN", {"Origin": "null"}),
        ("/?token=TOKEN", {"Sec_Fetch_Site": "cross-site"}),
        ("/?token=TOKEN", {"Sec_Fetch_Site": "same-site"}),
        ("/?token=TOKEN&websocket=ws://evil.example", {}),
        ("/index.html?token=TOKEN", {}),
        ("//?token=TOKEN", {}),
        ("/../../../../etc/passwd?token=TOKEN", {}),
        ("/%2e%2e/%2e%2e/%2e%2e/etc/passwd?token=TOKEN", {}),
        ("/..\\..\\_viser.py?token=TOKEN", {}),
        ("http://evil.example/?token=TOKEN", {"Host": "evil.example"}),
    ],
)
def test_every_other_request_is_refused_and_told_nothing(page, path, headers):
    _, gate = page
    known = {"TOKEN": gate.token, "PORT": str(gate.port)}
    for word, value in known.items():
        path = path.replace(word, value)
        headers = {name: text.replace(word, value) for name, text in headers.items()}
    status, answered, body = get(gate, path, **headers)
    assert status in (403, 404)
    assert body.startswith(b"refused: ") and "Set-Cookie" not in answered and gate.token.encode() not in body


@pytest.mark.parametrize(
    "words",
    [
        {"cookie": "none=1"},
        {"cookie": "scanwright-1=x"},
        {"origin": "http://evil.example"},
        {"origin": "http://127.0.0.1:1"},
        {"origin": ""},
        {"path": "/other"},
    ],
    ids=str,
)
def test_a_websocket_of_another_page_is_refused(page, words):
    with pytest.raises(InvalidStatus), talk(page[1], **words):
        pass


def test_ten_megabytes_close_the_connection_and_nothing_else(page):
    server, gate = page
    with talk(gate) as socket:
        with pytest.raises(ConnectionClosed) as closed:
            socket.send(b"\xc6" + bytes(10_000_000))
            while True:
                socket.recv(timeout=100)
        assert closed.value.rcvd is None or closed.value.rcvd.code == 1009
    assert moves(server, gate, 1.25)


def test_uploads_sharing_and_other_attributes_never_reach_viser(page):
    server, gate = page
    uuid = server.slider._impl.uuid
    evil = [
        {"type": "FileTransferStartUpload", "source_component_uuid": uuid, "transfer_uuid": "a", "filename": "x",
         "mime_type": "text/plain", "part_count": 1, "size_bytes": 1},
        {"type": "ShareUrlRequest"},
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"update_cb": []}},
        {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 3.0, "removed": True}},
        {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": float("nan")}},
        {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": "9" * 100_000}},
        CAMERA | {"position": [1.0, 2.0]},
        CAMERA | {"fov": "wide"},
    ]  # fmt: skip
    before = gate.refused["unknown message"]
    with talk(gate) as socket:
        for message in evil:
            socket.send(msgspec.msgpack.encode(message))
        socket.send("text")
        until = time.monotonic() + 100
        while gate.refused["unknown message"] < before + len(evil) + 1 and time.monotonic() < until:
            time.sleep(0.01)
    assert gate.refused["unknown message"] == before + len(evil) + 1
    assert moves(server, gate, -2.5)


def test_a_thousand_random_messages_are_survived(page):
    server, gate = page
    dice = random.Random(7)
    words = ["type", "uuid", "updates", "value", "GuiUpdateMessage", "ViewerCameraMessage", server.slider._impl.uuid]
    words += [0, -1, 1e300, None, True, "", [], {}, b"\xff", float("inf"), [[[]]], 2**63]

    def anything(depth=0):
        kind = dice.random()
        if depth < 3 and kind < 0.3:
            return {str(dice.choice(words)): anything(depth + 1) for _ in range(dice.randrange(4))}
        return (
            [anything(depth + 1) for _ in range(dice.randrange(4))] if depth < 3 and kind < 0.5 else dice.choice(words)
        )

    def mutated():
        data = bytearray(msgspec.msgpack.encode(CAMERA))
        for _ in range(dice.randrange(1, 9)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        return bytes(data[: dice.randrange(1, len(data) + 1)])

    makers = [lambda: dice.randbytes(dice.randrange(200)), lambda: msgspec.msgpack.encode(anything()), mutated]
    with talk(gate) as socket:
        for _ in range(1000):
            socket.send(dice.choice(makers)())
    assert moves(server, gate, 12.5)


def test_only_so_many_visitors_get_in(page):
    _, gate = page
    until = time.monotonic() + 100
    while gate.visitors and time.monotonic() < until:
        time.sleep(0.01)
    sockets = [talk(gate) for _ in range(MOST_VISITORS)]
    with pytest.raises(InvalidStatus):
        talk(gate)
    for socket in sockets:
        socket.close()


def test_small_messages_are_sent_at_once():
    with bound(0) as listening:
        assert listening.proto == IPPROTO_TCP  # by which asyncio decides


def test_a_port_that_is_taken_is_said_in_one_line(page):
    with (
        pytest.raises(TaskError, match=f"port = {page[1].port}: address already in use"),
        guarded_server("a page", page[1].port),
    ):
        pass
    with pytest.raises(TaskError, match="port = 70000"), guarded_server("a page", 70_000):
        pass


def test_the_next_studio_has_the_port_and_the_token_of_the_last_one(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    first = Gate(0, "a", recall=True)
    first.socket.listen()
    beside = Gate(0, "b", recall=True)  # its port is taken: another one, with a token of its own
    assert beside.port != first.port and beside.token != first.token
    for gate in (first, beside):
        gate.socket.close()
    again = Gate(0, "a", recall=True)
    assert (again.port, again.token) == (beside.port, beside.token)
    again.socket.close()
    state = tmp_path / "scanwright/studio.json"
    assert state.stat().st_mode & 0o777 == 0o600
    state.chmod(0o644)  # anybody may have read it
    other = Gate(0, "a", recall=True)
    assert other.token != again.token
    other.socket.close()
