"""What keeps serial ports from working on a computer: each is found in a made-up system, and has a hint."""

import os
from types import SimpleNamespace

import pytest

from scanwright.firmware_io.scan import host

RULE = 'ENV{PRODUCT}=="10c4/ea60/*", ATTRS{manufacturer}=="Silicon Labs", ENV{BRLTTY_BRAILLE_DRIVER}="sk"\n'


@pytest.fixture
def system(tmp_path, monkeypatch):
    monkeypatch.setattr(host, "_ROOT", tmp_path)
    monkeypatch.setattr(host.list_ports, "comports", lambda: [])

    def write(path, text):
        file = tmp_path / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    return write


def codes(ports=()):
    findings = list(host.examine_host(ports))
    assert all(finding.hint and finding.severity in ("warning", "error") for finding in findings)
    return [finding.code for finding in findings]


def test_a_system_without_trouble_has_no_findings(system):
    system("lib/udev/rules.d/85-brltty.rules", "# " + RULE)
    system("proc/7/comm", "python\n")
    system("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "1\n")
    assert codes() == []


def test_brltty_is_found_unless_its_rule_is_masked(system):
    system("usr/lib/udev/rules.d/85-brltty.rules", RULE)
    assert codes() == ["brltty"]
    system("etc/udev/rules.d/85-brltty.rules", "")
    assert codes() == []


def test_a_running_modem_manager_is_found(system):
    system("proc/812/comm", "ModemManager\n")
    assert codes() == ["modem_manager"]


def test_a_slow_latency_timer_is_found(system):
    system("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16\n")
    (finding,) = host.examine_host([])
    assert (finding.code, finding.subject, finding.value, finding.limit) == ("latency_timer", "/dev/ttyUSB0", 16, 1)


@pytest.mark.usefixtures("system")
def test_a_port_of_another_group_is_found(monkeypatch):
    monkeypatch.setattr(host.os, "access", lambda *_: False)
    assert codes([os.devnull, "192.168.0.10:10940", "no-such-port"]) == ["port_access"]


@pytest.mark.usefixtures("system")
def test_adapters_with_one_serial_number_are_found(monkeypatch):
    ids = [(0x10C4, "0001"), (0x10C4, "0001"), (0x10C4, "0002"), (None, None)]
    ports = [
        SimpleNamespace(device=f"/dev/ttyUSB{k}", vid=vid, pid=vid and 0xEA60, serial_number=number)
        for k, (vid, number) in enumerate(ids)
    ]
    monkeypatch.setattr(host.list_ports, "comports", lambda: ports)
    (finding,) = host.examine_host([])
    assert finding.message.startswith("/dev/ttyUSB0 and /dev/ttyUSB1: ")


def test_the_rules_name_every_adapter_of_the_catalogue(command):
    code, rules, _ = command("doctor", "--udev")
    assert code == 0
    for vendor, product in (("0403", "6014"), ("15d1", "0000"), ("10c4", "ea60"), ("1a86", "7523")):
        assert f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"' in rules
    assert 'ENV{ID_MM_DEVICE_IGNORE}="1"' in rules and 'ATTR{latency_timer}="1"' in rules
