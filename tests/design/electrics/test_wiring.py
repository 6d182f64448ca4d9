"""The wiring: every combination of the catalogue keeps the rules, and each rule sees what it is there for."""

import itertools
from dataclasses import replace

import pytest

from design.angles import Angles, AngleSet
from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Lidar, Servo, SlipRing
from design.electrics.rules import broken_rules
from design.electrics.sizing import fuse_for, supply_for, wire_a, wire_drop_v, wire_for
from design.electrics.wiring import network_of
from design.scanner import scanner_of

CATALOGUE = load_catalogue()


def names(kind):
    return [product.name for product in CATALOGUE if isinstance(product, kind)]


def network(lidar="UTM-30LX", servo="MX-64R", ring="UH1256-02-0610-06S"):
    angles = AngleSet(
        task="t",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=0),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )
    return network_of(scanner_of(angles, "fdm-0.4", CATALOGUE))


@pytest.mark.parametrize("servo", names(Servo))
def test_every_combination_of_the_catalogue_keeps_the_rules(servo):
    for lidar, ring in itertools.product(names(Lidar), [*names(SlipRing), None]):
        made = network(lidar, servo, ring)
        known = [fault for fault in broken_rules(made) if not made.unknown]
        assert known == [], (lidar, ring, known)


def test_the_default_scanner_by_hand():
    """12 V: 1 A of lidar, 4.1 of a stalled servo, 15 W at 5 V through a converter of 85 %."""
    made = network()
    assert [branch.peak_a for branch in made.branches] == pytest.approx([1.0, 4.1, 3 * 5 / 12 / 0.85])
    assert [branch.fuse_a for branch in made.branches] == [2.0, 5.0, 2.0] and made.supply_a == 8.5
    assert made.branches[1].lasting_a == pytest.approx(0.1 + 4.1 / 5)
    used = {circuit.net: circuit for circuit in made.circuits if circuit.net}
    assert list(used) == ["+", "-", "VBUS", "D-", "D+", "GND", "shield"]
    assert {net: circuit.rated_a for net, circuit in used.items()} == {"+": 10, "-": 10} | dict.fromkeys(
        ("VBUS", "D-", "D+", "GND", "shield"), 2
    )
    lidar = next(drop for drop in made.drops if drop.device == "UTM-30LX")
    assert 12 - lidar.volts == pytest.approx(2 * 0.0178 / 0.25 + 2 * 0.05)  # a metre there and back, two circuits
    colours = {(wire.start[0], wire.end): wire.colour for wire in made.wires}
    assert colours["ring", ("lidar", "+")] == "brown" and colours["ring", ("lidar", "-")] == "blue"
    assert "USB through a ring" in made.risks[0] and made.unknown == ()


def test_six_circuits_take_a_lidar_on_usb_without_its_shield():
    made = network(ring="SRC022A-6")
    assert [circuit.net for circuit in made.circuits] == ["+", "-", "VBUS", "D-", "D+", "GND"]
    assert ("lidar", "shield") not in {wire.end for wire in made.wires} and broken_rules(made) == []
    assert "Ethernet" in network("UST-10LX", ring="SRC022A-6").risks[0]
    assert network(ring=None).circuits == () and network(ring=None).risks == ()


def test_each_rule_sees_what_it_is_there_for():
    made = network()
    assert broken_rules(made) == []

    def said(**change):
        return [f"{fault.where}: {fault.message}" for fault in broken_rules(replace(made, **change))]

    assert "servo: pin V is not connected" in said(wires=tuple(w for w in made.wires if w.end != ("servo", "V")))
    astray = (*made.wires, replace(made.wires[0], end=("servo", "VCC")))
    assert "servo: a wire ends in VCC, which is no pin of it" in said(wires=astray)
    short = (*made.wires, replace(made.wires[0], net="0 V"))
    assert "supply: pin + joins 0 V and 12 V" in said(wires=short)
    weak = tuple(replace(circuit, rated_a=0.5) for circuit in made.circuits)
    assert "ring: circuit 1 (+) carries 1 A, rated 0.5" in said(circuits=weak)
    thin = tuple(replace(branch, mm2=0.25) for branch in made.branches)
    assert "F2: 0.25 mm² carries 2 A, its fuse 5" in said(branches=thin)
    small = tuple(replace(branch, fuse_a=4.0) for branch in made.branches)
    assert "F2: 4 A blows at the 4.1 A of MX-64R" in said(branches=small)
    assert "supply: gives 5 A, all together draw 6.6" in said(supply_a=5.0)
    low = tuple(replace(drop, volts=9.0) for drop in made.drops)
    assert "UTM-30LX: gets 9.00 V, wants 10.8 to 13.2" in said(drops=low)


def test_sizes():
    assert (fuse_for(4.1), wire_for(5.0), supply_for(6.6)) == (5.0, 0.5, 8.5)
    assert wire_a(wire_for(7.5)) >= 7.5 and wire_drop_v(1.0, 1.0, 1.0) == pytest.approx(0.0356)
    with pytest.raises(ValueError, match="more than 20 A"):
        fuse_for(30.0)
