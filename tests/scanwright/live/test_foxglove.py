"""A recording and a scan in Foxglove: a client of its protocol, and a reader of its files, find the same cloud."""

import json
import signal
import struct
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace

import foxglove
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from patience import BOUND_S, until
from rosbags.typesys import Stores, get_typestore
from websockets.sync.client import connect

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate
from design.angles import Angles, AngleSet
from design.errors import DeviceError, RecordingError
from firmware_io.assembly.deskew import deskew
from firmware_io.recording.recording import RecordingWriter, open_recording
from firmware_io.samples import straight
from firmware_io.scan.live_feed import Batch
from scanwright.live.foxglove_channels import FoxgloveChannels
from scanwright.live.foxglove_view import tell, view_recording, write_for_foxglove

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
    with RecordingWriter(path / "r.mcap", {"hold": "true"}) as writer:  # straight between angles, as the oracle goes
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
    scans, log, later_ns = list(source.scans()), source.joint_log, 10_000_000_000
    first = Batch(log.time_ns, log.position_rad, tuple(scans), (), 0)
    again = [replace(scan, stamp_ns=scan.stamp_ns + later_ns) for scan in scans]
    second = Batch(log.time_ns + later_ns, log.position_rad + 2.0, tuple(again), (), 0)
    context = foxglove.Context()
    with foxglove.open_mcap(tmp_path / "live.mcap", context=context):
        channels = FoxgloveChannels(ANGLES, None, None, context)
        tell(first, channels)
        tell(second, channels)
        channels.close()
        alone = FoxgloveChannels(ANGLES, None, None, context, wall_minus_ns=1)
        tell(second, alone)
        alone.close()
    with (tmp_path / "live.mcap").open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    clouds = {stamp_of(m): xyz(m.data, m.point_step) for _, channel, _, m in decoded if channel.topic == "/points"}
    assert len(clouds) == 120
    for scan in again:
        np.testing.assert_array_equal(clouds[scan.stamp_ns], clouds[scan.stamp_ns + 1])


def test_a_scan_comes_batch_by_batch_on_the_clock_of_the_world(folder, tmp_path):
    source = open_recording(folder / "r.mcap")
    scans, log = list(source.scans()), source.joint_log
    halves = [(slice(0, 130), scans[:20]), (slice(130, None), scans[20:])]
    context = foxglove.Context()
    with foxglove.open_mcap(tmp_path / "live.mcap", context=context):
        channels = FoxgloveChannels(ANGLES, None, None, context, smooth=False, wall_minus_ns=5)
        for some, few in halves:
            tell(Batch(log.time_ns[some], log.position_rad[some], tuple(few), ("a line",), 0), channels)
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
    context = foxglove.Context()
    server = foxglove.start_server(port=0, context=context)
    try:
        with pytest.raises(DeviceError, match=f"--port {server.port}: cannot serve there"):
            view_recording(folder / "r.mcap", folder / "angles.json", print, port=server.port)
    finally:
        server.stop()
