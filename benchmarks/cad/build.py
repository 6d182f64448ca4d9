"""What a cold build takes on all cores and on one, and on what its seconds go.

    python -m benchmarks.cad.build [TASK]...

Every build goes into an empty folder: first as the command on all cores, then in this process, held on one core, where
each line of progress ends the step before it, so that the steps add up to the whole. Both load what they need; compiled
kernels of the search and bytecode are those of the run before, if this installation keeps them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

SEARCH, SOLIDS = "start and search", "kernel, solids and what they hide"
STAGES = {
    "waiting for": SOLIDS,
    "beams blocked": SOLIDS,
    "loading": SOLIDS,
    "engraving": "labels",
    "meshing": "meshes, STEP and STL of the parts",
    "writing assembly.step": "meshes, STEP and STL of the parts",
    "casting": "checks",
    "checking": "checks",
    "drawing the density": "picture of the density",
    "drawing the parts": "drawings",
    "writing print": "print files, GLB, parts list, pictures of steps",
    "making the fit": "print files, GLB, parts list, pictures of steps",
    "writing assembly.glb": "print files, GLB, parts list, pictures of steps",
    "writing bom": "print files, GLB, parts list, pictures of steps",
    "writing report": "report",
}
"""What a line of progress begins with, and what begins with it; any other one belongs to the search."""
SHIPPED = Path(__file__).parents[2] / "design/task/shipped"


def main(tasks: list[str]) -> None:
    """Print seconds of each task."""
    for task in tasks or sorted(path.stem for path in SHIPPED.glob("*.toml")):
        on_all, _ = _built(["scanwright", "build", task, "-q"])
        on_one, told = _built(["benchmarks.cad.build", "--on-one-core", task])
        print(f"{task}: {on_all:.1f} s on {os.cpu_count()} cores, {on_one:.1f} s on one; seconds of the processor:")
        taken = _stages(told.splitlines())
        for stage, seconds in sorted(taken.items(), key=lambda item: -item[1]):
            print(f"  {stage:<50} {seconds:5.2f}  {seconds / sum(taken.values()):4.0%}")


def on_one_core(task: str, folder: Path) -> None:
    """Build, and print what is done and the seconds of the processor so far."""
    if hasattr(os, "sched_setaffinity"):  # Linux
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    from scanwright.design.task.task import load_task
    from scanwright.pipeline.build import build_task

    build_task(load_task(task), folder / task, progress)
    progress("")


def progress(line: str, _fraction: float | None = None, /) -> None:
    """A line of progress, with the seconds before it."""
    print(time.process_time(), line)


def _built(command: list[str]) -> tuple[float, str]:
    """Seconds on the clock of a command that is given an empty folder, and what it prints."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", *command, "--out", folder], check=True, stdout=subprocess.PIPE, text=True
        )
        return time.perf_counter() - start, done.stdout


def _stages(told: list[str]) -> dict[str, float]:
    """Seconds of each stage: a line of progress ends the step before it."""
    taken: dict[str, float] = defaultdict(float)
    stage, since = SEARCH, 0.0
    for words in told:
        until, _, line = words.partition(" ")
        taken[stage] += float(until) - since
        stage, since = next((STAGES[begin] for begin in STAGES if line.startswith(begin)), SEARCH), float(until)
    return taken


if __name__ == "__main__":
    if sys.argv[1:2] == ["--on-one-core"]:
        on_one_core(sys.argv[2], Path(sys.argv[4]))
    else:
        main(sys.argv[1:])
