"""What a study costs and what it survives, measured on one machine.

    uv run python -m benchmarks.scanwright.study costs DIR    unit costs of real work: scanwright/study/costs.csv
    uv run python -m benchmarks.scanwright.study kills [--each 20] [--what worker client] [--dask]
    uv run python -m benchmarks.scanwright.study efficiency [--units 40] [--seconds 1.0]
    uv run python -m benchmarks.scanwright.study memory [--units 100000]

`kills` ends a process with SIGKILL at a random moment of a study of synthetic work, brings back what does not come back
by itself, and compares the table with an undisturbed one; a ledger counts what was computed twice. `efficiency` sets
two workers against one, on the same work, and beside it two bare processes against one: what the machine itself
allows. `memory` tells the client's memory as the candidates go by; the work of each is nothing.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.scanwright.study.costs import measure_costs
from benchmarks.scanwright.study.efficiency import efficiency
from benchmarks.scanwright.study.invented import run_invented
from benchmarks.scanwright.study.kills import kills
from benchmarks.scanwright.study.memory import memory
from scanwright.design.errors import ScanwrightError


def main() -> None:
    """Parse the command line, and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    costs = commands.add_parser("costs")
    costs.add_argument("folder", type=Path)
    costs.add_argument("--every", type=int, default=1, help="of the candidates: 1 for all, 4 for each fourth")
    killing = commands.add_parser("kills")
    killing.add_argument("--what", nargs="+", choices=("worker", "scheduler", "client"), default=["worker", "client"])
    killing.add_argument("--dask", action="store_true", help="over a scheduler with two workers, which may be killed")
    killing.add_argument("--each", type=int, default=20)
    killing.add_argument("--units", type=int, default=40)
    killing.add_argument("--seconds", type=float, default=0.2)
    killing.add_argument("--seed", type=int, default=1)
    efficient = commands.add_parser("efficiency")
    efficient.add_argument("--units", type=int, default=40)
    efficient.add_argument("--seconds", type=float, default=1.0)
    commands.add_parser("memory").add_argument("--units", type=int, default=100_000)
    invented = commands.add_parser("invented")
    invented.add_argument("folder", type=Path)
    invented.add_argument("--scheduler")
    invented.add_argument("--units", type=int, default=40)
    invented.add_argument("--seconds", type=float, default=0.2)
    given = parser.parse_args()
    if given.command == "costs":
        measure_costs(given.folder, given.every)
    elif given.command == "kills":
        if "scheduler" in given.what and not given.dask:
            parser.error("there is no scheduler to kill without --dask")
        sys.exit(0 if kills(given.what, given.each, given.units, given.seconds, given.seed, 2 * given.dask) else 1)
    elif given.command == "efficiency":
        efficiency(given.units, given.seconds)
    elif given.command == "memory":
        memory(given.units)
    else:
        _invented(given.folder, given.scheduler, given.units, given.seconds)


def _invented(folder: Path, scheduler: str | None, units: int, seconds: float) -> None:
    """The client that is killed: it tells what a person can mend as `scanwright` does."""
    try:
        run_invented(folder, scheduler, units, seconds)
    except ScanwrightError as error:
        sys.exit(f"study: {error}")


if __name__ == "__main__":
    main()
