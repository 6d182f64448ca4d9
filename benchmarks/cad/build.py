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

STAGES = {
    "loading": "start and search",
    "parts of": "solids",
    "making the parts": "solids",
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
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            command = [sys.executable, "-m", "scanwright", "build", task, "--out", folder, "-q"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            on_all = time.perf_counter() - start
        with tempfile.TemporaryDirectory() as folder:
            one_core = [sys.executable, "-m", "benchmarks.cad.build", "--on-one-core", task, folder]
            start = time.perf_counter()
            steps = subprocess.run(one_core, check=True, stdout=subprocess.PIPE, text=True).stdout
            on_one = time.perf_counter() - start
        print(f"{task}: {on_all:.1f} s on {os.cpu_count()} cores, {on_one:.1f} s on one; seconds of the processor:")
        print(steps, end="")


def on_one_core(task: str, folder: str) -> None:
    """Build, and print the seconds of the processor that each stage took."""
    if hasattr(os, "sched_setaffinity"):  # Linux
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    from design.task.task import load_task
    from scanwright.pipeline.build import build_task

    taken: dict[str, float] = defaultdict(float)
    stage, since = "start and search", 0.0  # time.process_time counts from the start of the process

    def say(line: str) -> None:
        nonlocal stage, since
        now = time.process_time()
        taken[stage] += now - since
        stage = next((STAGES[begin] for begin in STAGES if line.startswith(begin)), "start and search")
        since = now

    build_task(load_task(task), Path(folder) / task, say)
    say("")
    for name, seconds in sorted(taken.items(), key=lambda item: -item[1]):
        print(f"  {name:<50} {seconds:5.2f}  {seconds / sum(taken.values()):4.0%}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--on-one-core"]:
        on_one_core(*sys.argv[2:])
    else:
        main(sys.argv[1:])
