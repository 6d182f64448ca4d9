"""The layout is worked out once, in steps; nobody works a step out again, or asks which drive a scanner has."""

import ast
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scanners import CAPSULE, GROUND_AHEAD, ROLLING, UPRIGHT, scanner_at

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.cage import BearingCage
from scanwright.cad.layout.envelope import HEAVY_G
from scanwright.cad.layout.placement import drive_of, placement_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.errors import BuildError

CAD = Path(__file__).parents[3] / "cad"
STEPS = {
    "adapter_of",
    "cage_of",
    "counterweight_of",
    "deck_of",
    "drive_of",
    "ears_of",
    "envelope_of",
    "estimated_moment",
    "fixed_cables_of",
    "hub_tie_of",
    "layout_of",
    "leads_of",
    "linkage_body_of",
    "placement_of",
    "plate_of",
    "plate_ties_of",
    "tower_foot_of",
}
MAY_CALL = {  # the lists of parts are handed in here; which beams a drive hides in any case is asked before all else
    ("parts/all_parts.py", "layout_of"),
    ("assembly/shadow.py", "drive_of"),
}
SCANNERS = {
    "bearing": scanner_at(GROUND_AHEAD),
    "upright": scanner_at(UPRIGHT),
    "belt": scanner_at(ROLLING, slip_ring=CAPSULE),
    "cup": scanner_at(UPRIGHT, slip_ring=None, sensor="STL27L", servo="XL430-W250"),
    "sub-plate": scanner_at((0, 0, 25.5, -21.4)),
}


def modules():
    return {path.relative_to(CAD).as_posix(): ast.parse(path.read_text()) for path in CAD.rglob("*.py")}


@pytest.mark.parametrize("name", SCANNERS)
def test_every_step_of_a_placement_is_worked_out_once(name, monkeypatch):
    calls = Counter()

    def counted(step, function):
        def wrapper(*args, **kwargs):
            calls[step] += 1
            return function(*args, **kwargs)

        return wrapper

    for module in [module for key, module in sys.modules.items() if key.startswith("scanwright.cad.")]:
        for step in STEPS & vars(module).keys():
            monkeypatch.setattr(module, step, counted(step, getattr(module, step)))
    placement_of(SCANNERS[name])
    assert {step for step, count in calls.items() if count > 1} == set()
    assert {"envelope_of", "deck_of", "linkage_body_of", "drive_of", "hub_tie_of"} <= calls.keys()
    assert ("cage_of" in calls, "tower_foot_of" in calls) == (name == "bearing", name == "belt")


def test_nobody_above_the_layout_works_a_step_out_again():
    names = {
        (module, name.id)
        for module, tree in modules().items()
        for name in ast.walk(tree)
        if isinstance(name, ast.Name) and name.id in STEPS and not module.startswith("layout/")
    }
    assert names == MAY_CALL


def test_no_type_of_a_drive_is_asked_for():
    kinds = {name for tree in modules().values() for name in _stacks(tree)}
    assert kinds == {"BeltStack", "DirectStack"}
    asks = {
        module
        for module, tree in modules().items()
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "isinstance"
        if kinds & {name.id for name in ast.walk(call) if isinstance(name, ast.Name)}
    }
    assert asks == set()


def _stacks(tree):
    """Classes of `Hub`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and "Hub" in [getattr(base, "id", "") for base in node.bases]:
            yield node.name


@pytest.mark.parametrize("name", SCANNERS)
def test_stations_go_from_the_deck_to_the_linkage(name):
    drive = drive_of(SCANNERS[name])
    assert drive.stacked[0] == "base_mount" and drive.stacked[-1] == "alignment_linkage"
    for station in drive.stations:
        low, high = station.z_mm
        assert low < high and station.radius_mm > 0, station.name
        assert station.product is None or station.box is not None, station.name
    turning = [station for station in drive.stations if station.body == "rotor"]
    assert max(station.z_mm[1] for station in turning) == -drive.stack.h  # the hub


def test_the_numbers_of_a_part_are_those_of_its_kind_or_none():
    direct, belt = drive_of(SCANNERS["bearing"]), drive_of(SCANNERS["belt"])
    assert direct.of(BearingCage).stack is direct.stack and direct.of(BeltStack) is None
    assert belt.of(BeltStack) is belt.stack and belt.of(BearingCage) is None


def test_parts_scale_with_the_load():
    """An invented lidar of any mass, in the case of a known one: parts grow with it, up to that of the UTM-30LX."""
    rng = np.random.default_rng(3)
    for lidar in ("STL27L", "UST-10LX", "UTM-30LX"):
        scanner = scanner_at((0, 0, 0, 40), slip_ring=None, sensor=lidar)
        masses = [30.0, *sorted(rng.uniform(40, 1000, 8))]
        places = [
            placement_of(replace(scanner, lidar=scanner.lidar.model_copy(update={"mass_g": float(mass)})))
            for mass in masses
        ]
        for sizes in (
            [place.linkage.plate for place in places],
            [place.linkage.neck_share for place in places],
            [place.stack.hub_radius for place in places],
            [place.deck.pad_half for place in places],
        ):
            assert sizes == sorted(sizes)
        heavy = next(place for place, mass in zip(places, masses, strict=True) if mass > HEAVY_G)
        assert (heavy.linkage.plate, heavy.linkage.neck_share, heavy.deck.back_mm) == (8.0, 1.0, 8.0)
        assert places[0].linkage.neck_share < 0.85


def test_the_inexpensive_scanner_needs_no_sub_plate_and_at_most_twenty_screws():
    layout = laid_out(scanner_at((0, 0, 0, 50), slip_ring=None, sensor="STL27L", servo="XL430-W250"))
    assert layout.stack.sub_plate is None and layout.linkage.plate == 4.0
    assert sum(joint.count for joint in layout.joints) <= 20


def test_a_ring_whose_circuits_do_not_carry_the_lidar_is_refused_before_parts():
    scanner = scanner_at(UPRIGHT, slip_ring=CAPSULE, servo="XM430-W350", sensor="RPLIDAR A3")  # 2.5 A by 2 A
    with pytest.raises(BuildError, match=r"RPLIDAR A3 draws up to 2\.5 A by \+, a circuit is rated for 2 A"):
        placement_of(scanner)
