"""Rows of `bom.csv` for tools, consumables, and small things that the parts name."""

from collections.abc import Iterator, Mapping

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.access import blade_in_words
from scanwright.cad.checks.loads.retention import material_of
from scanwright.cad.files.bom_item import JOINTS, STEPS, WIRING_TEXT, BomItem
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.tightening import hold_of

LONG_DRIVER = "the long arm of a key is too short; drivers for model cars have blades of 100 to 120 mm"


def tools_and_consumables(assembly: Assembly, blades_mm: Mapping[Joint, int]) -> Iterator[BomItem]:
    """Yield small things of the parts, consumables, and tools."""
    joints = assembly.layout.joints
    rows = dict.fromkeys(row for name in assembly.made for row in assembly.parts[name].rows)
    needs = [BomItem(row.kind, row.part, source=row.source, note=row.note, estimate=row.estimate) for row in rows]
    yield from (need for need in needs if need.kind != "tool")
    ends, drops = "screws that end in metal or nuts", "a few drops"
    yield BomItem("consumable", "threadlocker, medium strength", source=ends, note=drops, estimate="threadlocker")
    if assembly.layout.deck.flat and any(cable.path is not None for cable in assembly.layout.cables):
        yield BomItem("consumable", "adhesive tape", source=STEPS, note="for the cables on the deck", estimate="tape")
    sizes = ", ".join(sorted({"grub " * (joint.fixing == "grub") + joint.screw.name for joint in joints}))
    yield BomItem("tool", "hexagon keys", source=JOINTS, note=f"for {sizes}", estimate="hexagon keys")
    longest: dict[str, int] = {}
    for joint, blade_mm in blades_mm.items():
        longest[joint.screw.name] = max(blade_mm, longest.get(joint.screw.name, 0))
    for size, blade_mm in sorted(longest.items()):
        driver = f"hexagon driver for {size} ({blade_in_words(blade_mm)})"
        yield BomItem("tool", driver, source=STEPS, note=LONG_DRIVER, estimate="long driver")
    holds = [
        hold_of(joint, *(material_of(assembly, body) for body in (joint.part, joint.onto)))
        for joint in joints
        if not joint.loose
    ]
    torques_nm = [hold.torque_nm for hold in holds if hold is not None]
    torques = f", {min(torques_nm):.2g} to {max(torques_nm):.2g} N m" if torques_nm else ""
    yield BomItem("tool", f"torque screwdriver{torques}", source=STEPS, estimate="torque screwdriver")
    yield BomItem("tool", "caliper", source=STEPS, note="for the values to measure", estimate="caliper")
    yield BomItem("tool", "multimeter", source=WIRING_TEXT, estimate="multimeter")
    yield from (need for need in needs if need.kind == "tool")
    if any(joint.inserts for joint in joints):
        yield BomItem("tool", "soldering iron", source=STEPS, note="for the inserts", estimate="soldering iron")
