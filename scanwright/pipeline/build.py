"""The stages of a build: task, search, angles, parts, checks, drawings, files, report, into `out/<task>/`."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from scanwright.cad.checks.checks_json import add_check, read_checks
from scanwright.cad.files.part_files import PartReport, PartsResult, build_parts, write_files
from scanwright.cad.kernel import require_kernel
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.concurrency.processes import Begin, Packed, worker_processes
from scanwright.design.electrics.wiring import require_circuits
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding, errors_in, sentence
from scanwright.design.progress import Progress, no_progress
from scanwright.design.task.task import LoadedTask, load_task
from scanwright.pipeline.deck_height import deck_height
from scanwright.pipeline.folder import fresh_folder
from scanwright.pipeline.manifest import changes, first_difference, is_current, listed_files, write_manifest
from scanwright.pipeline.ros2.package import write_package

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly
    from scanwright.design.evaluation.as_built import AsBuilt
    from scanwright.design.evaluation.expected_cloud import ExpectedCloud
    from scanwright.design.left_out import LeftOut
    from scanwright.design.scanner import Scanner
    from scanwright.design.search.optimum import Optimum
    from scanwright.design.search.with_parts import Chosen, Workshop

    Failed = dict[tuple[float, ...], str]  # settings [deg] whose parts failed a check, and its message
    Attempt = tuple[Chosen, Scanner, Packed[Assembly]]

_LOG = logging.getLogger(__name__)

KERNEL = (
    "scanwright.cad.checks.run",
    "scanwright.cad.drawings.files",
    "scanwright.cad.files.workshop_files",
    "scanwright.report.page",
)
"""Modules that import the CAD kernel; worker processes import them while the search runs."""

MOST_FAILED = 3
"""Other mounts that are made if the parts of the best one fail a check."""

DRAWN = 2
"""Reference mounts in density.png, the best one first, for which the ratio is drawn."""

BEGINS = {
    "reading the": 0.0,
    "weights of": 0.0,
    "exact densities": 0.0,
    "all axes": 0.0,
    "refining the": 0.0,
    "waiting for": 0.0,
    "beams blocked": 0.09,
    "loading the": 0.32,
    "engraving the": 0.325,
    "meshing and": 0.45,
    "writing assembly.step": 0.57,
    "writing print": 0.6,
    "making the fit": 0.61,
    "writing assembly.glb": 0.73,
    "writing bom.csv": 0.75,
    "writing report.html": 0.83,
}
"""Share of the build's time after the search that has passed at the start of each step, by the step's first words.

Measured on two cores with `ground_ahead`, `indoor_urg` and `rolling`. The times of the search and of the kernel's start
vary, so the remaining time is estimated only from a share of a tenth on, when the parts are chosen.
"""


@dataclass(frozen=True, slots=True)
class Made:
    """The results of one build."""

    optimum: Optimum  # result of the search
    chosen: Chosen  # the best mount with its parts, which was built
    as_built: AsBuilt  # its view without the beams that its parts block
    findings: tuple[Finding, ...]  # to read before the parts are made
    cloud: ExpectedCloud  # expected error, gaps and points
    to_make: str  # numbers of parts to print and to machine, and the time to print


@dataclass(frozen=True, slots=True)
class Build:
    """A build folder.

    Attributes:
        folder: the folder.
        files: its files, relative to the folder.
        warnings: limits of the task that can surprise.
        checks: of its parts, as in `checks.json`.
        made: results of the build; None if the folder was current.
    """

    folder: Path
    files: tuple[str, ...]
    warnings: tuple[str, ...]
    checks: tuple[Finding, ...]
    made: Made | None

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The failed checks; make the parts only if there are none."""
        return errors_in(self.checks)

    def lines(self, in_full: bool = False) -> list[str]:
        """Return the result as lines; the table of mounts and each unverified value only `in_full`."""
        if self.made is None:
            return [f"{self.folder} is up to date ({len(self.files)} files)"]
        optimum = self.made.optimum
        return [
            f"wrote {len(self.files)} files to {self.folder}",
            *self.made.cloud.lines(),
            f"parts to make: {self.made.to_make}",
            *(optimum.table() if in_full else [*optimum.hole_lines(tabled=False), *optimum.preferred_lines()]),
            *self.made.chosen.lines(),
            *self.made.as_built.lines(),
            *(f"warning: {warning}" for warning in self.warnings),
            *finding_lines(self.made.findings, self.checks, in_full),
        ]


@dataclass(frozen=True, slots=True)
class PartsMade:
    """The parts: reports, findings, omissions, and the solids for processes with the CAD kernel."""

    parts: tuple[PartReport, ...]
    findings: tuple[Finding, ...]
    left_out: tuple[LeftOut, ...]
    result: Packed[PartsResult]


def finding_lines(findings: Sequence[Finding], checks: Sequence[Finding], in_full: bool) -> list[str]:
    """Return one line for each finding and each unverified value; unless `in_full`, only a count of these."""
    unverified = [check for check in checks if check.code == "unverified"]
    lines = [f"{each.severity}: {sentence(each)}" for each in (*findings, *(unverified if in_full else ()))]
    if in_full or not unverified:
        return lines
    counts = ", ".join(f"{name}: {n}" for name, n in Counter(check.subject for check in unverified).items())
    return [*lines, f"warning: unverified values shape parts ({counts}): measure yours first, report.html lists them"]


def build_task(loaded: LoadedTask, target: Path, progress: Progress) -> Build:
    """Build the folder of a task, `out/<task>`, unless it is up to date; failed checks are in `Build.failed`.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: no direction has a weight, or no mount meets the limits.
        BuildError: no mount can be built, or the folder cannot be written.
        KeyboardInterrupt: with a note on the state of the folder.
    """
    require_kernel("build")
    try:
        made = None
        if not is_current(target, loaded):
            if edits := changes(target):
                _LOG.warning("%s: %s: built again", target, edits)
            made = _make(loaded, target, progress)
    except KeyboardInterrupt as stop:
        stop.add_note(f"{target} is {'finished' if is_current(target, loaded) else 'as it was'}")
        raise
    checks = read_checks(target / "checks.json")
    return Build(target, listed_files(target), tuple(loaded.warnings()), checks, made)


def difference_when_rebuilt(folder: Path, progress: Progress) -> str | None:
    """Rebuild the task of a build folder elsewhere, and describe the first difference; None if there is none.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: the folder has no task.
        BuildError: the folder is no finished build.
    """
    require_kernel("build")
    loaded = load_task(folder / "task.toml")
    with tempfile.TemporaryDirectory() as elsewhere:
        again = Path(elsewhere) / loaded.task.name
        _make(loaded, again, progress)
        return first_difference(folder, again)


def setting_built(optimum: Optimum) -> Chosen:
    """Return the mount of an optimum that a build tries first: the best one with the beams that its parts block.

    Raises:
        InstallError: the CAD kernel is not installed.
        BuildError: no setting can be built.
    """
    require_kernel("a mount with its parts")
    from scanwright.cad.assembly.shadow import PartsWorkshop

    return _chosen(optimum, PartsWorkshop(optimum.loaded.scanner(optimum.angle_set())), {}, no_progress)


def _chosen(optimum: Optimum, workshop: Workshop, failed: Failed, progress: Progress) -> Chosen:
    from scanwright.design.objective.self_check import require_counted
    from scanwright.design.search.with_parts import choose_with_parts

    task = optimum.loaded.task
    families = optimum.search.best
    chosen = choose_with_parts(optimum.problem, families, task.angles, task.limits, workshop, progress, failed)
    require_counted(optimum.loaded, chosen.family.angles_rad, chosen.family.score, chosen.shadow)
    return chosen


def _choose_and_make(
    optimum: Optimum, task_sha256: str, failed: Failed, progress: Progress
) -> tuple[Chosen, Scanner, Packed[Assembly]]:
    """Choose a mount that is not among those that failed, and make the scanner and its parts."""
    from scanwright.cad.assembly.shadow import PartsWorkshop
    from scanwright.design.search.optimum import angle_set
    from scanwright.pipeline.alternatives import what_fits

    loaded = optimum.loaded
    workshop = PartsWorkshop(loaded.scanner(optimum.angle_set()))
    try:
        chosen = _chosen(optimum, workshop, failed, progress)
    except BuildError as error:
        raise BuildError(f"{error}{what_fits(loaded, optimum.angle_set())}") from error
    angles = angle_set(loaded, chosen.family).model_copy(update={"task_sha256": task_sha256})
    assembly = workshop.assembly(loaded.scanner(angles))
    scanner = loaded.scanner(angles.model_copy(update={"t_world_rot_mm": assembly.layout.deck.t_world_rot}))
    return chosen, scanner, Packed.of(assembly)


def _make_passing(
    begin: Begin, optimum: Optimum, task_sha256: str, first: Attempt, work: Path, progress: Progress
) -> tuple[Chosen, Scanner, PartsMade]:
    """Write parts and checks of the first mount, or of the next one if a check fails; if all fail, of the first."""
    attempt, failed = first, dict[tuple[float, ...], str]()
    parts, errors = _write_and_check(begin, attempt, work, progress)
    while errors and len(failed) < MOST_FAILED:
        failed[attempt[0].family.angles_deg] = errors[0].message
        progress(f"a check failed, trying another mount: {errors[0].message}")
        try:
            attempt = begin(_choose_and_make, optimum, task_sha256, failed, progress)()
        except BuildError:  # no other mount can be built
            break
        parts, errors = _write_and_check(begin, attempt, work, progress)
    if errors and attempt is not first:
        attempt = first
        parts, errors = _write_and_check(begin, attempt, work, progress)
    return attempt[0], attempt[1], parts


def _write_and_check(
    begin: Begin, attempt: Attempt, work: Path, progress: Progress
) -> tuple[PartsMade, tuple[Finding, ...]]:
    """Write parts and checks of a mount, in place of those of another one; returns the checks that failed."""
    shutil.rmtree(work / "parts", ignore_errors=True)
    _, scanner, assembly = attempt
    written = begin(_written, scanner, assembly, work, progress)
    checked = begin(_checked, assembly, progress)
    parts = written()
    write_files(work, checked())
    return parts, errors_in(read_checks(work / "checks.json"))


def _checked(assembly: Packed[Assembly], progress: Progress) -> dict[str, bytes]:
    """Return the files of the checks and the self-occlusion."""
    from scanwright.cad.checks.run import check_files

    return check_files(assembly.open(), progress)


def _written(scanner: Scanner, assembly: Packed[Assembly], folder: Path, progress: Progress) -> PartsMade:
    """Write the parts with their labels into the folder."""
    parts = build_parts(scanner, assembly.open(), folder, progress)
    return PartsMade(parts.parts, parts.findings, parts.left_out, Packed.of(parts))


def _exported(
    scanner: Scanner, parts: Packed[PartsResult], folder: Path, progress: Progress
) -> tuple[list[Finding], list[LeftOut]]:
    """Write the files for the workshop except the drawings; returns findings and omissions."""
    from scanwright.cad.files.workshop_files import export_scanner

    return export_scanner(scanner, parts.open(), folder, progress)


def _drawn(parts: Packed[PartsResult], progress: Progress) -> dict[str, bytes]:
    """Return the files of the drawings."""
    from scanwright.cad.drawings.files import drawing_files

    progress("drawing the parts")
    made = parts.open()
    return drawing_files(made.assembly, made.masses_g())


def measured(progress: Progress, step: str, fraction: float | None = None, /) -> None:
    """Report a step of a build with the share of the build that is done, or None for a step that is not in `BEGINS`."""
    begins = next((share for words, share in BEGINS.items() if step.startswith(words)), None)
    if begins:
        ends = next((share for share in BEGINS.values() if share > begins), 1.0)
        begins += (fraction or 0.0) * (ends - begins)
    progress(step, begins)


def _make(requested: LoadedTask, target: Path, progress: Progress) -> Made:
    """Run all stages in order."""
    from scanwright.design.evaluation.as_built import as_built
    from scanwright.design.evaluation.expected_cloud import expected_cloud
    from scanwright.design.search.optimum import find_optimum

    if (ring := requested.ring) is not None:  # before the search, which takes longer
        require_circuits(ring, requested.lidar, (each for each in requested.products if isinstance(each, SlipRing)))
    progress = partial(measured, progress)
    with fresh_folder(target) as work, worker_processes(2, KERNEL) as begin:  # this process does not load the kernel
        optimum = find_optimum(requested, progress)
        # with `period_s = "shortest"` the search has changed the motion, but `requested` is written for a rebuild
        loaded, problem, result = optimum.loaded, optimum.problem, optimum.search
        from scanwright.design.evaluation.density_picture import density_figure  # while the kernel still loads
        from scanwright.design.files.picture_files import save_picture
        from scanwright.pipeline import records
        from scanwright.report.parts_list import read_parts

        progress("waiting for the CAD kernel")
        made = begin(_choose_and_make, optimum, requested.sha256(), {}, progress)
        begin(import_module, "trimesh")  # for the report, in the idle process
        records.write_task(work, requested)
        records.write_search(work, result)
        chosen, scanner, parts = _make_passing(begin, optimum, requested.sha256(), made(), work, progress)
        best, angles = chosen.family, scanner.angles
        (work / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        height = deck_height(loaded, angles)
        add_check(work / "checks.json", height)
        exported, drawn = (
            begin(_exported, scanner, parts.result, work, progress),
            begin(_drawn, parts.result, progress),
        )
        settings = {f"{loaded.task.name}, with parts: J = {best.score.J:.3f}": best.angles_rad}
        settings |= {
            f"{gain.mount.name}, without parts: J = {gain.mount.score.J:.3f}": gain.mount.angles_rad
            for gain in optimum.gains[:DRAWN]
        }
        save_picture(density_figure(problem, settings, optimum.title, chosen.shadow), work / "density.png")
        findings, left_out = exported()
        write_files(work, drawn())
        records.write_left_out(work, [*optimum.left_out, *chosen.left_out(), *parts.left_out, *left_out])
        write_package(work)
        write_manifest(work, requested, [asdict(part) for part in parts.parts])
        progress("writing report.html")
        records.write_report(work, begin)
        to_make = read_parts(work / "bom.csv").to_make
    checks = read_checks(target / "checks.json")
    cloud = expected_cloud(loaded, problem, best.angles_rad, best.score, chosen.shadow, checks)
    seen = as_built(problem, loaded.task, best.angles_rad, chosen.shadow, best.score, optimum.mounts)
    return Made(optimum, chosen, seen, (height, *parts.findings, *findings), cloud, to_make)
