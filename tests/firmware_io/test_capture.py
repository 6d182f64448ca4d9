"""A capture holds the raw bytes of devices; its replay is a device that answers so."""

from contextlib import closing

import pytest

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.capture import capturing, replaying
from scanwright.firmware_io.serial_port import open_serial_port

CAPTURE = """\
1000 S > ff01
3000 S < aa
4000 S < bbcc
5000 L < 01
6000 S > ff0102
7000 S < dd
8000 S > ff01
9000 S < ee
"""


@pytest.fixture
def capture(tmp_path):
    file = tmp_path / "capture.txt"
    file.write_text(CAPTURE)
    return file


def asked(port, request, size):
    port.write(request)
    return port.read(size)


def test_a_replay_answers_as_the_device_did_and_can_be_captured_again(capture, tmp_path):
    again = tmp_path / "again.txt"
    with replaying(capture) as ports, capturing(again):
        assert list(ports) == ["S", "L"]
        with closing(open_serial_port(ports["S"], 9600, 5.0)) as port:
            assert asked(port, b"\xff\x01", 3) == b"\xaa\xbb\xcc"
            assert asked(port, b"\x00\xff", 0) == b""  # a byte that no request begins with, and a part of one
            assert asked(port, b"\x01\x02", 1) == b"\xdd"
            assert asked(port, b"\xff\x01", 1) == b"\xee"  # its second answer, which is the last one
            assert asked(port, b"\xff\x01", 1) == b"\xee"
        with closing(open_serial_port(ports["L"], 9600, 5.0)) as port:
            assert port.read(3) == b"\x01" * 3  # sends without a request, again and again
    lines = [line.split() for line in again.read_text().splitlines()]
    sent = b"".join(bytes.fromhex(data) for _, port, way, data in lines if (port, way) == (ports["S"], ">"))
    came = b"".join(bytes.fromhex(data) for _, port, way, data in lines if (port, way) == (ports["S"], "<"))
    assert sent == bytes.fromhex("ff01 00ff 0102 ff01 ff01") and came == bytes.fromhex("aabbcc dd ee ee")
    times = [int(line[0]) for line in lines]
    assert times == sorted(times)


def test_a_capture_is_never_written_over_and_a_damaged_one_is_named(capture):
    with pytest.raises(RecordingError, match="File exists"), capturing(capture):
        pass
    capture.write_text("1 S > ff\n2 S = 00\n")
    with pytest.raises(RecordingError, match="line 2: not a capture"), replaying(capture):
        pass
    capture.write_bytes(b"\xff\xfe")
    with (
        pytest.raises(RecordingError, match=r"txt: not a capture; `scanwright doctor --capture FILE`"),
        replaying(capture),
    ):
        pass
    with pytest.raises(RecordingError, match="cannot read: No such file"), replaying(capture.with_name("none")):
        pass
