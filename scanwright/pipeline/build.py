"""The order of a build: task, search, angles, parts, checks, drawings, files, report, into `out/<task>/`."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from scanwright.cad.checks.check import Check, failed_of, read_checks
from scanwright.cad.kernel import require_kernel
from scanwright.design.concurrency.processes import Packed, worker_processes
from scanwright.design.task.task import LoadedTask, load_task
from scanwright.pipeline.folder import fresh_folder
from scanwright.pipeline.manifest import changes, first_difference, is_current, listed_files, write_manifest
from scanwright.pipeline.ros2.package import write_package

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly
    from scanwright.cad.files.part_files import PartReport, PartsResult
    from scanwright.cad.findings import PartFinding
    from scanwright.design.evaluation.as_built import AsBuilt
    from scanwright.design.evaluation.metres import PlaneFigures
    from scanwright.design.left_out import LeftOut
    from scanwright.design.scanner import Scanner
    from scanwright.design.search.optimum import Optimum
    from scanwright.design.search.with_parts import Chosen, Workshop

Say = Callable[[str], None]

KERNEL = (
    "scanwright.cad.checks.run",
    "scanwright.cad.drawings.files",
    "scanwright.cad.files.workshop_files",
    "scanwright.report.page",
)
"""What brings the CAD kernel and all that works on parts with it: loaded while the search runs, in no third place."""

DRAWN = 2
"""Reference mounts beside the scanner in density.png, the best one first: its ratio is drawn."""

BEHIND = {"search": 0.0, "shadow": 0.3, "parts": 0.51, "pictures": 0.51, "files": 0.73, "report": 0.9}
"""Share of a build's time that has gone when a stage begins: `ground_ahead` on two cores."""


@dataclass(frozen=True, slots=True)
class Made:
    """What the work of one build came to.

    Attributes:
        optimum: the search.
        chosen: the setting that is best with its parts: the one that was built.
        as_built: what it sees, without the beams that its parts block.
        findings: what a person should know before the parts are made.
        planes: what one full scan leaves on ground, ceiling and walls of the task.
    """

    optimum: Optimum
    chosen: Chosen
    as_built: AsBuilt
    findings: tuple[PartFinding, ...]
    planes: tuple[PlaneFigures, ...]


@dataclass(frozen=True, slots=True)
class Build:
    """A build folder.

    Attributes:
        folder: where it is.
        files: its files, relative to the folder.
        warnings: what the task can do, but not as well as its author may think.
        checks: of its parts, as in `checks.json`.
        made: what was done; None if the folder was current and there was nothing to do.
        misfits: products that the printed parts do not fit, and why, in lines.
    """

    folder: Path
    files: tuple[str, ...]
    warnings: tuple[str, ...]
    checks: tuple[Check, ...]
    made: Made | None
    misfits: tuple[str, ...] = ()

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that failed; the parts are safe to make only if there are none."""
        return failed_of(self.checks)

    def lines(self, in_full: bool = False) -> list[str]:
        """The same in words; warnings of one remedy are one, unless they are asked for `in_full`."""
        if self.made is None:
            return [f"{self.folder}: nothing has changed, no work to do ({len(self.files)} files)"]
        return [
            *self.made.optimum.table(),
            *self.made.chosen.lines(),
            *self.made.as_built.lines(),
            *(f"with parts: one full scan, {plane.words()}" for plane in self.made.planes),
            *(f"warning: {warning}" for warning in self.warnings),
            *(_one_by_one(self.made.findings) if in_full else _gathered(self.made.findings)),
            f"wrote {len(self.files)} files to {self.folder}",
        ]


@dataclass(frozen=True, slots=True)
class PartsMade:
    """What came of the parts: facts, findings, what was left out, and the parts for those who have the kernel."""

    parts: tuple[PartReport, ...]
    findings: tuple[PartFinding, ...]
    left_out: tuple[LeftOut, ...]
    result: Packed[PartsResult]


def _one_by_one(findings: Sequence[PartFinding]) -> list[str]:
    return [f"{finding.severity}: {finding.message}" for finding in findings]


def _gathered(findings: Sequence[PartFinding]) -> list[str]:
    """Each finding, but those about a value of a product as one list of what to measure."""
    to_measure: dict[str, list[str]] = {}
    for finding in findings:
        if finding.value:
            to_measure.setdefault(finding.subject, []).append(finding.value)
    lines = _one_by_one([finding for finding in findings if not finding.value])
    if to_measure:
        lines.append("warning: measure these on your own before you print, nobody has verified them (-v says more):")
        lines += [f"  {product}: {', '.join(values)}" for product, values in to_measure.items()]
    return lines


def build_task(loaded: LoadedTask, target: Path, say: Say) -> Build:
    """Make the build folder of a task, unless it is current. Failed checks do not raise: see `Build.failed`.

    Args:
        loaded: the task.
        target: the folder, `out/<task>`.
        say: progress.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: no direction has a weight, or no setting keeps the limits.
        BuildError: no setting can be built, or the folder cannot be written.
        KeyboardInterrupt: with a note of what became of the folder.
    """
    require_kernel("build")
    try:
        made = None if is_current(target, loaded) else _made_again(loaded, target, say)
    except KeyboardInterrupt as stop:
        stop.add_note(f"{target} is {'finished' if is_current(target, loaded) else 'as it was'}")
        raise
    checks = read_checks(target / "checks.json")
    return Build(target, listed_files(target), tuple(loaded.warnings()), checks, made, tuple(loaded.misfits()))


def difference_when_rebuilt(folder: Path, say: Say) -> str | None:
    """Build the task of a build folder again, elsewhere: the first difference in words, None where there is none.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: the folder has no task.
        BuildError: the folder is no finished build.
    """
    require_kernel("build")
    loaded = load_task(folder / "task.toml")
    with tempfile.TemporaryDirectory() as elsewhere:
        again = Path(elsewhere) / loaded.task.name
        _make(loaded, again, say)
        return first_difference(folder, again)


def setting_built(optimum: Optimum) -> Chosen:
    """The setting of an optimum that a build takes: the best with what its parts hide.

    Raises:
        InstallError: the CAD kernel is not installed.
        BuildError: no setting can be built.
    """
    require_kernel("what parts hide")
    from scanwright.cad.assembly.shadow import PartsWorkshop

    return _chosen(optimum, PartsWorkshop(optimum.loaded.scanner(optimum.angle_set())), lambda _: None)


def _chosen(optimum: Optimum, workshop: Workshop, say: Say) -> Chosen:
    from scanwright.design.objective.self_check import require_counted
    from scanwright.design.search.with_parts import choose_with_parts

    task = optimum.loaded.task
    chosen = choose_with_parts(optimum.problem, optimum.search.best, task.angles, task.limits, workshop, say)
    require_counted(optimum.loaded, chosen.family.angles_rad, chosen.family.score, chosen.shadow)
    return chosen


def _chosen_and_made(optimum: Optimum, task_sha256: str, say: Say) -> tuple[Chosen, Scanner, Packed[Assembly]]:
    """The setting, the scanner with it, and its parts."""
    from scanwright.cad.assembly.shadow import PartsWorkshop
    from scanwright.cad.layout.layout import mount_offset_mm
    from scanwright.design.search.optimum import angle_set

    loaded = optimum.loaded
    workshop = PartsWorkshop(loaded.scanner(optimum.angle_set()))
    chosen = _chosen(optimum, workshop, _at(say, "shadow"))
    angles = angle_set(loaded, chosen.family).model_copy(update={"task_sha256": task_sha256})
    offset = mount_offset_mm(loaded.scanner(angles))
    scanner = loaded.scanner(angles.model_copy(update={"t_world_rot_mm": offset}))
    return chosen, scanner, Packed.of(workshop.assembly(scanner))


def _checked(scanner: Scanner, assembly: Packed[Assembly], say: Say) -> dict[str, bytes]:
    """Checks and shadow as files."""
    from scanwright.cad.checks.run import check_files

    return check_files(scanner, assembly.open(), say)


def _written(scanner: Scanner, assembly: Packed[Assembly], folder: Path, say: Say) -> PartsMade:
    """The parts in the folder, with their labels."""
    from scanwright.cad.files.part_files import build_parts

    parts = build_parts(scanner, folder, _at(say, "parts"), lambda _: assembly.open())
    return PartsMade(parts.parts, parts.findings, parts.left_out, Packed.of(parts))


def _exported(
    scanner: Scanner, parts: Packed[PartsResult], folder: Path, say: Say
) -> tuple[tuple[PartFinding, ...], tuple[LeftOut, ...]]:
    """What goes to the workshop, in the folder, but the drawings; findings, and what was left out."""
    from scanwright.cad.files.workshop_files import export_scanner

    exports = export_scanner(scanner, parts.open(), folder, _at(say, "files"))
    return exports.findings, exports.left_out


def _drawn(scanner: Scanner, parts: Packed[PartsResult], say: Say) -> dict[str, bytes]:
    """Drawings as files."""
    from scanwright.cad.drawings.files import drawing_files
    from scanwright.cad.layout.layout import config_hash

    say("drawing the parts")
    made = parts.open()
    return drawing_files(scanner, made.assembly, made.masses_g(), config_hash(scanner))


def _at(say: Say, stage: str) -> Say:
    """Progress that tells how much of the whole build is behind it."""
    share = BEHIND[stage]
    return lambda line: say(f"{line} ({share:.0%})")


def _made_again(loaded: LoadedTask, target: Path, say: Say) -> Made:
    """Make a folder that is not current, and say whose work is lost by that."""
    found = changes(target)
    if found:
        say(f"{target}: {found.words()}: making it again")
    return _make(loaded, target, say)


def _make(asked: LoadedTask, target: Path, say: Say) -> Made:
    """All of it, in the order in which one thing follows from another."""
    from scanwright.cad.files.part_files import write_files
    from scanwright.design.evaluation.as_built import as_built
    from scanwright.design.evaluation.metres import on_planes
    from scanwright.design.search.optimum import find_optimum

    with fresh_folder(target) as work, worker_processes(2, KERNEL) as begin:  # this one never loads the kernel
        optimum = find_optimum(asked, _at(say, "search"))
        # with `period_s = "shortest"` the search has changed the motion, and a rebuild must ask for it again
        loaded, problem, result = optimum.loaded, optimum.problem, optimum.search
        from scanwright.design.evaluation.density_picture import density_picture  # while the kernel still loads
        from scanwright.pipeline import records

        made = begin(_chosen_and_made, optimum, asked.sha256(), say)
        begin(import_module, "trimesh")  # for the report: the other process has nothing to do before the parts are made
        records.write_task(work, asked)
        records.write_search(work, result)
        chosen, scanner, assembly = made()
        best, angles = chosen.family, scanner.angles
        written = begin(_written, scanner, assembly, work, say)
        checked = begin(_checked, scanner, assembly, say)
        (work / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        _at(say, "pictures")("drawing the density")
        settings = {f"{loaded.task.name}, with parts: J = {best.score.J:.3f}": best.angles_rad}
        settings |= {
            f"{gain.mount.name}, without parts: J = {gain.mount.score.J:.3f}": gain.mount.angles_rad
            for gain in optimum.gains[:DRAWN]
        }
        density_picture(work / "density.png", problem, settings, optimum.title, chosen.shadow)
        parts = written()
        exported, drawn = (
            begin(_exported, scanner, parts.result, work, say),
            begin(_drawn, scanner, parts.result, say),
        )
        write_files(work, checked())
        findings, left_out = exported()
        write_files(work, drawn())
        records.write_left_out(work, [*optimum.left_out, *parts.left_out, *left_out])
        write_package(work)
        write_manifest(work, asked, [asdict(part) for part in parts.parts])
        _at(say, "report")("writing report.html")
        records.write_report(work, begin)
    planes = on_planes(loaded, problem, best.angles_rad, chosen.shadow)
    seen = as_built(problem, loaded.task, best.angles_rad, chosen.shadow, best.score, optimum.mounts)
    return Made(optimum, chosen, seen, (*parts.findings, *findings), planes)
