"""What a build hands to the workshop beside STEP and STL: print files, the scanner to look at, parts list, drawings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cad.checks.remarks import without_traps
from cad.drawings.files import drawing_files
from cad.files.bom import bom_text, items_of
from cad.files.glb_scenes import scene_files
from cad.files.instructions import instructions_text
from cad.files.part_files import PartsResult, write_files
from cad.files.threemf import threemf_bytes
from cad.files.wiring import wiring_files
from cad.findings import PartFinding
from cad.geometry.mesh import TriMesh, checked_mesh
from cad.geometry.print_pose import on_bed, print_pose
from cad.labels.fit_coupon import fit_coupon
from cad.layout.all_joints import joints_of
from cad.layout.layout import config_hash
from cad.layout.names import FIT_COUPON
from design.concurrency.second_process import Begin, in_turn
from design.left_out import LeftOut
from design.scanner import Scanner


@dataclass(frozen=True, slots=True)
class Exports:
    """What was written, relative to the build folder, what was not, and what a person should know."""

    files: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    findings: tuple[PartFinding, ...]


def export_scanner(
    scanner: Scanner, made: PartsResult, folder: Path, progress: Callable[[str], None], begin: Begin = in_turn
) -> Exports:
    """Write all of them into a build folder.

    Args:
        scanner: angles and products.
        made: its parts, of `part_files.build_parts`.
        folder: the build folder.
        progress: called with a line of text before each step.
        begin: who draws the parts.
    """
    assembly, digest = made.assembly, config_hash(scanner)
    masses = {report.name: report.mass_g for report in made.parts}
    joints = joints_of(assembly.layout)
    progress("drawing the parts")
    drawn = begin(drawing_files, scanner, assembly, masses, digest)
    progress("writing print files")
    files, left_out = _prints(scanner, made.meshes, assembly.metal(), digest)
    progress("making the fit coupon")
    coupon = fit_coupon(scanner, assembly.layout.stack)
    files |= _print_file(scanner, FIT_COUPON, checked_mesh(coupon, FIT_COUPON), digest)
    progress("writing assembly.glb and exploded.glb")
    files |= scene_files(scanner, assembly, made.meshes, digest)
    progress("writing bom.csv, assembly.md and wiring.svg")
    items = items_of(scanner, assembly, joints, masses, digest)
    files["bom.csv"] = bom_text(items).encode("utf-8")
    files["assembly.md"] = instructions_text(scanner, assembly, joints, digest).encode("utf-8")
    files |= wiring_files(scanner, digest)
    files |= drawn()
    write_files(folder, files)
    findings = without_traps(scanner.printer, joints)
    return Exports(tuple(sorted(files)), tuple(left_out), tuple(findings))


def _prints(
    scanner: Scanner, meshes: dict[str, TriMesh], metal: frozenset[str], digest: str
) -> tuple[dict[str, bytes], list[LeftOut]]:
    """`print/<part>.3mf` of every printed part."""
    files: dict[str, bytes] = {}
    left_out = []
    for part, mesh in meshes.items():
        if part in metal:
            left_out.append(LeftOut(f"print/{part}.3mf", "of metal: made after its STEP file", 1, "print files"))
            continue
        files |= _print_file(scanner, part, mesh, digest)
    return files, left_out


def _print_file(scanner: Scanner, part: str, mesh: TriMesh, digest: str) -> dict[str, bytes]:
    """One part as it lies on the bed."""
    pose = print_pose(mesh, scanner.printer.bed_mm)
    about = f"{scanner.angles.task}, config={digest}, {scanner.printer.name}, as it lies on the bed"
    return {f"print/{part}.3mf": threemf_bytes(on_bed(mesh, pose), part, about)}
