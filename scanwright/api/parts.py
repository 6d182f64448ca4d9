"""Build folders, parts and their checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scanwright.api.arguments import AnglesLike, TaskLike, as_angle_set, as_task, with_say
from scanwright.cad.kernel import require_kernel
from scanwright.design.angles import load_angles
from scanwright.design.progress import Progress, no_progress
from scanwright.design.task.task import load_task
from scanwright.pipeline.build import Build, build_task
from scanwright.pipeline.manifest import require_as_built

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly
    from scanwright.design.findings import Finding


@with_say
def build(task: TaskLike, out: str | Path = "out", *, progress: Progress = no_progress) -> Build:
    """Generate angles, parts, drawings, parts list, frame chain and report of a task into `out/<task>/`.

    Does nothing if the folder is up to date.

    Returns:
        The build. Every file is written even if checks fail: do not make the parts unless `failed` is empty.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: as for `optimise`.
        BuildError: no mount can be built, or the folder cannot be written.

    Example:
        >>> import scanwright as sw
        >>> built = sw.build("tilted.toml", "out")
        >>> built.failed
        ()
    """
    require_kernel("build")
    loaded = as_task(task)
    return build_task(loaded, Path(out) / loaded.task.name, progress)


@with_say
def make_parts(task: TaskLike, angles: AnglesLike, *, progress: Progress = no_progress) -> Assembly:
    """Generate the parts of a scanner in memory, in the rotation frame [mm], without labels.

    Args:
        task: a task; its printer and deck determine the parts.
        angles: angle set of the scanner, such as `optimise(task).angle_set()`.
        progress: progress callback.

    Returns:
        The assembly: cadquery solids by name, made ones in `made`, such as `assembly.made["alignment_linkage"]`, and
        purchased products in `bought`.

    Raises:
        InstallError: the CAD kernel is not installed.
        BuildError: a part cannot be made.

    Example:
        >>> import scanwright as sw
        >>> assembly = sw.make_parts("tilted.toml", "out/tilted/angles.json")
        >>> assembly.made["alignment_linkage"].isValid()
        True
    """
    require_kernel("the making of parts")
    from scanwright.cad.assembly.make import make_parts

    loaded = as_task(task)
    progress("making the parts")
    return make_parts(loaded.scanner(as_angle_set(angles)))


@with_say
def check(folder: str | Path, *, progress: Progress = no_progress) -> list[Finding]:
    """Check the parts of a build folder: clearance, beams, loads, printing. A failed check has severity "error".

    The parts are generated from `task.toml` and `angles.json`; no other file is required.

    Raises:
        InstallError: the CAD kernel is not installed.
        TaskError: the folder has no angle set or no task.
        BuildError: a file of the build is missing or was edited, or a part cannot be made.

    Example:
        >>> import scanwright as sw
        >>> [finding.message for finding in sw.check("out/tilted") if finding.severity == "error"]
        []
    """
    require_kernel("check")
    folder = Path(folder)
    require_as_built(folder)
    scanner = load_task(folder / "task.toml").scanner(load_angles(folder / "angles.json"))
    from scanwright.cad.checks.run import check_scanner

    return check_scanner(scanner, progress)
