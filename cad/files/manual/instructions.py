"""`assembly.md`: how to assemble one scanner, with its screws and a picture of each step."""

import re
from collections.abc import Iterator, Mapping, Sequence

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.print_settings import hours_in_words, print_hours, print_words
from scanwright.cad.assembly.scenes import PLATE, PLATE_TIE, StepScene, scenes_of, tied_at
from scanwright.cad.checks.access import NO_BLADES, blade_in_words
from scanwright.cad.checks.loads.retention import material_of
from scanwright.cad.files.manual.pictures import StepPictures
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.drive import products_of
from scanwright.cad.layout.joints import DECK_MM, Joint
from scanwright.cad.layout.names import FIT_COUPON, SERVO_CASE, TEST_PLATE
from scanwright.cad.layout.tightening import hold_of
from scanwright.design.catalogue.holes import CASE_EAR_MM
from scanwright.design.catalogue.measuring import WITH_CALIPER, measure_first
from scanwright.design.electrics.wiring import network_of, uart_adapter

NUTS = (
    "Put the nuts into the pockets of {holders} before the step that closes them: those of a plate or an arm from "
    "below; those of a boss, cup or base from above into the slots; those of a foot from its corners. Pull each in "
    "with a screw. A hole without a pocket has a plain thread."
)
LOCKED = (
    "If a screw ends in metal or in a nut, put a small drop of medium threadlocker on its thread; put none on plastic, "
    "which can crack. Tighten to the torque behind each screw, and once more after a day if a key reaches it, since "
    "plastic under a head creeps. `checks.json` lists the margin of each joint under `retention` and `screw`."
)
LOOK = "Look, then wire"
HORN_FIELDS = ("horn_circle_mm", "horn_holes", "horn_first_hole_deg", "horn_screw", "horn_thread_depth_mm")
LAST = "Turn the linkage by hand through its range: nothing touches, no cable pulls tight. "
TO_COMPUTER = "Then join the leads of the ring's stator to {port} and power."
THROUGH_RING = "Then join the leads of the lidar to those of the ring's rotor, those of the stator to {port} and power."
IN_A_LOOP = "Leave the lidar's cables a loose loop for the entire sweep, then join them to {port} and power."


def instructions_text(
    assembly: Assembly,
    scenes: Sequence[StepScene],
    plates: Sequence[Sequence[str]],
    blades_mm: Mapping[Joint, int] = NO_BLADES,
) -> str:
    """Return the Markdown file.

    Args:
        assembly: the scanner.
        scenes: of `scenes_of`.
        plates: the parts printed together.
        blades_mm: of the joints that need a long key, see `access.blades_mm`.
    """
    scanner = assembly.layout.scanner
    joints = [joint for scene in scenes for joint, _ in scene.joints]
    angles = scanner.angles.angles_deg
    lines = [
        f"# {scanner.angles.task}: putting it together",
        "",
        f"Configuration {assembly.layout.digest}: {scanner.lidar.name} on {scanner.servo.name}, "
        f"alpha_rot {angles.alpha_rot:g}, beta_rot {angles.beta_rot:g}, "
        f"alpha_laser {angles.alpha_laser:g}, beta_laser {angles.beta_laser:g} deg. "
        "In the pictures present bodies are grey, new made parts orange, new bought ones blue; the rotation axis is "
        "upright, or the lidar's axis if the step is on the bench. `exploded.glb` shows the scanner in 3D; `bom.csv` "
        "lists all items.",
        "",
        *_to_measure(assembly),
        f"Print `print/{FIT_COUPON}.3mf` first: the clearances that fit on your printer belong in its catalogue file "
        f"(now fits {scanner.printer.fit_clearance_mm:g}, screws {scanner.printer.screw_clearance_mm:g} mm). Print "
        f"everything {print_words(scanner.printer)}: the files contain this for PrusaSlicer; set it in other slicers.",
        "",
        "Try the hole patterns before you print parts: print `template.pdf` at 100 %, measure its scale of 100 mm, and "
        f"lay each page on its device. Then print `print/{TEST_PLATE}.3mf` and screw it to lidar and servo.",
        "",
        *(line for number, parts in enumerate(plates, start=1) for line in _plate(number, parts, assembly)),
        f"Lengths of screws with nuts assume {CASE_EAR_MM:g} mm of servo case before the nut and a deck of {DECK_MM:g} "
        "mm; all others follow from the parts.",
        "",
    ]
    lines += [LOCKED, ""]
    if any(joint.inserts for joint in joints):
        lines += ["Melt the inserts in first, flush with the face on the side of the screw.", ""]
    if holders := dict.fromkeys(joint.holder for joint in joints if joint.traps):
        lines += [NUTS.format(holders=" and ".join(holders)), ""]
    for number, scene in enumerate(scenes, start=1):
        lines += [f"## {number}. {scene.step.title}", "", f"![{scene.step.title}]({picture_name(number)})", ""]
        lines += [_words(assembly, scene, blades_mm), ""]
        if scene.step.check:
            lines += [f"Before you go on: {scene.step.check}.", ""]
    network = network_of(scanner)
    lines += [
        f"## {len(scenes) + 1}. {LOOK}",
        "",
        "**Caution, before you join a wire:**",
        "",
        *(f"- {caution}" for caution in network.cautions),
        "",
        LAST + _joined(assembly) + " `wiring.md` lists every wire.",
        "",
    ]
    return "\n".join(lines)


def _joined(assembly: Assembly) -> str:
    """Return which cables to connect at the end; cables with a path are connected in their own step."""
    scanner, leads = assembly.layout.scanner, assembly.layout.leads
    laid = leads and all(lead.path is not None for lead in leads)
    words = IN_A_LOOP if scanner.slip_ring is None else TO_COMPUTER if laid else THROUGH_RING
    adapter = uart_adapter(scanner.lidar)
    joined = words.format(port=f"the {adapter}" if adapter else "its port of the computer")
    return f"{PLATE_TIE} {joined}" if not leads and PLATE in tied_at(assembly.layout) else joined


def _plate(number: int, parts: Sequence[str], assembly: Assembly) -> tuple[str, ...]:
    """Return the lines of one print plate."""
    name, mass_g = f"print/plate_{number}", sum(1000 * assembly.inertial(part).mass_kg for part in parts)
    hours = print_hours(mass_g, assembly.layout.scanner.printer)
    return (
        f"Plate {number}, `{name}.3mf`: {', '.join(parts)}; {hours_in_words(hours)}.",
        "",
        f"![Plate {number} on the bed]({name}.png)",
        "",
    )


def picture_name(number: int) -> str:
    """Return the file of a step's picture, relative to the build folder."""
    return f"assembly/step_{number:02d}.png"


def screws_in_words(assembly: Assembly, joint: Joint, blade_mm: int | None = None) -> str:
    """Return one joint as a sentence, with the torque of its screws, and the blade of a driver longer than a key."""
    what = f"{joint.count} x {joint.number}{'' if joint.washer_mm is None else ' with washers'}"
    nuts = f"{joint.count} nut{'s' if joint.count > 1 else ''} {joint.screw.name}"
    in_case = " in the slots of the case" if joint.onto == SERVO_CASE else ""
    place = {
        "thread": f"from {joint.part} into {joint.onto}",
        "trap": f"from {joint.part} onto {nuts} in {joint.onto}",
        "nut": f"through {joint.part} into {joint.onto}, with {nuts}{in_case}",
        "deck": f"through the foot into the deck, with {nuts}",
        "grub": f"in {joint.part}, against {joint.onto}",
    }[joint.fixing]
    inserts = ", in heat-set inserts" if joint.inserts else ""
    if joint.traps and joint.fixing == "grub":
        inserts = f", through {nuts} in its bore"
    reach = "" if blade_mm is None else f", with a long driver ({blade_in_words(blade_mm)})"
    return f"{what} {place}{inserts}, {torque_in_words(assembly, joint)}{reach}."


def torque_in_words(assembly: Assembly, joint: Joint) -> str:
    """Return the torque of the screws of a joint."""
    if joint.loose:
        return "loose"
    hold = hold_of(joint, material_of(assembly, joint.part), material_of(assembly, joint.onto))
    return "hand-tight" if hold is None else f"{hold.torque_nm:g} N m"


def step_files(
    assembly: Assembly,
    meshes: dict[str, TriMesh],
    plates: Sequence[Sequence[str]],
    blades_mm: Mapping[Joint, int] = NO_BLADES,
) -> dict[str, bytes]:
    """Return `assembly.md` and the picture of each step; `meshes` of the made parts have their labels."""
    scenes = scenes_of(assembly)
    pictures = StepPictures(assembly.meshes() | meshes, frozenset(assembly.made))
    files = {"assembly.md": instructions_text(assembly, scenes, plates, blades_mm).encode("utf-8")}
    for number, scene in enumerate(scenes, start=1):
        torques = [torque_in_words(assembly, joint) for joint, _ in scene.joints]
        files[picture_name(number)] = pictures.picture(scene, torques, scenes[: number - 1])
    return files


def _words(assembly: Assembly, scene: StepScene, blades_mm: Mapping[Joint, int]) -> str:
    """Return the text of a step with its screws in their places."""
    text = scene.step.words
    for joint, mark in scene.joints:
        screws = f"**{screws_in_words(assembly, joint, blades_mm.get(joint))}**"
        text = text.replace(mark, f"{screws} {mark}", 1) if mark else f"{text} {screws}"
    return " ".join(re.sub(r"\{.*?\}", "", text).split())


def _to_measure(assembly: Assembly) -> Iterator[str]:
    """Yield the unverified values to measure before any part is printed."""
    for product in products_of(assembly.layout.scanner, assembly.layout.drive):
        fields = {field for name in assembly.made for field in assembly.parts[name].values_of(product)}
        if sentence := measure_first(product, *fields, "holes", *HORN_FIELDS):
            drawn = f" `scanwright catalogue '{product.name}' --sketch FILE.svg` shows where."
            yield from (f"{sentence}{drawn * (WITH_CALIPER in sentence)}", "")
