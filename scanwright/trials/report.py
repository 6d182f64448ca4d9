"""Error against run time of numerical choices other than J."""

from __future__ import annotations

from pathlib import Path

from scanwright.design.accuracy.trials import report_trials
from scanwright.design.progress import Progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import LoadedTask
from scanwright.firmware_io.emulators.servo_plant import plant_of
from scanwright.trials.axis import axis_trials
from scanwright.trials.solver import solver_trials


def report_choices(loaded: LoadedTask, folder: Path, progress: Progress) -> list[str]:
    """Measure all choices at the optimum of a task, write `choices.csv` and `choices.png`, and return lines.

    Raises:
        TaskError: no direction has a weight, or no setting keeps the limits.
        BuildError: a part cannot be made.
    """
    from scanwright.cad.assembly.make import make_parts
    from scanwright.cad.geometry.mesh_trials import mesh_trials

    optimum = find_optimum(loaded, progress)
    solids = make_parts(loaded.scanner(optimum.angle_set())).made
    trials = [
        *mesh_trials(solids, progress),
        *solver_trials(plant_of(loaded.task.servo), progress),
        *axis_trials(progress),
    ]
    return report_trials(trials, folder, "choices")
