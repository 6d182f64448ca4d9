"""SCIP 2.0: bytes of real sensors, the specification's examples, another project's decoder, and damaged streams."""

import random

import numpy as np
import pytest
from hokuyolx import HokuyoLX
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.design.errors import ProtocolError, ScanwrightError
from scanwright.firmware_io.lidar.scip import measurement, parameters, protocol

CAPTURES = {
    "urg_04lx.rx": (10, 6968830, 682, 0, [392, 392, 391, 385, 381], 4166),
    "utm_30lx.rx": (11, 4821609, 1081, 1081, [45, 48, 49, 50, 49], 5856),
    "uxm_30lx_e.rx": (22, 3293169, 761, 0, [353, 353, 588, 1311, 1343], 3179),
    "urg04lx_ug01_gd.bin": (1, 11149560, 682, 0, [6, 6, 6, 4190, 6], 5461),
}


def replies_of(stream, pieces=()):
    splitter, found, begin = protocol.Splitter(), [], 0
    for end in (*sorted(pieces), len(stream)):
        found += splitter.feed(stream[begin:end])
        begin = end
    return found, splitter.bad


@pytest.mark.parametrize("name", CAPTURES)
def test_captures_decode_to_the_last_byte(data, name):
    stream = (data / "scip" / name).read_bytes()
    count, stamp_ms, ranges, intensities, first, largest = CAPTURES[name]
    found, bad = replies_of(stream)
    assert (len(found), bad) == (count, 0)
    taken = measurement.measurement(found[-1])
    assert (taken.stamp_ms, taken.value.size, taken.intensity.size) == (stamp_ms, ranges, intensities)
    assert taken.value[:5].tolist() == first
    assert taken.value.max() == largest


@pytest.mark.parametrize("name", CAPTURES)
def test_captures_are_written_again_byte_for_byte(data, name):
    stream = (data / "scip" / name).read_bytes()
    again = b""
    for reply in replies_of(stream)[0]:
        if measurement.is_scan(reply):
            taken = measurement.measurement(reply)
            numbers = np.stack([taken.value, taken.intensity], axis=1) if taken.intensity.size else taken.value
            lines = protocol.data_lines(
                taken.stamp_ms, protocol.encode(numbers.ravel().tolist(), taken.window.characters)
            )
        elif reply.command in (b"VV", b"PP", b"II"):
            lines = protocol.text_lines(protocol.information(reply).items())
        else:
            lines = [protocol.summed(line) for line in reply.lines]
        again += protocol.reply(reply.echo, reply.status, lines)
    assert again == stream


@pytest.mark.parametrize("name", CAPTURES)
def test_another_projects_decoder_reads_the_same(data, name):
    stream = (data / "scip" / name).read_bytes()
    taken = measurement.measurement(replies_of(stream)[0][-1])
    block = stream[:-2].split(b"\n\n")[-1].decode().split("\n")
    theirs = HokuyoLX._process_scan_data(HokuyoLX, block[3:], taken.window.intensity)
    ours = np.stack([taken.value, taken.intensity], axis=1) if taken.window.intensity else taken.value
    np.testing.assert_array_equal(theirs, ours)


@pytest.mark.parametrize("name", ["urg_04lx.rx", "uxm_30lx_e.rx"])
@settings(max_examples=20, deadline=None)
@given(pieces=st.lists(st.integers(0, 3000), max_size=60))
def test_pieces_of_any_size_give_the_same_replies(data, name, pieces):
    stream = (data / "scip" / name).read_bytes()
    assert replies_of(stream, pieces) == replies_of(stream)


def test_the_specifications_examples():
    assert [protocol.encode([n], k) for n, k in [(1234, 2), (5432, 3), (16_000_000, 4)]] == [b"CB", b"1Dh", b"m2@0"]
    assert [protocol.summed(s) for s in (b"00", b"99", b"02", b"0E")] == [b"00P", b"99b", b"02R", b"0Ee"]


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_what_was_written_is_read(draw):
    first = draw.draw(st.integers(0, 1000))
    characters, intensity = draw.draw(st.sampled_from([(2, False), (3, False), (3, True)]))
    cluster, last = draw.draw(st.integers(1, 99)), first + draw.draw(st.integers(0, 300))
    window = measurement.Window(
        first_step=first, last_step=last, cluster=cluster, characters=characters, intensity=intensity
    )
    size = len(range(first, last + 1, cluster))
    total = size * (1 + intensity)
    numbers = draw.draw(st.lists(st.integers(0, 64**characters - 1), min_size=total, max_size=total))
    stamp_ms, count = draw.draw(st.integers(0, 2**24 - 1)), draw.draw(st.integers(0, 99))
    skip = draw.draw(st.integers(0, 9))
    lines = protocol.data_lines(stamp_ms, protocol.encode(numbers, characters))
    stream = protocol.reply(measurement.continuous(window, skip=skip, count=count), "99", lines)
    stream += protocol.reply(b"G" + measurement.continuous(window)[1:-3], "00", lines)
    assert all(len(line) <= 65 for line in stream.split(b"\n"))
    (scan, one), bad = replies_of(stream)
    taken = measurement.measurement(scan)
    assert (bad, taken.stamp_ms, taken.remaining, taken.window) == (0, stamp_ms, count, window)
    assert (taken.value.tolist(), taken.intensity.tolist()) == (
        (numbers[::2], numbers[1::2]) if intensity else (numbers, [])
    )
    assert measurement.measurement(one).value.tolist() == taken.value.tolist()


def test_firmware_that_sums_otherwise_is_understood():
    text = b"SCSP:Initial(2400[rpm])<-Default setting by user"
    for summed in (text, text + b";", text.partition(b"<-")[0]):
        stream = b"II\n00P\n" + text + b";" + bytes([protocol.checksum(summed)]) + b"\n\n"
        (reply,), bad = replies_of(stream)
        assert (protocol.information(reply)["SCSP"], bad) == (text.decode()[5:], 0)


def test_scip_1_and_refusals_are_words():
    (old, step, refused, adjusting), bad = replies_of(b"QT\nE\n\nSCIP2.0\n0\n\nMD0000108101000\n04T\n\nVV\n0Ee\n\n")
    assert (old.status, step.status, refused.status, bad) == ("E", "0", "04", 0)
    assert "time" in adjusting.meaning()
    with pytest.raises(ProtocolError, match="status 04"):
        measurement.measurement(refused)
    with pytest.raises(ProtocolError, match="VV: status 0E"):
        protocol.information(adjusting)


@pytest.mark.parametrize(
    "window",
    [
        {"first_step": 5, "last_step": 4},
        {"first_step": -1, "last_step": 4},
        {"first_step": 0, "last_step": 10_000},
        {"first_step": 0, "last_step": 1, "cluster": 100},
        {"first_step": 0, "last_step": 1, "characters": 2, "intensity": True},
    ],
)
def test_requests_that_cannot_be_written_are_refused(window):
    with pytest.raises(ScanwrightError):
        measurement.Window(**window)


def a_scan(count=0, steps=40, first=0):
    window = measurement.Window(first_step=first, last_step=first + steps - 1)
    lines = protocol.data_lines(1000 + count, protocol.encode(range(20, 20 + steps), 3))
    return protocol.reply(measurement.continuous(window, count=count), "99", lines)


@pytest.mark.parametrize(
    ("damaged", "survivors"),
    [
        (b"\x00\xff garbage\n0E\n" + a_scan(1), [1]),
        (b"garbage\n\n" + a_scan(1), [1]),
        (a_scan(1)[:50] + a_scan(2), []),  # cut, and the echo of the next one is glued to the cut
        (a_scan(1)[:-2] + b"\n" + a_scan(2), [2]),  # the end of the first is lost
        (a_scan(1)[:70] + b"\n" + a_scan(2), [2]),
        (a_scan(1).replace(b"\n", b"", 3) + a_scan(2), [2]),  # merged lines
        (b"0" * 100_000 + b"\n\n" + a_scan(1), [1]),
    ],
)
def test_the_next_whole_scan_is_found_again(damaged, survivors):
    found, bad = replies_of(damaged + a_scan(9), range(0, 100, 7))
    assert [measurement.measurement(reply).remaining for reply in found] == [*survivors, 9]
    assert bad == 1


def test_empty_lines_between_replies_are_no_damage():
    found, bad = replies_of(b"\n\n\n" + a_scan(1) + b"\n" + a_scan(2))
    assert [measurement.measurement(reply).remaining for reply in found] == [1, 2]
    assert bad == 0


def test_lines_of_another_length_are_refused_though_their_sums_are_right():
    window = measurement.Window(first_step=0, last_step=39)
    payload = protocol.encode(range(20, 60), 3)
    lines = [protocol.summed(protocol.encode([5], 4)), protocol.summed(payload[:60]), protocol.summed(payload[60:])]
    (reply,), bad = replies_of(protocol.reply(measurement.continuous(window), "99", lines))
    assert bad == 0
    with pytest.raises(ProtocolError, match="a line was cut"):
        measurement.measurement(reply)


def test_garbage_without_end_does_not_fill_the_memory():
    splitter = protocol.Splitter()
    for _ in range(200):
        assert not splitter.feed(b"x" * 10_000)
        assert len(splitter._pending) <= 1 << 16
    assert splitter.feed(b"\n\n" + a_scan(3))


def test_no_single_flipped_bit_of_a_scan_is_accepted():
    stream = a_scan(7)
    begin = stream.index(b"99b\n") + 4
    for at in range(begin, len(stream) - 2):
        if stream[at] == 0x0A:
            continue
        for bit in range(8):
            flipped = stream[:at] + bytes([stream[at] ^ (1 << bit)]) + stream[at + 1 :]
            for reply in replies_of(flipped)[0]:
                with pytest.raises(ProtocolError):
                    measurement.measurement(reply)


def mutated(rng, stream):
    """A few random damages: flipped bits, lost, doubled, swapped and foreign runs of bytes."""
    stream = bytearray(stream)
    for _ in range(rng.randint(1, 4)):
        at, run = rng.randrange(len(stream) + 1), rng.randint(1, 70)
        kind = rng.randrange(6)
        if kind == 0 and at < len(stream):
            stream[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del stream[at : at + run]
        elif kind == 2:
            stream[at:at] = stream[at : at + run]
        elif kind == 3:
            stream[at:at] = rng.randbytes(run)
        elif kind == 4:
            stream[at : at + run] = rng.choice([b"\n", b"\n\n", b"99b\n", b"MD0000003901000\n", b";", b"0"])
        else:
            other = rng.randrange(len(stream) + 1)
            stream[at : at + run], stream[other : other + run] = stream[other : other + run], stream[at : at + run]
    return bytes(stream)


def survive(stream):
    """Feed a damaged stream; whatever is accepted has right sums, told by a loop of its own. Count the scans."""
    accepted = 0
    for reply in replies_of(stream)[0]:
        for line in reply.lines:
            total = bytes([sum(line) % 64 + 0x30])
            assert line + total in stream or line + b";" in stream
        for read in (protocol.information, measurement.measurement, measurement.stamp):
            try:
                taken = read(reply)
            except ProtocolError:
                continue
            if read is protocol.information:
                try:
                    parameters.parameters(taken)
                except ProtocolError:
                    continue
            if read is measurement.measurement:
                accepted += 1
                assert taken.value.size == taken.window.size
                assert taken.intensity.size == (taken.window.size if taken.window.intensity else 0)
                payload = b"".join(reply.lines[1:])
                assert sum(payload[k] - 0x30 << 6 * (2 - k) for k in range(3)) == taken.value[0] or (
                    taken.window.characters == 2
                )
    return accepted


def dialogue():
    both = measurement.Window(first_step=3, last_step=12, intensity=True)
    known = [("MODL", "URG-04LX(H)"), ("DMIN", "20"), ("DMAX", "5600"), ("ARES", "1024"), ("AMIN", "44")]
    return (
        protocol.reply(b"VV", "00", protocol.text_lines([("VEND", "Hokuyo"), ("SERI", "H07")]))
        + protocol.reply(b"PP", "00", protocol.text_lines([*known, ("AMAX", "725"), ("AFRT", "384"), ("SCAN", "600")]))
        + protocol.reply(b"TM1", "00", [protocol.summed(protocol.encode([123456], 4))])
        + a_scan(2)
        + protocol.reply(
            measurement.continuous(both, count=1), "99", protocol.data_lines(77, protocol.encode(range(20), 3))
        )
    )


def test_thousands_of_damaged_streams_raise_nothing_untyped():
    rng, stream, accepted = random.Random(5), dialogue(), 0
    for _ in range(4000):
        accepted += survive(mutated(rng, stream))
    assert 2000 < accepted < 8000  # else the damage is none, or kills everything and tests nothing


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.sampled_from([b"\n", b"MD0000003901000", b"99b", b"00P", b"VV", b"TM1", b"0", b";", b"\xff"]), max_size=40
    )
)
def test_streams_made_of_the_protocols_own_words(words):
    survive(b"".join(words) + b"\n\n")


def test_numbers_below_the_least_range_are_no_ranges():
    of = parameters.parameters(
        {
            "MODL": "UTM-30LX(Hokuyo)",
            "DMIN": "23",
            "DMAX": "60000",
            "ARES": "1440",
            "AMIN": "0",
            "AMAX": "1080",
            "AFRT": "540",
            "SCAN": "2400",
        }
    )
    range_m = parameters.ranges_m(np.array([1, 1, 4, 22, 23, 60000, 60001, 65533], np.int32), of)
    np.testing.assert_array_equal(range_m, np.float32([*[np.nan] * 4, 0.023, 60.0, np.nan, np.nan]))
    assert of.since_stamp_s(0, "rear") - of.since_stamp_s(0, "step_0") == pytest.approx(3.125e-3)


@pytest.mark.parametrize("wrong", [{"SCAN": "0"}, {"AMAX": "2000"}, {"ARES": "many"}, {"DMIN": "70000"}])
def test_parameters_that_cannot_be_are_refused(wrong):
    reply = {
        "MODL": "X",
        "DMIN": "23",
        "DMAX": "60000",
        "ARES": "1440",
        "AMIN": "0",
        "AMAX": "1080",
        "AFRT": "540",
        "SCAN": "2400",
    }
    with pytest.raises(ProtocolError, match="PP"):
        parameters.parameters(reply | wrong)
    with pytest.raises(ProtocolError, match="AFRT is missing"):
        parameters.parameters({key: text for key, text in reply.items() if key != "AFRT"})


def test_a_rest_that_fills_no_cluster_may_be_sent_or_not():
    """Which sensors do is not known; one more or one less than that is a damaged scan."""
    window = measurement.Window(first_step=0, last_step=11, cluster=5)
    assert (window.size, window.full_clusters) == (3, 2)
    echo = measurement.continuous(window)
    for count in range(5):
        reply = protocol.Reply(echo, "99", (protocol.encode([7], 4), protocol.encode(range(100, 100 + count), 3)))
        if count in (2, 3):
            np.testing.assert_array_equal(measurement.measurement(reply).value, 100 + np.arange(count))
        else:
            with pytest.raises(ProtocolError, match=f"{count} numbers for 3 steps"):
                measurement.measurement(reply)


@pytest.mark.parametrize("intensity", [False, True])
def test_how_many_bytes_a_scan_has(intensity):
    window = measurement.Window(first_step=44, last_step=725, intensity=intensity)
    payload = protocol.encode(range(window.size * (2 if intensity else 1)), 3)
    reply = protocol.reply(measurement.continuous(window), "99", protocol.data_lines(0, payload))
    assert window.bytes_per_scan == len(reply)


@pytest.mark.parametrize(
    ("status", "words"),
    [
        ("20", "refused"),
        ("21", "check itself"),
        ("49", "check itself"),
        ("50", "hardware"),
        ("97", "hardware"),
        ("98", "went on"),
        ("0E", "unknown"),
    ],
)
def test_a_status_in_words(status, words):
    """SCIP 2.0, p. 12: 21 to 49 a check, 50 to 97 trouble, 98 resumed."""
    assert words in protocol.Reply(b"MD0000108001000", status, ()).meaning()
