"""`out/compare/<task>/`: the optimum of a task compared with reference mounts, a cheap scanner and 3D lidars."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scanwright.design.evaluation.comparison import ComparisonRow, compare
from scanwright.design.evaluation.comparison_picture import compare_picture
from scanwright.design.evaluation.comparison_table import notes, short_table, table, write_csv
from scanwright.design.findings import Finding, sentence
from scanwright.design.progress import Progress
from scanwright.design.search.mounts.gain import gain_lines, verdict
from scanwright.design.search.optimum import Optimum, find_optimum
from scanwright.design.task.task import LoadedTask
from scanwright.pipeline.built_scanner import BuiltScanner
from scanwright.pipeline.folder import report_folder

VIBRATION = "natural_frequency"
"""Code of the check that is part of a comparison."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A comparison."""

    optimum: Optimum  # of the task
    rows: list[ComparisonRow]  # of the table
    folder: Path  # of the written files
    vibration: Finding | None = None  # check of a build's natural frequency; None without a build

    def lines(self, in_full: bool = False) -> list[str]:
        """Return the comparison as lines; all columns and their meaning only `in_full`."""
        if not in_full:
            return [
                *short_table(self.rows),
                "time: of a scan; beams: geometric mean in the ball; blind: share of the region; USD: devices only",
                notes(self.optimum.loaded, self.rows)[0],
                *verdict(self.optimum.gains),
                *self._vibration_lines(),
                f"wrote compare.csv, compare.png and compare.svg to {self.folder}",
            ]
        return [
            *table(self.rows),
            *(f"optimum: {line}" for line in self.optimum.hole_lines(tabled=False)),
            *(f"optimum: {line}" for line in gain_lines(self.optimum.gains)),
            *(f"optimum: {line}" for line in self.optimum.preferred_lines()),
            *notes(self.optimum.loaded, self.rows),
            *self._vibration_lines(),
            f"wrote compare.csv, compare.png and compare.svg to {self.folder}",
        ]

    def _vibration_lines(self) -> list[str]:
        return [] if self.vibration is None else [f"with parts: {sentence(self.vibration)}"]


def write_comparison(
    loaded: LoadedTask, target: Path, progress: Progress, built: BuiltScanner | None = None
) -> Comparison:
    """Compare, and write `compare.csv`, `compare.png` and `compare.svg`; `built` is a build of the task.

    Raises:
        TaskError: no direction has a weight, or no setting keeps the limits.
        BuildError: the folder is a build folder, or cannot be written.
    """
    with report_folder(target) as folder:
        optimum = find_optimum(loaded, progress)
        setting = None if built is None or built.shadow is None else (built.setting_rad, built.shadow)
        rows = compare(optimum.loaded, optimum.problem, optimum.search.best[0], optimum.mounts, progress, setting)
        write_csv(folder / "compare.csv", rows)
        compare_picture(folder / "compare.png", rows, f"{loaded.task.name}: {optimum.title}, compared")
    checks = () if built is None else built.checks
    return Comparison(optimum, rows, target, next((each for each in checks if each.code == VIBRATION), None))
