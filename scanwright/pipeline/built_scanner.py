"""The scanner of a build folder: its task, its angles, and the beams that its parts block."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scanwright.cad.checks.checks_json import read_checks
from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.arrays import Setting
from scanwright.design.findings import Finding
from scanwright.design.self_occlusion import SelfOcclusion, load_self_occlusion
from scanwright.design.task.task import LoadedTask, load_task, shipped_tasks
from scanwright.pipeline.manifest import require_as_built
from scanwright.report.answer import mounting_rad, task_as_built


@dataclass(frozen=True, slots=True)
class BuiltScanner:
    """The scanner of a build folder."""

    loaded: LoadedTask  # the task, with the motion that was built
    angles: AngleSet  # the angle set
    shadow: SelfOcclusion | None  # the beams that the parts block; None if the folder has no `own_body.npz`
    checks: tuple[Finding, ...] = ()  # of its parts; none if the folder has no `checks.json`

    @property
    def setting_rad(self) -> Setting:
        """(alpha_rot, beta_rot, alpha_laser, beta_laser) [rad]."""
        return mounting_rad(self.angles)


def is_build_folder(task: Path) -> bool:
    """Return whether a path names a build folder; the name of a shipped task always means that task."""
    return str(task) not in shipped_tasks() and (task / "angles.json").is_file()


def open_built(folder: Path) -> BuiltScanner:
    """Read a build folder.

    Raises:
        TaskError: the folder has no angle set or no task.
        BuildError: a file of the build is missing, was edited, or is invalid.
    """
    require_as_built(folder)
    angles, own_body, checks = load_angles(folder / "angles.json"), folder / "own_body.npz", folder / "checks.json"
    loaded = task_as_built(load_task(folder / "task.toml"), angles)
    shadow = load_self_occlusion(own_body)[0] if own_body.is_file() else None
    return BuiltScanner(loaded, angles, shadow, read_checks(checks) if checks.is_file() else ())
