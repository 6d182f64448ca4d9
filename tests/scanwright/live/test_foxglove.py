"""A recording and a scan in Foxglove: a client of its protocol, and a reader of its files, find the same cloud."""

import http.client
import json
import signal
import struct
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from dataclasses import replace

import foxglove
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from patience import BOUND_S, until
from rosbags.typesys import Stores, get_typestore
from websockets.sync.client import connect

from benchmarks.firmware_io.recordings.deskew import deskew
from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError, TaskError
from scanwright.firmware_io.recording.recording import open_recording, recording_writer
from scanwright.firmware_io.samples import straight
from scanwright.firmware_io.scan.live_feed import Batch
from scanwright.live.foxglove_channels import FoxgloveChannels
from scanwright.live.foxglove_server import BACKLOG, foxglove_server
from scanwright.live.foxglove_view import mcap_log, pass_on, view_recording, write_for_foxglove
from scanwright.serving.handshake import as_origins

ANGLES = AngleSet(
    task="foxglove",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    t_world_rot_mm=(1, 2, 130),
    sensor="any",
    servo="any",
)
URDF = (
    '<robot name="r"><link name="servo"><visual><geometry><mesh filename="parts/a.stl"/></geometry></visual></link>'
    '<joint name="servo_mount"><origin xyz="0 0 0"/></joint><joint name="laser_mount"><origin xyz="0 0 0"/></joint>'
    "</robot>"
)
SUBPROTOCOL = "foxglove.sdk.v1"
TRIES, QUIET_S = 10, 20.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("foxglove")
    (path / "angles.json").write_text(ANGLES.to_json())
    (path / "scanner.urdf").write_text(URDF)
    simulated = simulate(FURNISHED, Setup(beams=60, sweeps=((90.0, 90.0),)), Truth())
    log = simulated.log
    with recording_writer(path / "r.mcap", {"hold": "true"}) as writer:  # straight between angles, as the oracle goes
        for time_ns, position_rad in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True):
            writer.joint(time_ns, position_rad)
        for scan in simulated.scans:
            writer.scan(scan)
    return path


def cloud_of(recording):
    """Points of each scan by its stamp."""
    source = open_recording(recording)
    return {scan.stamp_ns: deskew(scan, straight(source.joint_log), ANGLES) for scan in source.scans()}


def xyz(data, step):
    kind = {"names": ["x", "y", "z"], "formats": ["<f4"] * 3, "offsets": [0, 4, 8], "itemsize": step}
    rows = np.frombuffer(bytes(data), np.dtype(kind))
    return np.stack([rows[axis] for axis in "xyz"], axis=1)


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def test_foxglove_shows_scanner_and_cloud_from_the_file_alone(folder, tmp_path):
    out = tmp_path / "shown.mcap"
    assert write_for_foxglove(folder / "r.mcap", folder / "angles.json", out) == 40
    with out.open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    said = {}
    for schema, channel, message, value in decoded:
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        said.setdefault(channel.topic, []).append((message.log_time, value))
    assert set(said) == {"/scan", "/joint_states", "/points", "/tf", "/robot_description"}
    expected = cloud_of(folder / "r.mcap")
    assert len(said["/points"]) == len(said["/scan"]) == 40
    for log_time, message in said["/points"]:
        assert log_time == stamp_of(message) and message.header.frame_id == "world"
        np.testing.assert_allclose(xyz(message.data, message.point_step), expected[log_time], atol=1e-5)
    assert (folder / "parts/a.stl").as_uri() in said["/robot_description"][0][1].data
    frames = {(one.header.frame_id, one.child_frame_id) for _, m in said["/tf"] for one in m.transforms}
    assert frames == {("world", "servo"), ("servo", "rot"), ("rot", "laser")}
    with pytest.raises(RecordingError, match="Foxglove reads MCAP"):
        write_for_foxglove(folder / "r.mcap", folder / "angles.json", tmp_path / "shown.bag")


def heard_by(client):
    """The clouds of /points that a client hears until it hears nothing for a while."""
    topics, clouds = {}, {}
    while "/points" not in topics:
        told = json.loads(client.recv(BOUND_S))
        if told["op"] == "advertise":
            topics |= {channel["topic"]: channel for channel in told["channels"]}
    channel = topics["/points"]
    assert (channel["schemaName"], channel["encoding"]) == ("sensor_msgs/msg/PointCloud2", "cdr")
    wanted = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}
    client.send(json.dumps(wanted))
    store = get_typestore(Stores.ROS2_JAZZY)
    with suppress(TimeoutError):
        while len(clouds) < 40:
            data = client.recv(QUIET_S)
            if isinstance(data, bytes) and data[0] == 1:
                number, at_ns = struct.unpack_from("<IQ", data, 1)
                message = store.deserialize_cdr(data[13:], "sensor_msgs/msg/PointCloud2")
                assert number == 7 and at_ns == stamp_of(message)
                clouds[at_ns] = xyz(message.data, message.point_step)
    return clouds


def test_a_client_of_the_protocol_reads_the_recording_back(folder):
    words = ["view", folder / "r.mcap", "--angles", folder / "angles.json", "--port", "0", "--rate", "20"]
    with subprocess.Popen(
        [sys.executable, "-m", "scanwright", *map(str, words)], stderr=subprocess.PIPE, text=True
    ) as server:
        try:
            address = next(word for word in server.stderr.readline().split() if word.startswith("ws://127.0.0.1:"))
            clouds, said = {}, []
            threading.Thread(target=lambda: said.extend(server.stderr), daemon=True).start()
            for attempt in range(
                TRIES
            ):  # who is slow to subscribe has missed the first scans: the next time shows all again
                with connect(address, subprotocols=[SUBPROTOCOL], max_size=None) as client:
                    clouds |= heard_by(client)
                if len(clouds) == 40:
                    break
                with suppress(AssertionError):  # who comes sooner is taken for the last one
                    until(lambda times=attempt: sum("the next one" in line for line in said) > times, 30)
            server.send_signal(signal.SIGINT)
            assert server.wait(BOUND_S) == 0  # Ctrl-C is the way to end it
        finally:
            server.kill()
    expected = cloud_of(folder / "r.mcap")
    assert clouds.keys() == expected.keys()
    for at_ns, points in clouds.items():
        np.testing.assert_allclose(points, expected[at_ns], atol=1e-5)


def test_devices_that_began_anew_are_assembled_as_if_nothing_had_been_before(folder, tmp_path):
    source = open_recording(folder / "r.mcap")
    scans, joints, later_ns = list(source.scans()), source.joint_log, 10_000_000_000
    first = Batch(joints.time_ns, joints.position_rad, tuple(scans), (), 0)
    again = [replace(scan, stamp_ns=scan.stamp_ns + later_ns) for scan in scans]
    second = Batch(joints.time_ns + later_ns, joints.position_rad + 2.0, tuple(again), (), 0)
    with mcap_log(tmp_path / "live.mcap") as log:
        channels = FoxgloveChannels(ANGLES, None, None, log)
        pass_on(first, channels)
        pass_on(second, channels)
        channels.close()
        alone = FoxgloveChannels(ANGLES, None, None, log, wall_minus_ns=1)
        pass_on(second, alone)
        alone.close()
    with (tmp_path / "live.mcap").open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    clouds = {stamp_of(m): xyz(m.data, m.point_step) for _, channel, _, m in decoded if channel.topic == "/points"}
    assert len(clouds) == 120
    for scan in again:
        np.testing.assert_array_equal(clouds[scan.stamp_ns], clouds[scan.stamp_ns + 1])


def test_a_scan_comes_batch_by_batch_on_the_clock_of_the_world(folder, tmp_path):
    source = open_recording(folder / "r.mcap")
    scans, joints = list(source.scans()), source.joint_log
    halves = [(slice(0, 130), scans[:20]), (slice(130, None), scans[20:])]
    with mcap_log(tmp_path / "live.mcap") as log:
        channels = FoxgloveChannels(ANGLES, None, None, log, smooth=False, wall_minus_ns=5)
        for some, few in halves:
            pass_on(Batch(joints.time_ns[some], joints.position_rad[some], tuple(few), ("a line",), 0), channels)
        channels.close()
    with (tmp_path / "live.mcap").open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    expected = cloud_of(folder / "r.mcap")
    clouds = {stamp_of(m): xyz(m.data, m.point_step) for _, channel, _, m in decoded if channel.topic == "/points"}
    assert {at_ns - 5 for at_ns in clouds} == expected.keys()
    assert {stamp_of(m) - 5 for _, channel, _, m in decoded if channel.topic == "/scan"} == expected.keys()
    assert not [channel for _, channel, _, _ in decoded if channel.topic == "/robot_description"]
    for at_ns, points in clouds.items():
        np.testing.assert_allclose(points, expected[at_ns - 5], atol=1e-5)


def test_a_port_that_is_taken_is_said_in_one_line(folder):
    with (
        serving() as (server, _),
        pytest.raises(TaskError, match=f"port = {server.port}: address already in use"),
    ):
        view_recording(folder / "r.mcap", folder / "angles.json", print, port=server.port)


TOPICS = {"/a": ("std_msgs/msg/String", "string data"), "/b": ("std_msgs/msg/Header", "uint32 sec")}


@contextmanager
def serving(*allow_origins):
    """A server, and the steps that it reports."""
    steps = []
    with foxglove_server("a scan", TOPICS, 0, lambda step, _=None: steps.append(step), allow_origins) as server:
        yield server, steps


def handshake(port, **headers):
    """Status and body of a handshake with headers of our own; None is a header that is left out."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=BOUND_S)
    connection.putrequest("GET", "/", skip_host=True)
    usual = {
        "Host": f"127.0.0.1:{port}",
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Protocol": SUBPROTOCOL,
    }
    for name, value in (usual | headers).items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = b"" if answer.status == 101 else answer.read()
    connection.close()
    return answer.status, body


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "https://app.foxglove.dev"},
        {"Origin": "https://studio.foxglove.dev"},
        {"Origin": "file://"},
        {"Origin": "https://viewer.example.org"},
        {"Host": "localhost:PORT"},
    ],
    ids=str,
)
def test_programs_and_pages_of_foxglove_and_of_the_user_may_look(headers):
    with serving("https://viewer.example.org") as (server, said):
        known = {name: value.replace("PORT", str(server.port)) for name, value in headers.items()}
        assert handshake(server.port, **known)[0] == 101
        assert len(said) == 1 and server.address in said[0]


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "https://app.foxglove.dev.evil.example"},
        {"Origin": "http://app.foxglove.dev"},
        {"Origin": "http://127.0.0.1:PORT"},
        {"Origin": "null"},
        {"Origin": ""},
        {"Host": "evil.example:PORT"},
        {"Host": "evil.example:PORT", "Origin": "https://app.foxglove.dev"},
        {"Host": "127.0.0.1:1"},
    ],
    ids=str,
)
def test_a_page_of_another_origin_and_a_bent_name_are_refused(headers, caplog):
    with serving() as (server, _):
        known = {name: value.replace("PORT", str(server.port)) for name, value in headers.items()}
        for _ in range(3):
            status, body = handshake(server.port, **known)
            assert status == 403 and body.startswith(b"refused: foreign ") and b"--allow-origin" in body
    assert [line.partition("foreign ")[0] for line in caplog.messages] == ["refused a viewer: "]  # once, not each time


@pytest.mark.parametrize("text", ["null", "*", "https://", "https://a.example/page", "https://*.example", "a b"])
def test_an_origin_that_any_page_could_claim_is_none(text):
    with pytest.raises(TaskError, match=r"allow_origin = .*: not an origin"):
        as_origins([text])


def test_an_origin_is_allowed_as_browsers_write_it():
    assert as_origins(None) == ()
    assert as_origins(["HTTPS://Viewer.example.org/", "http://localhost:3000", "http://[::1]:80"]) == (
        "https://viewer.example.org",
        "http://localhost:3000",
        "http://[::1]:80",
    )


def dialogue(port, log):
    """What a client hears that subscribes to /a, and /b, and leaves /a again; sessions and libraries differ."""
    heard = []
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], compression=None) as client:
        about, advertised = json.loads(client.recv(BOUND_S)), json.loads(client.recv(BOUND_S))
        heard.append({key: value for key, value in about.items() if key not in ("sessionId", "metadata")})
        of = {channel["topic"]: channel.pop("id") for channel in advertised["channels"]}
        heard.append(sorted(advertised["channels"], key=lambda channel: channel["topic"]))
        for number, topic in ((7, "/a"), (8, "/b")):
            client.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": number, "channelId": of[topic]}]}))
        heard += until_heard(client, lambda: log("/b", b"first", 5))
        log("/a", b"second", 2**40)
        heard.append(next(data for data in iter(lambda: client.recv(BOUND_S), None) if data[1:5] == b"\7\0\0\0"))
        client.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [7]}))
    return heard


def until_heard(client, log):
    """The first message that comes of one that is sent again and again: who subscribes is served a moment later."""
    data = []
    while not data:
        log()
        with suppress(TimeoutError):
            data.append(client.recv(0.05))
    return data


def test_a_client_hears_from_the_server_what_it_hears_from_the_one_of_foxglove():
    context = foxglove.Context()
    channels = {
        topic: foxglove.Channel(
            topic,
            schema=foxglove.Schema(name=kind, encoding="ros2msg", data=text.encode()),
            message_encoding="cdr",
            context=context,
        )
        for topic, (kind, text) in TOPICS.items()
    }
    theirs = foxglove.start_server(name="a scan", port=0, context=context)
    try:
        url, port = theirs.app_url(), str(theirs.port)
        expected = dialogue(theirs.port, lambda topic, data, at_ns: channels[topic].log(data, log_time=at_ns))
    finally:
        theirs.stop()
    with serving() as (server, said):
        assert dialogue(server.port, server.log) == expected
        assert url.replace(port, str(server.port)) in said[0]
        until(lambda: not server.has_subscribers)  # the client has gone


def test_malformed_messages_of_a_client_do_no_harm():
    evil = [
        "x",
        "[]",
        "[" * 5000,
        "{}",
        '{"op": 3}',
        '{"op": "subscribe"}',
        '{"op": "subscribe", "subscriptions": [{"id": 1.5, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 0}]}',
        '{"op": "subscribe", "subscriptions": [{"id": [], "channelId": null}]}',
        '{"op": "unsubscribe", "subscriptionIds": [[], {}, 5]}',
        b"\1\2",
    ]
    many = [{"id": number, "channelId": 1} for number in range(200)]
    with (
        serving() as (server, _),
        connect(server.address, subprotocols=[SUBPROTOCOL], compression=None) as client,
    ):
        for message in evil:
            client.send(message)
        client.ping().wait(BOUND_S)
        assert not server.has_subscribers
        client.send(json.dumps({"op": "subscribe", "subscriptions": many}))
        until(lambda: server.has_subscribers)
        client.ping().wait(BOUND_S)
        (known,) = server._clients
        assert len(known.topics) == 64


def test_a_client_that_does_not_read_loses_the_oldest_and_holds_up_nobody():
    with (
        serving() as (server, _),
        connect(server.address, subprotocols=[SUBPROTOCOL], compression=None, max_queue=1, max_size=None) as client,
    ):
        client.send('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]}')
        until(lambda: server.has_subscribers)
        for number in range(2 * BACKLOG):
            server.log("/a", struct.pack("<I", number) + bytes(10_000), number)
        (known,) = server._clients
        until(lambda: known.waiting and known.waiting[-1][13:17] == struct.pack("<I", 2 * BACKLOG - 1))
        assert len(known.waiting) == BACKLOG
        client.close_socket()


def test_in_a_browser_a_page_of_another_origin_reads_nothing(browser):
    with serving() as (server, _):
        page = browser.open(f"http://127.0.0.1:{server.port}/")  # refused, but a page of another origin than Foxglove's
        assert "Missing" not in page.title()
        outcome = page.evaluate(
            """([address, protocol]) => new Promise((done) => {
              const socket = new WebSocket(address, [protocol]);
              socket.onmessage = () => done("read");
              socket.onerror = () => done("refused");
            })""",
            [server.address, SUBPROTOCOL],
        )
        assert outcome == "refused"
        page.context.close()  # its console may still report the refusal; after this nothing comes any more
    browser.complaints.clear()
