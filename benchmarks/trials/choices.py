"""Error against run time of numerical choices other than J: meshes, integrator of the emulated servo, axis angle.

    uv run python -m benchmarks.trials.choices [TASK]

It builds the parts of the task's optimum, and writes `choices.csv` and `choices.png` to `out/accuracy/<task>/`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.trials.axis import axis_trials
from benchmarks.trials.meshes import mesh_trials
from benchmarks.trials.solver import solver_trials
from scanwright.cad.assembly.make import make_parts
from scanwright.cli.console import ConsoleProgress
from scanwright.design.accuracy.trials import report_trials
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import load_task
from scanwright.firmware_io.emulators.servo_plant import plant_of


def main(words: list[str] | None = None) -> None:
    """Measure all choices and print them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.choices")
    parser.add_argument("task", nargs="?", type=Path, default=Path("ground_ahead"))
    parser.add_argument("--out", type=Path, default=Path("out/accuracy"))
    asked = parser.parse_args(words)
    loaded, progress = load_task(asked.task), ConsoleProgress()
    optimum = find_optimum(loaded, progress)
    solids = make_parts(loaded.scanner(optimum.angle_set())).made
    trials = [
        *mesh_trials(solids, progress),
        *solver_trials(plant_of(loaded.task.servo), progress),
        *axis_trials(progress),
    ]
    print(*report_trials(trials, asked.out / loaded.task.name, "choices"), sep="\n")


if __name__ == "__main__":
    main()
