"""The wiring: every combination of the catalogue keeps the rules, and each rule sees what it is there for."""

import itertools
from dataclasses import replace

import pytest

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.sizing import fuse_for, supply_for, wire_a, wire_drop_v, wire_for
from scanwright.design.electrics.wiring import network_of
from scanwright.design.findings import sentence
from scanwright.design.scanner import scanner_of

CATALOGUE = load_catalogue()


def names(kind):
    return [product.name for product in CATALOGUE if isinstance(product, kind)]


def angle_set(lidar="UTM-30LX", servo="MX-64R", ring="UH1256-02-0610-06S"):
    return AngleSet(
        task="t",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=0),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )


def network(lidar="UTM-30LX", servo="MX-64R", ring="UH1256-02-0610-06S"):
    return network_of(scanner_of(angle_set(lidar, servo, ring), "fdm-0.4", CATALOGUE))


def every_network(servo):
    for lidar, ring in itertools.product(names(Lidar), [*names(SlipRing), None]):
        yield lidar, ring, network(lidar, servo, ring)


@pytest.mark.parametrize("servo", names(Servo))
def test_every_combination_keeps_the_rules_unless_its_ring_is_too_weak(servo):
    for lidar, ring, made in every_network(servo):
        device = CATALOGUE.get(lidar, Lidar)
        most = max(device.peak_a or 0.0, device.inrush_a or 0.0)
        weak = ring is not None and max(group.amps for group in CATALOGUE.get(ring, SlipRing).ways) < most
        known = {fault.subject for fault in check_network(made) if not made.unknown}
        assert known == ({"ring"} if weak else set()), (lidar, ring, known)


@pytest.mark.parametrize("servo", names(Servo))
def test_every_supply_lies_within_the_range_of_its_device_at_rest_and_under_load(servo):
    for lidar, ring, made in every_network(servo):
        fed = {drop.device: drop for drop in made.drops}
        usb = CATALOGUE.get(lidar, Lidar).link == "usb-powered"
        for device in (CATALOGUE.get(servo, Servo), *(() if usb else (CATALOGUE.get(lidar, Lidar),))):
            least, most = device.supply_v
            assert least <= fed[device.name].volts <= fed[device.name].idle_v <= most, (device.name, ring)


@pytest.mark.parametrize("servo", names(Servo))
def test_no_sheet_prints_a_colour_without_a_source(servo):
    """A lead of a lidar has a colour only if a verified source names just one; a ring and a servo never have one."""
    for lidar, _, made in every_network(servo):
        device = CATALOGUE.get(lidar, Lidar)
        for wire in made.wires:
            assert bool(wire.colour) == bool(wire.source), wire
            ends = {wire.start[0], wire.end[0]}
            if wire.colour and "lidar" in ends:
                assert device.provenance()["leads"].verified and wire.end[1] in ("+", "-")
                assert [lead.colour for lead in device.leads if lead.net == wire.end[1]] == [wire.colour]
            assert not (wire.colour and "servo" in ends)
        if any(wire.note == "measure first" for wire in made.wires):
            assert any("set a multimeter to continuity" in caution for caution in made.cautions)


def test_unverified_or_several_colours_are_not_printed():
    def leads(lidar):
        return {wire.end[1]: wire.words for wire in network(lidar, ring=None).wires if wire.end[0] == "lidar"}

    assert leads("RPLIDAR C1")["+"] == "5 V, red, 0.25 mm²" and leads("RPLIDAR C1")["-"] == "0 V, black, 0.25 mm²"
    for lidar in ("RPLIDAR S1", "RPLIDAR A1", "UST-10LX", "TiM561", "LMS111", "LD19", "URG-04LX"):
        assert all("measure first" in leads(lidar)[net] for net in "+-"), lidar
    assert any("black" in caution and "+" in caution for caution in network("RPLIDAR S1").cautions)
    assert not any("brown" in caution for caution in network("UST-10LX").cautions)


def test_a_supply_that_no_converter_gives_is_refused():
    scanner = scanner_of(angle_set(), "fdm-0.4", CATALOGUE)
    odd = scanner.servo.model_copy(update={"supply_v": (6.0, 8.4)})
    made = network_of(replace(scanner, servo=odd))
    assert "MX-64R: gets 11.71 V, requires 6 to 8.4" in [sentence(fault) for fault in check_network(made)]
    assert "Do not connect MX-64R: it accepts 6 to 8.4 V" in " ".join(made.cautions)


def test_the_inrush_sizes_circuit_fuse_converter_and_supply_and_the_start_the_voltage():
    made = network("RPLIDAR S2")
    branch = made.branches[0]
    assert branch.peak_a == pytest.approx(2.5 * 5.1 / 12 / 0.85) and branch.fuse_a >= 1.1 * branch.peak_a
    assert {circuit.net: circuit.amps for circuit in made.circuits if circuit.net in ("+", "-")} == {"+": 2.5, "-": 2.5}
    converter = next(box for box in made.boxes if box.name == "lidar converter")
    assert converter.lines == ("at least 2.5 A, set to 5.1 V",)
    drop = next(drop for drop in made.drops if drop.device == "RPLIDAR S2")
    assert drop.idle_v == 5.1 and drop.volts == pytest.approx(5.1 - 1.5 * (0.1 + 2 * 0.0178 / branch.mm2))
    weak = network("RPLIDAR A3", ring="SRC022A-6")
    assert "carries 2.5 A, rated 2" in check_network(weak)[0].message


def test_power_takes_the_circuits_that_carry_it():
    ways = [{"count": 2, "amps": 1.0, "use": "power"}, {"count": 8, "amps": 3.0, "use": "any"}]
    scanner = scanner_of(angle_set("RPLIDAR A2"), "fdm-0.4", CATALOGUE)
    strong = SlipRing.model_validate(scanner.slip_ring.model_dump() | {"ways": ways})
    made = network_of(replace(scanner, slip_ring=strong))
    assert {circuit.net: circuit.rated_a for circuit in made.circuits if circuit.net in ("+", "-")} == {"+": 3, "-": 3}
    assert check_network(made) == []


@pytest.mark.parametrize("ring", [*names(SlipRing), None])
@pytest.mark.parametrize("lidar", ["LD19", "STL27L"])
def test_a_pin_that_must_be_tied_is_a_wire_and_a_one_way_line_has_no_rx(lidar, ring):
    made = network(lidar, ring=ring)
    ties = [wire for wire in made.wires if wire.start == ("lidar", "PWM")]
    assert [wire.end for wire in ties] == [("lidar", "GND")]
    assert check_network(made) == []
    loose = replace(made, wires=tuple(wire for wire in made.wires if wire not in ties))
    assert "lidar: pin PWM is not connected" in [fault.message for fault in check_network(loose)]
    assert ("lidar", "RX") not in {wire.end for wire in made.wires}
    (sent,) = (wire for wire in made.wires if wire.start[0] == "plug" and wire.net == "TX")
    assert sent.start == ("plug", "RX")  # what the lidar sends the computer receives


@pytest.mark.parametrize("lidar", names(Lidar))
def test_a_uart_gets_an_adapter_of_its_level_and_a_caution_and_no_other_link_does(lidar):
    device, made = CATALOGUE.get(lidar, Lidar), network(lidar, ring=None)
    plug = next(box for box in made.boxes if box.name == "plug")
    cautions = [caution for caution in made.cautions if "UART" in caution]
    if device.link == "serial" and device.signal_v is not None:
        assert plug.title == f"USB to {device.signal_v:g} V UART adapter" and len(cautions) == 1
        assert f"{device.signal_v:g} V" in cautions[0]
    else:
        assert "UART" not in plug.title and not cautions
    assert check_network(made) == []


def test_the_default_scanner_by_hand():
    """12 V: 1 A of lidar, 4.1 of a stalled servo, 15 W at 5 V through a converter of 85 %."""
    made = network()
    assert [branch.peak_a for branch in made.branches] == pytest.approx([1.0, 4.1, 3 * 5 / 12 / 0.85])
    assert [branch.fuse_a for branch in made.branches] == [2.0, 5.0, 2.0] and made.supply_a == 8.5
    assert made.branches[1].continuous_a == pytest.approx(0.1 + 4.1 / 5)
    used = {circuit.net: circuit for circuit in made.circuits if circuit.net}
    assert list(used) == ["+", "-", "VBUS", "D-", "D+", "GND", "shield"]
    assert {net: circuit.rated_a for net, circuit in used.items()} == {"+": 10, "-": 10} | dict.fromkeys(
        ("VBUS", "D-", "D+", "GND", "shield"), 2
    )
    lidar = next(drop for drop in made.drops if drop.device == "UTM-30LX")
    assert 12 - lidar.volts == pytest.approx(2 * 0.0178 / 0.25 + 2 * 0.05)  # a metre there and back, two circuits
    colours = {(wire.start[0], wire.end): wire.colour for wire in made.wires}
    assert colours["socket 2", ("lidar", "+")] == "brown" and colours["socket 2", ("lidar", "-")] == "blue"
    assert colours["ring", ("socket 1", "D+")] == "green" and colours["ring", ("socket 2", "+")] == ""
    assert "USB through a ring" in made.risks[0] and made.unknown == ()


def test_six_circuits_take_a_lidar_on_usb_without_its_shield():
    made = network(ring="SRC022A-6")
    assert [circuit.net for circuit in made.circuits] == ["+", "-", "VBUS", "D-", "D+", "GND"]
    assert ("lidar", "shield") not in {wire.end for wire in made.wires} and check_network(made) == []
    assert "Ethernet" in network("UST-10LX", ring="SRC022A-6").risks[0]
    assert network(ring=None).circuits == () and network(ring=None).risks == ()


@pytest.mark.parametrize("lidar", names(Lidar))
def test_behind_a_ring_every_wire_of_a_lidar_comes_from_the_socket_or_terminal_that_its_cable_ends_in(lidar):
    made, device = network(lidar), CATALOGUE.get(lidar, Lidar)
    sockets = {box.name: box for box in made.boxes if box.name.startswith("socket")}
    assert len(sockets) == len(device.cables)
    for wire in made.wires:
        if wire.end[0] == "lidar" and wire.start[0] != "lidar":
            cable = device.cables[int(wire.start[0].split()[1]) - 1]
            assert cable.takes(wire.end[1])
            title = sockets[wire.start[0]].title
            assert title.startswith("terminal block" if cable.end == "bare" else f"{cable.end} socket")
    assert not any("cut" in wire.words for wire in made.wires)
    without = replace(
        scanner_of(angle_set(lidar), "fdm-0.4", CATALOGUE), lidar=device.model_copy(update={"cables": None})
    )
    assert f"{lidar}: cables is not in the catalogue" in [fault.message for fault in network_of(without).unknown]


def test_each_rule_sees_what_it_is_there_for():
    made = network()
    assert check_network(made) == []

    def said(**change):
        return [sentence(fault) for fault in check_network(replace(made, **change))]

    assert "servo: pin V is not connected" in said(wires=tuple(w for w in made.wires if w.end != ("servo", "V")))
    astray = (*made.wires, replace(made.wires[0], end=("servo", "VCC")))
    assert "servo: a wire ends in VCC, which is not a pin of it" in said(wires=astray)
    short = (*made.wires, replace(made.wires[0], net="0 V"))
    assert "supply: pin + joins 0 V and 12 V" in said(wires=short)
    weak = tuple(replace(circuit, rated_a=0.5) for circuit in made.circuits)
    assert "ring: circuit 1 (+) carries 1 A, rated 0.5: choose a ring with stronger circuits" in said(circuits=weak)
    thin = tuple(replace(branch, mm2=0.25) for branch in made.branches)
    assert "F2: 0.25 mm² carries 2 A, its fuse 5" in said(branches=thin)
    small = tuple(replace(branch, fuse_a=4.0) for branch in made.branches)
    assert "F2: 4 A blows at the 4.1 A of MX-64R" in said(branches=small)
    assert "supply: gives 5 A, all together draw 6.6" in said(supply_a=5.0)
    low = tuple(replace(drop, volts=9.0) for drop in made.drops)
    assert "UTM-30LX: gets 9.00 V, requires 10.8 to 13.2" in said(drops=low)
    high = tuple(replace(drop, idle_v=13.5) for drop in made.drops)
    assert "UTM-30LX: gets 13.50 V, requires 10.8 to 13.2" in said(drops=high)
    red = (*made.wires[1:], replace(made.wires[0], colour="red", source=""))
    assert "switch: the colour red of + in has no source" in said(wires=red)


def test_sizes():
    assert (fuse_for(4.1), wire_for(5.0), supply_for(6.6)) == (5.0, 0.5, 8.5)
    assert wire_a(wire_for(7.5)) >= 7.5 and wire_drop_v(1.0, 1.0, 1.0) == pytest.approx(0.0356)
    with pytest.raises(ValueError, match="more than 20 A"):
        fuse_for(30.0)
