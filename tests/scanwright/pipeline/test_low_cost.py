"""The shipped scanner for little money: what it costs, that nothing of it is turned, that nothing fails a check."""

from types import SimpleNamespace

import pytest

from scanwright import api
from scanwright.cad.checks.run import run_checks
from scanwright.cad.files.bom import items_of
from scanwright.design.progress import no_progress


@pytest.fixture(scope="module")
def low_cost(parts_of):
    """Its parts, as a build makes them, without the files."""
    optimum = api.optimise("low_cost")
    scanner = optimum.loaded.scanner(optimum.angle_set())
    return SimpleNamespace(scanner=scanner, assembly=parts_of(scanner))


@pytest.fixture(scope="module")
def bought(low_cost):
    assembly = low_cost.assembly
    masses = {name: solid.Volume() * 1.3e-3 for name, solid in assembly.made.items()}  # of the densest plastic
    return items_of(assembly, masses)


def test_all_that_is_made_is_printed(low_cost):
    parts = low_cost.assembly.parts
    assert {name: parts[name].process for name in low_cost.assembly.made} == {
        "servo_frame": "printed",
        "horn_cup": "printed",
        "alignment_linkage": "printed",
    }


def test_its_list_adds_up_to_less_than_300_dollars_where_one_asks_around(bought):
    """Each row at its price, or the lower end of what shops ask, without the tools that are bought once."""
    rows = [item for item in bought if item.kind not in ("tool", "total")]
    assert sum(item.low_usd or 0 for item in rows) < 300
    assert {item.number for item in rows if item.kind == "bought"} == {"STL27L", "XL430-W250"}


def test_no_check_fails_and_no_part_is_in_the_fan(low_cost):
    checks, _ = run_checks(low_cost.assembly, no_progress)
    assert [check.message for check in checks if check.severity == "error"] == []
    hidden = [check.value for check in checks if check.code.startswith("beams_")]
    assert hidden and max(hidden) == 0
