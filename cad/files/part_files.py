"""Write all parts of one scanner: `parts/*.step`, `parts/*.stl`, `assembly.step`, `scanner.urdf`.

Importing this module does not load the CAD kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scanwright.cad.layout.joints import triple
from scanwright.cad.layout.names import BASE_MOUNT
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.progress import Progress
from scanwright.design.scanner import Scanner

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly
    from scanwright.cad.geometry.mesh import TriMesh


@dataclass(frozen=True, slots=True)
class PartReport:
    """One made part: volume and mass without its label, box in the rotation frame."""

    name: str
    volume_mm3: float
    mass_g: float
    box_mm: tuple[tuple[float, float, float], tuple[float, float, float]]
    triangles: int


@dataclass(frozen=True, slots=True)
class PartsResult:
    """Results of `build_parts`."""

    assembly: Assembly  # the solids
    meshes: dict[str, TriMesh]  # canonical mesh of each made part, with its label
    parts: tuple[PartReport, ...]  # properties of each made part
    findings: tuple[Finding, ...]  # remarks for a person
    left_out: tuple[LeftOut, ...]  # parts that this scanner does not need

    def masses_g(self) -> dict[str, float]:
        """Return the masses of the made parts by name."""
        return {report.name: report.mass_g for report in self.parts}


def build_parts(scanner: Scanner, assembly: Assembly, folder: Path, progress: Progress) -> PartsResult:
    """Label every part and write it into `parts/` of a build folder.

    `scanner.angles.t_world_rot_mm` must be that of its deck, or zero.

    Raises:
        BuildError: a part has no closed mesh, or the angle set states another place of the optical centre.
    """
    progress("loading the CAD kernel")
    from scanwright.cad.assembly.assembly import alone, as_tree, link_bodies
    from scanwright.cad.checks.products import remarks_of
    from scanwright.cad.files.step import step_text
    from scanwright.cad.files.urdf import urdf_text
    from scanwright.cad.geometry.mesh import checked, stl_bytes
    from scanwright.cad.labels.label import labelled_parts

    layout, digest = assembly.layout, assembly.layout.digest
    stated, offset = scanner.angles.t_world_rot_mm, layout.deck.t_world_rot
    if any(stated) and max(abs(a - b) for a, b in zip(stated, offset, strict=True)) > 1e-3:
        raise BuildError(
            f"{BASE_MOUNT}: t_world_rot_mm = {list(stated)}: the mount of these angles puts the optical centre at "
            f"{list(offset)}; build the angle set again, or set it to 0"
        )
    files: dict[str, bytes] = {}
    reports = []
    meshes_of_parts: dict[str, TriMesh] = {}
    progress("engraving the labels")
    labels = labelled_parts(assembly)
    for number, (name, solid) in enumerate(assembly.made.items()):
        progress(f"meshing and writing {name}", number / len(assembly.made))
        part = assembly.parts[name]
        plain = checked(assembly.mesh(name), solid, name)
        mesh = meshes_of_parts[name] = labels.meshes.get(name, plain)
        text = step_text(alone(name, solid, part.colour), f"{name} config={digest}")
        files[f"parts/{name}.step"] = text.encode("ascii")
        files[f"parts/{name}.stl"] = stl_bytes(mesh, name, digest)
        volume, mass_g = solid.Volume(), solid.Volume() * part.density_g_cm3(scanner.printer) / 1000
        box = triple(mesh.vertices.min(axis=0)), triple(mesh.vertices.max(axis=0))
        reports.append(PartReport(name, round(volume, 3), round(mass_g, 3), box, len(mesh.faces)))
    progress("writing assembly.step and scanner.urdf")
    files["assembly.step"] = step_text(as_tree(assembly), f"assembly config={digest}").encode("ascii")
    bodies = link_bodies(assembly)
    meshes = {"servo": assembly.parts_in("servo"), "rot": assembly.parts_in("rot")}
    files["scanner.urdf"] = urdf_text(scanner, assembly.layout.drive, bodies, meshes).encode("utf-8")
    write_files(folder, files)
    return PartsResult(
        assembly=assembly,
        meshes=meshes_of_parts,
        parts=tuple(reports),
        findings=tuple(remarks_of(assembly)),
        left_out=(*layout.left_out, *labels.left_out),
    )


def write_files(folder: Path, files: dict[str, bytes]) -> None:
    """Write files by their names relative to the build folder."""
    for file, content in files.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
