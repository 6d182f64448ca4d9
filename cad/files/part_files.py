"""Make all parts of one scanner and write them: `parts/*.step`, `parts/*.stl`, `assembly.step`, `scanner.urdf`.

Importing this module is cheap; the kernel is imported when something is built.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scanwright.cad.kernel import require_kernel
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
    """One made part: volume and mass of the solid material, box in the rotation frame."""

    name: str
    volume_mm3: float
    mass_g: float
    box_mm: tuple[tuple[float, float, float], tuple[float, float, float]]
    triangles: int


@dataclass(frozen=True, slots=True)
class PartsResult:
    """Results of `build_parts`.

    Attributes:
        assembly: the solids.
        meshes: canonical mesh of each made part, with its label.
        t_world_rot_mm: optical centre in the world.
        parts: properties of each made part.
        findings: remarks for a person.
        left_out: what this scanner does not need.
        files: relative to the build folder.
    """

    assembly: Assembly
    meshes: dict[str, TriMesh]
    t_world_rot_mm: tuple[float, float, float]
    parts: tuple[PartReport, ...]
    findings: tuple[Finding, ...]
    left_out: tuple[LeftOut, ...]
    files: tuple[str, ...]

    def masses_g(self) -> dict[str, float]:
        """Return the masses of the made parts by name."""
        return {report.name: report.mass_g for report in self.parts}


def build_parts(
    scanner: Scanner, folder: Path, progress: Progress, make: Callable[[Scanner], Assembly] | None = None
) -> PartsResult:
    """Make every part and write it into a build folder.

    Args:
        scanner: angles and products; `scanner.angles.t_world_rot_mm` must be that of its deck, or zero.
        folder: the build folder; `parts/` is made in it.
        progress: callback for progress.
        make: makes the parts, if not `make.make_parts`.

    Raises:
        InstallError: the CAD kernel is not installed.
        BuildError: a part cannot be made, or the angle set states another place of the optical centre.
    """
    progress("loading the CAD kernel")
    require_kernel("the making of parts")
    from scanwright.cad.assembly.assembly import alone, as_tree
    from scanwright.cad.assembly.make import made_from
    from scanwright.cad.assembly.masses import link_bodies
    from scanwright.cad.checks.remarks import remarks_of
    from scanwright.cad.files.step import step_text
    from scanwright.cad.files.urdf import urdf_text
    from scanwright.cad.geometry.mesh import checked, stl_bytes
    from scanwright.cad.labels.label import labelled_parts
    from scanwright.cad.parts.all_parts import laid_out

    progress("making the parts")
    ready = None if make is None else make(scanner)
    layout = laid_out(scanner) if ready is None else ready.layout
    _check_offset(scanner, layout.deck.t_world_rot)  # before seconds go into the solids
    assembly, digest = ready or made_from(layout), layout.digest
    files: dict[str, bytes] = {}
    reports = []
    meshes_of_parts: dict[str, TriMesh] = {}
    progress("engraving the labels")
    labels = labelled_parts(scanner, assembly, digest)
    made = assembly.made | labels.parts
    for number, (name, solid) in enumerate(made.items()):
        progress(f"meshing and writing {name}", number / len(made))
        part = assembly.parts[name]
        mesh = labels.meshes[name] if name in labels.meshes else checked(assembly.mesh(name), solid, name)
        meshes_of_parts[name] = mesh
        text = step_text(alone(name, solid, part.colour), f"{name} config={digest}")
        files[f"parts/{name}.step"] = text.encode("ascii")
        files[f"parts/{name}.stl"] = stl_bytes(mesh, name, digest)
        reports.append(_report(name, solid.Volume(), part.density_g_cm3(scanner.printer), mesh))
    progress("writing assembly.step and scanner.urdf")
    files["assembly.step"] = step_text(as_tree(assembly), f"assembly config={digest}").encode("ascii")
    bodies = link_bodies(scanner, assembly)
    meshes = {"servo": assembly.fixed_parts(), "rot": assembly.turning_parts()}
    files["scanner.urdf"] = urdf_text(scanner, assembly.layout.drive, bodies, meshes).encode("utf-8")
    write_files(folder, files)
    return PartsResult(
        assembly=assembly,
        meshes=meshes_of_parts,
        t_world_rot_mm=layout.deck.t_world_rot,
        parts=tuple(reports),
        findings=tuple(remarks_of(scanner, assembly)),
        left_out=(*layout.left_out, *labels.left_out),
        files=tuple(sorted(files)),
    )


def write_files(folder: Path, files: dict[str, bytes]) -> None:
    """Write files by their names relative to the build folder."""
    for file, content in files.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def _report(name: str, volume: float, density: float, mesh: TriMesh) -> PartReport:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    box = ((float(low[0]), float(low[1]), float(low[2])), (float(high[0]), float(high[1]), float(high[2])))
    return PartReport(name, round(volume, 3), round(volume * density / 1000, 3), box, len(mesh.faces))


def _check_offset(scanner: Scanner, offset: tuple[float, float, float]) -> None:
    stated = scanner.angles.t_world_rot_mm
    if any(stated) and max(abs(a - b) for a, b in zip(stated, offset, strict=True)) > 1e-3:
        raise BuildError(
            f"{BASE_MOUNT}: t_world_rot_mm = {list(stated)}: the mount of these angles puts the optical centre at "
            f"{list(offset)}; build the angle set again, or set it to 0"
        )
