"""Files for the workshop besides STEP, STL and drawings: print files, scenes, parts list, wiring, assembly steps."""

from pathlib import Path

from scanwright.cad.assembly.print_settings import slicer_settings
from scanwright.cad.checks.access import blades_mm
from scanwright.cad.checks.products import without_traps
from scanwright.cad.drawings.files import template_pdf
from scanwright.cad.files.bom import bom_text, items_of
from scanwright.cad.files.glb import scene_files
from scanwright.cad.files.manual.instructions import step_files
from scanwright.cad.files.part_files import PartsResult, write_files
from scanwright.cad.files.plates import plate_files, plates_of, threemf_bytes
from scanwright.cad.files.wiring import wiring_files
from scanwright.cad.geometry.mesh import checked_mesh
from scanwright.cad.geometry.print_pose import on_bed, print_pose
from scanwright.cad.labels.fit_coupon import fit_coupon, make_test_plate
from scanwright.cad.layout.joints import screw_patterns
from scanwright.cad.layout.names import FIT_COUPON, TEST_PLATE
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.progress import Progress
from scanwright.design.scanner import Scanner


def export_scanner(
    scanner: Scanner, made: PartsResult, folder: Path, progress: Progress
) -> tuple[list[Finding], list[LeftOut]]:
    """Write all of them into a build folder; returns remarks for a person, and files that are not included.

    `made` is the result of `part_files.build_parts`.
    """
    assembly = made.assembly
    digest, joints = assembly.layout.digest, assembly.layout.joints
    metal, about = assembly.metal(), f"{scanner.angles.task}, config={digest}, {scanner.printer.name}"
    progress("writing print files")
    printed = {part: on_bed(mesh, assembly.print_pose(part)) for part, mesh in made.meshes.items() if part not in metal}
    progress("making the fit coupon")
    patterns = screw_patterns(joints, assembly.layout.stack.R())
    first = {FIT_COUPON: fit_coupon(scanner, assembly.layout.stack)}
    if (plate := make_test_plate(scanner, patterns)) is not None:
        first[TEST_PLATE] = checked_mesh(plate, TEST_PLATE)
    tried = {name: on_bed(mesh, print_pose(mesh, scanner.printer.bed_mm)) for name, mesh in first.items()}
    settings = slicer_settings(scanner.printer)
    files = {
        f"print/{part}.3mf": threemf_bytes({part: mesh}, part, f"{about}, as it lies on the bed", settings)
        for part, mesh in (printed | tried).items()
    }
    files["template.pdf"] = template_pdf(scanner, patterns)
    plates = plates_of(printed, scanner.printer.bed_mm)
    files |= plate_files(plates, scanner.printer.bed_mm, about, settings)
    progress("writing assembly.glb and exploded.glb")
    files |= scene_files(scanner, assembly, made.meshes, digest)
    progress("writing bom.csv, wiring.svg and assembly.md with its pictures")
    named = [list(plate) for plate in plates]
    blades = blades_mm(assembly)
    items = items_of(assembly, made.masses_g(), named, blades)
    files["bom.csv"] = bom_text(items).encode("utf-8")
    files |= step_files(assembly, made.meshes, named, blades)
    files |= wiring_files(scanner, digest)
    write_files(folder, files)
    return without_traps(scanner.printer, joints), [
        LeftOut(f"print/{part}.3mf", "of metal: made after its STEP file", 1, "print files")
        for part in made.meshes
        if part in metal
    ]
