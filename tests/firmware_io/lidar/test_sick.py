"""The SICK driver against its emulator: both dialects, both ways, and whatever breaks on the way."""

import time

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError
from scanwright.firmware_io.emulators.sick.cola_emulator import SickMachine, sick_emulator
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.sick import driver
from scanwright.firmware_io.lidar.sick.cola import Telegram
from scanwright.firmware_io.lidar.sick.dialogue import RefusedError
from scanwright.firmware_io.lidar.sick.driver import SickLidar
from scanwright.firmware_io.lidar.sick.scan_data import scan_data

MODELS = ("TiM551", "TiM561", "TiM571", "TiM781", "LMS111", "LMS151", "LMS511")


def look(_time_ns, bearing_rad):
    range_m = 3 + np.sin(bearing_rad)
    range_m[[3, 40]] = np.inf
    return range_m, np.arange(bearing_rad.size, dtype=float)


def emulator(model="LMS111", ranging=look, jitter_s=0.0, **state):
    lidar = load_catalogue().get(model, Lidar)
    return sick_emulator(lidar, ranging, jitter_s=jitter_s, **state)


def check(scan, model):
    bearing_rad = load_catalogue().get(model, Lidar).bearings_rad()
    np.testing.assert_allclose(scan.bearing_rad, bearing_rad, atol=1e-5)
    step_m = 2e-3 if model == "LMS511" else 1e-3  # its scale factor is 2
    expected = (np.round(look(None, bearing_rad)[0] / step_m) * step_m).astype(np.float32)
    np.testing.assert_array_equal(scan.range_m, np.where(np.isinf(expected), np.nan, expected))


def until_fine(lidar):
    for _ in range(1000):
        try:
            return lidar.read()
        except DeviceFaultError:
            continue
    raise AssertionError("it stays at its fault")


@pytest.mark.parametrize("dialects", [(True,), (False,), (True, False)], ids=["B", "A", "both"])
@pytest.mark.parametrize("model", ["TiM551", "TiM571", "LMS111", "LMS511"])
def test_scans_come_as_they_were_seen(model, dialects):
    with emulator(model, dialects=dialects) as sensor, open_lidar(sensor.address, model) as lidar:
        assert (lidar.model, lidar.serial_number, lidar.firmware) == (model, "18030000", "V1.00")
        lidar.start(intensity=True)
        for _ in range(3):
            scan = lidar.read().scan
            check(scan, model)
            shown = np.arange(scan.range_m.size, dtype=np.float32)
            np.testing.assert_array_equal(scan.intensity, np.where(np.isnan(scan.range_m), 0, shown))
        assert lidar.bad_packets == 0
    assert not sensor.machine.measuring  # `with` puts the laser out


@pytest.mark.parametrize("model", MODELS)
def test_a_sensor_says_which_model_it_is(model):
    with emulator(model) as sensor, SickLidar(sensor.port) as lidar:
        assert (lidar.model, lidar.scan_rate_hz) == (model, load_catalogue().get(model, Lidar).scan_rate_hz)


@pytest.mark.parametrize(("stamps_end", "stamp_at"), [(False, None), (True, None), (True, "last_beam")])
def test_first_beams_get_their_true_times(stamps_end, stamp_at):
    true_ns = []

    def timed(time_ns, bearing_rad):
        range_m, level = look(time_ns, bearing_rad)
        range_m[0] = 1 + len(true_ns) / 100  # which scan it is
        true_ns.append(int(time_ns[0]))
        return range_m, level

    state = {"rate_error": 5e-5, "clock_us": (1 << 32) - 300_000, "stamps_end": stamps_end}
    with emulator(ranging=timed, **state) as sensor, SickLidar(sensor.address, None, stamp_at) as lidar:
        lidar.start()
        read = [lidar.read() for _ in range(40)]  # its clock wraps meanwhile
    meant_ns = [true_ns[round(100 * (float(each.scan.range_m[0]) - 1))] for each in read]
    late_ns = [each.scan.stamp_ns - meant for each, meant in zip(read, meant_ns, strict=True)]
    took_ns = [each.arrival_ns - meant for each, meant in zip(read, meant_ns, strict=True)]
    busy_ns = max(0, min(took_ns) - int(1e9 * read[0].scan.scan_time_s))  # that held up even the quickest of all
    assert np.min(np.abs(late_ns[20:])) < 1_500_000 + busy_ns  # of all: test_stalls.py, on a clock of its own


def test_damage_is_counted_and_never_handed_out():
    with emulator(dialects=(True,)) as sensor, SickLidar(sensor.address) as lidar:
        lidar.start()
        lidar.read()
        sensor.garble(3)
        sensor.cut(2)
        for _ in range(12):
            check(lidar.read().scan, "LMS111")
        assert 4 <= lidar.bad_packets <= 9
        assert lidar.dropped >= 4


def test_a_dirty_window_is_told_and_too_dirty_a_one_stops():
    with emulator(status=2) as sensor, SickLidar(sensor.address) as lidar:
        lidar.start()
        timed = lidar.read()
        check(timed.scan, "LMS111")
        assert timed.warning == "its window is dirty, but it still measures: clean it"
        for status, words in ((5, "too dirty to measure: clean it"), (1, "it reports a fault")):
            sensor.machine.status = status
            with pytest.raises(DeviceFaultError, match=words):
                for _ in range(1000):
                    lidar.read()
            sensor.machine.status = 0
            until_fine(lidar)


@pytest.mark.parametrize("dialects", [(True,), (False,)], ids=["B", "A"])
def test_it_tells_its_hours_where_it_counts_them(dialects):
    """The numbers 4F4 and A7 are those of a sensor in the notes of a driver: 126.8 hours, 167 times."""
    with emulator(dialects=dialects, run_tenth_h=0x4F4, starts=0xA7) as sensor, SickLidar(sensor.address) as lidar:
        filters = ("echo filter: last echo", "mean filter: off")
        assert lidar.condition() == ("it has run for 126.8 h", "it was switched on 167 times", *filters)
        sensor.machine.refusals = [3, 1, 3, 3]  # it knows no such variable, or this level may not read it
        assert lidar.condition() == ()
        lidar.start()
        check(lidar.read().scan, "LMS111")


def test_an_unplugged_sensor_is_told_and_comes_back():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        lidar.start(intensity=True)
        lidar.read()
        sensor.unplug()
        with pytest.raises(DeviceError, match="plug") as told:
            for _ in range(10):
                lidar.read()
        assert str(told.value).count("\n") == 0
        with pytest.raises(DeviceError, match=r"18030000 did not come back in 0\.0 s"):
            lidar.reconnect(0.0)
        sensor.plug()
        lidar.reconnect(30.0)
        scan = lidar.read().scan
        check(scan, "LMS111")
        assert scan.intensity.size == scan.range_m.size


def test_silence_is_a_timeout_and_a_restarted_sensor_scans_on():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        lidar.start()
        lidar.read()
        sensor.power_cycle()
        with pytest.raises(DeviceTimeoutError, match="nothing came"):
            for _ in range(9):
                lidar.read(0.05)
        lidar.reconnect(30.0)
        check(lidar.read().scan, "LMS111")


def test_a_busy_sensor_is_waited_for(monkeypatch):
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        sensor.machine.busy_until_ns = time.monotonic_ns() + 200_000_000
        lidar.start()
        assert time.monotonic_ns() >= sensor.machine.busy_until_ns
        lidar.stop()
        sensor.machine.busy_until_ns = 1 << 62
        monkeypatch.setattr(driver, "_READY_S", 0.1)
        with pytest.raises(DeviceTimeoutError, match="still busy"):
            lidar.start()


def test_refusals_have_the_sensors_words(monkeypatch):
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        with pytest.raises(DeviceError, match="cluster"):
            lidar.start(cluster=2)
        with pytest.raises(RefusedError, match="LMCstartmeas: error 1: access denied: login required"):
            lidar._dialogue.ask(lidar._dialogue.writer("sMN LMCstartmeas"))
        with monkeypatch.context() as other:
            other.setattr(driver, "_PASSWORD", 1)
            with pytest.raises(DeviceError, match="password was changed"):
                lidar.start()


def test_a_busy_method_is_asked_again_and_other_codes_are_told_by_their_words():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        sensor.machine.refusals[:] = [0x0D, 0x0D]
        lidar.start()
        check(lidar.read().scan, "LMS111")
        lidar.stop()
        for code, words in ((0x04, "a condition for it is not met"), (0x14, "internal error"), (0x99, "not in the")):
            sensor.machine.refusals[:] = [code]
            with pytest.raises(RefusedError, match=f"SetAccessMode: error {code:X}: {words}"):
                lidar.start()


def test_a_sensor_of_unknown_name_wants_its_model():
    with emulator() as sensor:
        sensor.machine.lidar = sensor.machine.lidar.model_copy(update={"name": "LMS1xx"})
        with pytest.raises(DeviceError, match=r"reports type 'LMS1xx'.*name its model; known: LMS111"):
            SickLidar(sensor.address)
        with SickLidar(sensor.address, "LMS111") as lidar:
            assert lidar.model == "LMS111"


def test_a_mean_filter_is_reported_and_a_scan_warns_of_it():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        sensor.machine.filters = {"LFPmeanfilter": [1, 3, 0], "FREchoFilter": [0]}
        assert lidar.condition()[2:] == ("echo filter: first echo", "mean filter: 3 scans")
        lidar.start()
        assert lidar.read().warning.startswith("its mean filter averages 3 scans, which smears a turning scan")
        assert sensor.machine.filters == {"LFPmeanfilter": [1, 3, 0], "FREchoFilter": [0]}  # nothing was set


def test_filters_are_set_on_request_and_again_after_a_power_cycle():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        stored = {"LFPmeanfilter": [1, 3, 0], "FREchoFilter": [0]}
        sensor.machine.filters = dict(stored)
        lidar.set_filters("last", mean_filter_off=True)
        lidar.start()
        assert lidar.read().warning == ""
        assert sensor.machine.filters == {"LFPmeanfilter": [0, 2, 0], "FREchoFilter": [2]}
        sensor.power_cycle()
        sensor.machine.filters = dict(stored)  # what its flash memory holds
        lidar.reconnect(30.0)
        assert lidar.read().warning == ""
        assert sensor.machine.filters["FREchoFilter"] == [2]
        lidar.stop()
        sensor.machine.without = ("FREchoFilter",)
        with pytest.raises(RefusedError, match="FREchoFilter: error 3: unknown variable"):
            lidar.start()


# Beam of the scan time and headers of LMDscandata in public captures, from the version to the channel.
CAPTURES = {
    "LMS100": ("first_beam", "1 1 A037B9 0 0 C1C3 C1C6 8B621C37 8B627603 0 0 7 0 0 1388 168 0 1 DIST1", "1388 21D"),
    "LMS511": ("first_beam", "0 1 1374C54 0 0 0 3F0E 2BF460C 2BFE48F 0 0 3F 0 0 9C4 21C 0 1 DIST1", "683 475"),
    "TiM55x": ("last_beam", "1 1 107375C 0 0 E784 E789 3D611E4A 3D612D1F 0 0 1 0 0 5DC 36 0 1 DIST1", "2710 10F"),
    "TiM56x": ("last_beam", "1 1 1291B11 0 0 AED5 AED7 FDB36397 FDB3779F 0 0 1 0 0 5DC A2 0 1 DIST1", "D05 32B"),
    "TiM56x again": ("last_beam", "1 1 1078AAA 0 0 BFD BFF CFACE0D CFAE156 0 0 1 0 0 5DC A2 0 1 DIST1", "D05 32B"),
}


@pytest.mark.parametrize("name", CAPTURES)
def test_captures_show_which_beam_their_scan_time_is_of(name):
    stamped, head, tail = CAPTURES[name]
    count = int(tail.split()[1], 16)
    text = f"sSN LMDscandata {head} 3F800000 00000000 FFF92230 {tail}" + " 5" * count + " 0" * 6
    scan = scan_data(Telegram(text.encode(), binary=False))
    took_us = count * scan.beam_us
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        before_us = lidar._first_beam_before_sent_us(scan)
        assert before_us == pytest.approx(scan.sent_after_us + took_us * (stamped == "last_beam"))
        assert before_us >= took_us
        if stamped == "last_beam":
            lidar._stamp_at = "first_beam"
            with pytest.raises(DeviceError, match=r"a scan takes 50.* ms; use last_beam"):
                lidar._first_beam_before_sent_us(scan)


def test_only_a_sick_has_its_stamps_and_filters():
    with emulator() as sensor:
        with pytest.raises(DeviceError, match=r"stamp_at = 'rear': LMS111 .*: use first_beam or last_beam"):
            open_lidar(sensor.address, "LMS111", "rear")
        with open_lidar(sensor.address, "LMS111", "first_beam") as lidar:
            lidar.start()
            check(lidar.read().scan, "LMS111")


def test_a_sensor_with_a_choice_is_set_to_the_rate_of_the_catalogue():
    with emulator(setting=(2500, 2500)) as sensor, SickLidar(sensor.address) as lidar:
        lidar.start()
        assert sensor.machine.setting == (5000, 5000)
        lidar.stop()
        lidar._lidar = lidar._lidar.model_copy(update={"scan_rate_hz": 75.0})
        with pytest.raises(
            DeviceError, match=r"75 Hz in steps of 0\.5 deg: it rejects its scan frequency; is it a LMS"
        ):
            lidar.start()


def test_skipped_turns_are_not_missing():
    with emulator() as sensor, SickLidar(sensor.address) as lidar:
        lidar.start(skip=1)
        scans = [lidar.read().scan for _ in range(16)]  # a busy computer moves single ones
        assert scans[0].scan_time_s == pytest.approx(0.02)
        assert (scans[-1].stamp_ns - scans[0].stamp_ns) / 15e9 == pytest.approx(0.04, rel=0.4)
        assert lidar.dropped == 0


def test_what_speaks_no_cola_is_told():
    with emulator(dialects=()) as sensor, pytest.raises(DeviceTimeoutError, match="no SICK sensor answers"):
        SickLidar(sensor.address)


# What sick_scan_xd 3.9 sends to a TiM5xx and an LMS1xx beyond our driver, in the layout of telegram listing 8014631.
OTHER_REQUESTS = [
    ("sRN SCdevicestate", "sRA SCdevicestate 1"),
    ("sWN EIHstCola 1", "sFA 1"),
    ("sRN FirmwareVersion", "sRA FirmwareVersion 5 V1.00"),
    ("sRN LocationName", "sRA LocationName B not defined"),
    ("sEN LIDinputstate 0", "sEA LIDinputstate 0"),
    ("sEN LIDoutputstate 0", "sEA LIDoutputstate 0"),
    ("sEN LFErec 0", "sEA LFErec 0"),
    ("sRN LFPmeanfilter", "sRA LFPmeanfilter 0 A 0"),
    ("sWN LFPmeanfilter 1 3 0", "sFA 1"),
    ("sMN SetAccessMode 2 B21ACE26", "sAN SetAccessMode 1"),
    ("sWN LFPmeanfilter 1 3 0", "sFA 1"),
    ("sMN SetAccessMode 3 F4724744", "sAN SetAccessMode 1"),
    ("sWN LFPmeanfilter 1 3 0", "sWA LFPmeanfilter"),
    ("sRN LFPmeanfilter", "sRA LFPmeanfilter 1 3 0"),
    ("sWN FREchoFilter 0", "sWA FREchoFilter"),
    ("sRN FREchoFilter", "sRA FREchoFilter 0"),
    ("sRN LMPoutputRange", "sRA LMPoutputRange 1 D05 FFF92230 225510"),
    ("sWN LMPoutputRange 1 D05 FFF92230 225510", "sWA LMPoutputRange"),
    ("sWN LMPoutputRange 1 D05 0 225510", "sFA 5"),
    ("sWN EIHstCola 1", "sWA EIHstCola"),
    ("sWN LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 1", "sWA LMDscandatacfg"),
    ("sRN LMDscandatacfg", "sRA LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 1"),
    ("sRN field000", "sFA 3"),
    ("sMN mLMPsetscancfg 5DC 1 D05 FFF92230 225510", "sFA 2"),
]
OF_AN_LMS = [
    ("sRN field000", "sRA field000 3F800000 00000000 1388 FFF92230 2 1 1 0 0 0 0 1 8 Field001 0"),
    ("sRN field030", "sFA 3"),
    ("sRN LIDinputstate", "sRA LIDinputstate 0 F4240 0 0 0 0 0"),
    ("sMN mLMPsetscancfg 1388 1 1388 FFF92230 225510", "sFA 1"),
    ("sMN SetAccessMode 3 F4724744", "sAN SetAccessMode 1"),
    ("sMN mLMPsetscancfg 1388 1 1388 FFF92230 225510", "sAN mLMPsetscancfg 0 1388 1 1388 FFF92230 225510"),
    ("sMN mLMPsetscancfg 9C4 1 9C4 FFF92230 225510", "sAN mLMPsetscancfg 3 1388 1 1388 FFF92230 225510"),
]
OF_AN_LMS5XX = [  # the angles of the capture above
    ("sRN LMPoutputRange", "sRA LMPoutputRange 1 683 FFFF3CB0 1C3A90"),
    ("sMN SetAccessMode 3 F4724744", "sAN SetAccessMode 1"),
    ("sMN mLMPsetscancfg 9C4 1 683 FFFF3CB0 1C3A90", "sAN mLMPsetscancfg 0 9C4 1 683 FFFF3CB0 1C3A90"),
    ("sMN mLMPsetscancfg 2710 1 683 FFFF3CB0 1C3A90", "sAN mLMPsetscancfg 1 9C4 1 683 FFFF3CB0 1C3A90"),
]


@pytest.mark.parametrize(
    ("model", "dialogue"), [("TiM571", OTHER_REQUESTS), ("LMS111", OF_AN_LMS), ("LMS511", OF_AN_LMS5XX)]
)
def test_an_emulator_answers_what_other_programs_ask(model, dialogue):
    """The range of a TiM571: from -45 to 225 deg, in steps of a third of a degree cut to 0.3333."""
    machine = SickMachine(load_catalogue().get(model, Lidar), look, 0)
    for request, answer in dialogue:
        got, rest = machine.receive(b"\x02" + request.encode() + b"\x03", 1_000_000_000)
        assert (got, rest) == (b"\x02" + answer.encode() + b"\x03", b""), request
