"""The script that measures builds from outside sees a blocked screw, a loose or shifted hole, and a collision."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cad import outside
from benchmarks.cad.outside.__main__ import screw_faults
from benchmarks.cad.outside.access import collisions, key_blocked
from benchmarks.cad.outside.bodies import StepBody
from benchmarks.cad.outside.gaps import overlaps, turning_gap
from benchmarks.cad.outside.screws import found_screws
from benchmarks.cad.outside.steps import present, steps_of

cq = pytest.importorskip("cadquery")

TEXT = """
## 1. Plate on the block

**4 x ISO 4762 M3 x 12 from plate into block, 0.18 N m.**

## 2. Roof over the block

It stands on the deck.

## 3. Lid on the plate

**1 x ISO 4762 M3 x 10 from lid into plate, 0.18 N m.**
"""
DECK = np.array([[0.0, 0.0, -50.0], [0.0, 0.0, 1.0]])
CORNERS = [(15.0, 15.0), (-15.0, 15.0), (-15.0, -15.0), (15.0, -15.0)]
CHECKS = [{"kind": "screw", "value": 7.0, "message": "plate on block: 4 x ISO 4762 M3 x 12: 7.0 mm of thread"}]


def box(*corners):
    low, high = np.array(corners, dtype=float)
    return cq.Solid.makeBox(*(high - low), cq.Vector(*low))


def bored(solid, places, radius, low, high):
    holes = [cq.Solid.makeCylinder(radius, high - low, cq.Vector(x, y, low)) for x, y in places]
    return solid.cut(*holes).Solids()[0]


def bodies(hole=1.7, shift=0.0, roof=60.0):
    """A plate of 5 mm on a block with threads of 8 mm, and a roof over one of its screws."""
    moved = [(15.0 + shift, 15.0), *CORNERS[1:]]
    solids = {
        "plate": bored(box((-20, -20, 0), (20, 20, 5)), CORNERS, hole, -1, 6),
        "block": bored(box((-20, -20, -20), (20, 20, 0)), moved, 1.25, -8, 1),
        "roof": box((5, 5, roof), (25, 25, roof + 5)),
    }
    return {name: StepBody(name, solid) for name, solid in solids.items()}


@pytest.fixture(scope="module")
def steps():
    return steps_of(TEXT)


def faults(these, steps, turning=()):
    (written,) = steps[0].screws
    found = found_screws(written, these, DECK)
    blocked = [key_blocked(screw, these, these, turning) for screw in found]
    cuts = [words for screw in found for words in collisions(screw, these, these)]
    return [*screw_faults(written, found, CHECKS), *(name for name in blocked if name), *cuts]


def test_a_sound_joint_has_no_fault(steps):
    these = bodies(roof=70.0)
    assert faults(these, steps) == []
    screws = found_screws(steps[0].screws[0], these, DECK)
    np.testing.assert_allclose(
        sorted(tuple(screw.seat) for screw in screws), sorted((*at, 5.0) for at in CORNERS), atol=0.06
    )
    assert all(screw.along[2] == -1.0 for screw in screws)


@pytest.mark.parametrize(
    ("change", "seen"),
    [
        ({"roof": 40.0}, "roof"),  # the key is 58.5 mm long, from the head's top at 8 mm
        ({"roof": 6.0}, "its head has 0.00 of 2.75 mm in roof"),
        ({"hole": 2.2}, "0 of 4 screws have a hole in both bodies"),
        ({"hole": 1.4}, "0 of 4 screws have a hole in both bodies"),
        ({"shift": 0.25}, "3 of 4 screws have a hole in both bodies"),
    ],
)
def test_a_faulty_joint_is_seen(steps, change, seen):
    assert seen in faults(bodies(**change), steps)


def test_a_blocked_screw_is_free_if_the_rotor_can_turn(steps):
    these = bodies(roof=40.0)
    assert "roof" in faults(these, steps)
    assert faults({**these, "roof": StepBody("roof", these["roof"].shape)}, steps, turning={"plate", "block"}) == []


def test_a_thread_shorter_than_stated_is_seen(steps):
    (written,) = steps[0].screws
    these = bodies()
    (line,) = screw_faults(written, found_screws(written, these, DECK), [CHECKS[0] | {"value": 8.0}])
    assert re.fullmatch(r"(6.9\d|7.0\d) mm of thread, 8.00 stated", line)


def test_bodies_that_cut_or_come_near_are_seen():
    these = bodies(roof=4.0)
    ((volume, names),) = overlaps(these)
    assert names == "plate and roof" and volume == pytest.approx(15 * 15 - np.pi * 1.7**2, rel=0.01)
    corner = StepBody("corner", box((29, 0, 0), (40, 4, 5)))  # 28.28 is the corner of the plate
    gap, pair = turning_gap({"plate": these["plate"], "corner": corner}, {"plate"})
    assert gap == pytest.approx(29 - 20 * np.sqrt(2), abs=0.01) and pair == "plate and corner"


def test_bodies_are_there_from_their_step_on(steps):
    assert present(steps, {"plate", "block", "roof", "lid"}) == [
        {"plate", "block"},
        {"plate", "block", "roof"},
        {"plate", "block", "roof", "lid"},
    ]


def test_it_shares_no_code_with_the_package():
    for file in Path(outside.__file__).parent.glob("*.py"):
        for line in re.findall(r"^\s*(?:from|import) (\S+)", file.read_text(encoding="utf-8"), re.MULTILINE):
            assert line.split(".")[0] not in ("scanwright", "design", "cad", "firmware_io"), f"{file.name}: {line}"


def test_every_screw_in_the_steps_of_a_build_is_understood(made):
    steps = steps_of((made.folder / "assembly.md").read_text("utf-8"))
    assert sum(len(step.screws) for step in steps) == len(made.result.assembly.layout.joints)
