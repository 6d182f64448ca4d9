"""CoLa against bytes that others wrote down: SICK's manuals and captures of real sensors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.lidar.sick import cola
from scanwright.firmware_io.lidar.sick.cola import Telegram, TelegramSplitter, Writer, framed
from scanwright.firmware_io.lidar.sick.scan_data import Channel, ScanData, scan_data, telegram_of
from scanwright.firmware_io.lidar.sick.values import Reader

HEAD_TIM = (
    "sSN LMDscandata 1 1 107375C 0 0 E784 E789 3D611E4A 3D612D1F 0 0 1 0 0 5DC 36 0 1 DIST1 3F800000 00000000 FFF92230 "
    "2710 10F "
)
HEAD_LMS = (
    "sSN LMDscandata 1 1 A037B9 0 0 C1C3 C1C6 8B621C37 8B627603 0 0 7 0 0 1388 168 0 1 DIST1 3F800000 00000000 "
    "FFF92230 1388 21D "
)


def sample(head, beams, tail):
    return Telegram((head + " ".join(f"{k:X}" for k in range(beams)) + tail).encode(), binary=False)


TIM = sample(HEAD_TIM, 271, " 0 0 1 B not defined 0 0 0")
LMS = sample(HEAD_LMS, 541, " 0 0 0 0 0 0")


@pytest.mark.parametrize(
    ("command", "values", "length", "end", "xor"),
    [
        ("sRN DeviceIdent", [], 0x0F, "", 0x25),
        ("sMN SetAccessMode", [("u8", 3), ("u32", 0xF4724744)], 0x17, "03F4724744", 0xB3),
        ("sAN SetAccessMode", [("u8", 1)], 0x13, "01", 0x38),
        ("sRN SCdevicestate", [], 0x11, "", 0x30),
        ("sRA SCdevicestate", [("u8", 1)], 0x13, "01", 0x1E),
        ("sRA SCdevicestate", [("u8", 0)], 0x13, "00", 0x1F),
        ("sRN LMPoutputRange", [], 0x12, "", 0x5E),
        (
            "sRA LMPoutputRange",
            [("u16", 1), ("u32", 0x683), ("i32", -50000), ("i32", 1850000)],
            0x21,
            "000100000683FFFF3CB0001C3A90",
            0xCF,
        ),
        ("sMN LMCstartmeas", [], 0x10, "", 0x68),
        ("sAN LMCstartmeas", [("u8", 0)], 0x12, "00", 0x44),
        ("sMN Run", [], 0x07, "", 0x19),
        ("sAN Run", [("u8", 1)], 0x09, "01", 0x34),
        ("sEN LMDscandata", [("u8", 1)], 0x11, "01", 0x33),
        ("sEA LMDscandata", [("u8", 1)], 0x11, "01", 0x3C),
    ],
)
def test_bytes_of_cola_b(command, values, length, end, xor):
    out = Writer(command, binary=True)
    for kind, value in values:
        out.number(kind, value)
    sent = framed(out.telegram())
    head = b"\x02\x02\x02\x02" + length.to_bytes(4, "big") + command.encode()
    assert sent == head + (b" " + bytes.fromhex(end) if end else b"") + bytes([xor])
    (heard,) = TelegramSplitter().feed(sent)
    assert heard == out.telegram()
    reader = heard.values()
    assert [reader.number(kind) for kind, _ in values] == [value for _, value in values]


def test_bytes_of_cola_a():
    login = Writer("sMN SetAccessMode", binary=False).number("u8", 3).number("u32", 0xF4724744).telegram()
    assert framed(login).hex(" ").upper() == (
        "02 73 4D 4E 20 53 65 74 41 63 63 65 73 73 4D 6F 64 65 20 33 20 46 34 37 32 34 37 34 34 03"
    )
    told = Reader(b"0 9C4 1 9C4 FFFF3CB0 1C3A90", binary=False)  # LMS500 instructions: an answer to mLMPsetscancfg
    kinds = ("u8", "u32", "u16", "u32", "i32", "i32")
    assert [told.number(kind) for kind in kinds] == [0, 2500, 1, 2500, -50000, 1850000]
    asked = Reader(b"+2500 +1 +2500 -50000 +1850000", binary=False)  # and the request, in decimals
    assert [asked.number(kind) for kind in kinds[1:]] == [2500, 1, 2500, -50000, 1850000]


@pytest.mark.parametrize(
    "sent",
    [
        "02 73 46 41 20 31 03",
        "02 02 02 02 00 00 00 05 73 46 41 00 01 75",  # TiM781 manual: no space
        "02 02 02 02 00 00 00 06 73 46 41 20 00 01 55",
    ],
)
def test_errors_of_all_writings_have_the_manuals_words(sent):
    (told,) = TelegramSplitter().feed(bytes.fromhex(sent))
    assert (told.word, cola.error_words(cola.error_code(told))) == (b"sFA", "error 1: access denied: login required")


def test_captured_scans():
    tim, lms = scan_data(TIM), scan_data(LMS)
    assert (tim.serial_number, tim.telegram_count, tim.scan_count, tim.status) == (0x107375C, 0xE784, 0xE789, 0)
    assert (tim.scan_rate_hz, tim.measuring_rate_hz, lms.scan_rate_hz, lms.measuring_rate_hz) == (15, 5400, 50, 36000)
    assert [scan.wide[0].bearing_deg for scan in (tim, lms)] == [(-135.0, 1.0), (-135.0, 0.5)]
    assert [scan.wide[0].raw.size for scan in (tim, lms)] == [271, 541]
    range_m = lms.channel("DIST1").range_m()
    assert np.isnan(range_m[0])
    np.testing.assert_array_equal(range_m[1:], np.float32(np.arange(1, 541) / 1e3))
    # LMS100: sent 22.988 ms after its time, that of the first beam. TiM55x: 3.797 ms, of a scan of 50.2 ms.
    assert (lms.sent_after_us, tim.sent_after_us) == (22988, 3797)
    assert tim.wide[0].raw.size * tim.beam_us == pytest.approx(271 * 1e6 / 15 / 360)


def test_offsets_of_the_binary_scan():
    """Offsets from the first 02, as SICK's own driver reads them."""
    scan = scan_data(LMS)
    sent = framed(telegram_of(scan, binary=True))
    at = {38: (4, scan.scan_us), 42: (4, scan.sent_us), 52: (4, 5000), 56: (4, 360), 60: (2, 0), 62: (2, 1)}
    at |= {64 + 19: (2, 541), 64 + 21 + 2 * 77: (2, 77)}
    assert {k: int.from_bytes(sent[k : k + size], "big") for k, (size, _) in at.items()} == {
        k: value for k, (_, value) in at.items()
    }
    assert sent[64:69] == b"DIST1"


SCANS = st.builds(
    ScanData,
    serial_number=st.integers(0, 2**32 - 1),
    status=st.sampled_from([0, 1, 2, 5]),
    telegram_count=st.integers(0, 65535),
    scan_count=st.integers(0, 65535),
    scan_us=st.integers(0, 2**32 - 1),
    sent_us=st.integers(0, 2**32 - 1),
    layer=st.integers(-(2**15), 2**15 - 1),
    scan_rate_hz=st.sampled_from([15.0, 25.0, 50.0]),
    measuring_rate_hz=st.sampled_from([5400.0, 36000.0]),
    encoders=st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 65535)), max_size=3).map(tuple),
    wide=st.lists(
        st.builds(
            Channel,
            name=st.sampled_from(["DIST1", "RSSI1", "VANG1"]),
            scale=st.sampled_from([1.0, 2.0]),
            offset=st.sampled_from([0.0, -8.5]),
            start=st.integers(-1_800_000, 1_800_000),
            step=st.integers(1, 10_000),
            raw=st.lists(st.integers(0, 255), min_size=1, max_size=40).map(lambda raw: np.array(raw, np.uint16)),
        ),
        min_size=1,
        max_size=3,
    ).map(tuple),
    narrow=st.just(()),
)


@given(SCANS, st.booleans(), st.lists(st.integers(1, 50), max_size=8))
def test_scans_come_through_in_both_dialects_however_they_are_split(scan, binary, cuts):
    sent = b"noise" + framed(telegram_of(scan, binary=binary))
    splitter, told, at = TelegramSplitter(), [], 0
    for length in [*cuts, len(sent)]:
        told += splitter.feed(sent[at : at + length])
        at += length
    assert (len(told), splitter.bad) == (1, 1)
    heard = scan_data(told[0])
    for field in ("serial_number", "status", "scan_us", "sent_us", "layer", "scan_rate_hz", "encoders", "narrow"):
        assert getattr(heard, field) == getattr(scan, field)
    for ours, theirs in zip(heard.wide, scan.wide, strict=True):
        assert (ours.name, ours.scale, ours.offset, ours.start, ours.step) == (
            theirs.name, theirs.scale, theirs.offset, theirs.start, theirs.step
        )  # fmt: skip
        np.testing.assert_array_equal(ours.raw, theirs.raw)


@given(SCANS, st.booleans(), st.data())
def test_damage_gives_typed_errors_only_and_the_next_scan_comes(scan, binary, data):
    sent = bytearray(framed(telegram_of(scan, binary=binary)))
    for _ in range(data.draw(st.integers(1, 5))):
        sent[data.draw(st.integers(0, len(sent) - 1))] = data.draw(st.integers(0, 255))
    splitter = TelegramSplitter()
    for told in splitter.feed(bytes(sent)):
        try:
            scan_data(told)
        except ProtocolError:
            continue
    good = framed(telegram_of(scan, binary=binary))
    # A damaged length may swallow what follows, up to the longest telegram.
    told = splitter.feed(good * (2 + 2 * cola.LONGEST // len(good)))
    assert told[-1].payload == telegram_of(scan, binary=binary).payload


def test_a_wrong_checksum_is_counted_and_passed_over():
    good = framed(telegram_of(scan_data(LMS), binary=True))
    splitter = TelegramSplitter()
    told = splitter.feed(good[:-1] + bytes([good[-1] ^ 1]) + good)
    assert (len(told), splitter.bad) == (1, 1)


@given(st.binary(max_size=400))
def test_noise_is_no_telegram(noise):
    TelegramSplitter().feed(b"\x02\x02\x02\x02" + noise)
    try:
        scan_data(Telegram(b"sSN LMDscandata " + noise, binary=noise[:1] < b"\x80"))
    except ProtocolError:
        return
