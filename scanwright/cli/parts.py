"""Commands that make things: build, check, report, and studies of many scanners."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scanwright.cli.console import (
    AsJson,
    BuildFolder,
    ConsoleProgress,
    TaskFile,
    Verbosity,
    hint,
    print_error,
    print_note,
    show,
    show_json,
    verbosity,
    warn,
)
from scanwright.cli.help import Commands
from scanwright.design.errors import notes_of, require

if TYPE_CHECKING:
    from scanwright.cad.checks.check import Check, Severity

app = Commands("Parts")


@app.command()
def build(
    task: TaskFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one build folder per task.")] = Path(
        "out"
    ),
    check: Annotated[
        bool, typer.Option("--check", help="TASK is a build folder: build it again elsewhere, compare every file.")
    ] = False,
) -> None:
    """Make everything of a task: angles, parts, drawings, pictures, into DIR/<task>/. Exit 1 if a check fails."""
    if check:
        from scanwright.pipeline.build import difference_when_rebuilt
        from scanwright.pipeline.manifest import listed_files

        difference = difference_when_rebuilt(task, ConsoleProgress())
        print(f"{task}: {difference or f'built again, all {len(listed_files(task))} files are the same'}")
        raise typer.Exit(0 if difference is None else 1)
    from scanwright import api

    try:
        built = api.build(task, out, progress=ConsoleProgress())
    except KeyboardInterrupt as stop:
        print_note("; ".join(("stopped", *notes_of(stop))))
        raise typer.Exit(130) from None
    _print_failed_checks(built.checks)
    show(built.lines(in_full=verbosity() is Verbosity.VERBOSE))
    warn(built.misfits)
    report = built.folder / "report.html"
    if built.failed:
        hint(f"next: read the failed checks in {report}, and change the task")
        raise typer.Exit(1)
    coupon = f"then print {built.folder / 'print/fit_coupon.3mf'} and try it"
    hint(f"next: open {report}; {'print no part yet, for the reasons above' if built.misfits else coupon}")


@app.command()
def report(out: BuildFolder) -> None:
    """Write report.html of a build folder from the files in it: the answer, 3D view, checks, parts, steps, drawings."""
    require("cad", "report needs jinja2", "jinja2")
    from scanwright.pipeline.records import write_report

    print(f"wrote {write_report(out)}")


@app.command()
def check(out: BuildFolder, as_json: AsJson = False) -> None:
    """Check the parts of a build folder: room, beams, loads, print. Exit 1 if one fails."""
    from scanwright import api

    checks = api.check(out, progress=ConsoleProgress())
    _print_failed_checks(checks)
    warn(api.load_task(out / "task.toml").misfits())
    if as_json:
        show_json({"task": api.load_task(out / "task.toml").task.name, "checks": [asdict(entry) for entry in checks]})
    else:
        show(f"{entry.severity:7} {entry.message}" for entry in checks)
        print(_tally(Counter(entry.severity for entry in checks)))
    raise typer.Exit(1 if any(entry.severity == "error" for entry in checks) else 0)


@app.command()
def study(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file, or the name of a shipped study.")],
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="A running Dask scheduler; else this computer works.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of tables and winners; default: out/STUDY.")
    ] = None,
    results: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results, shared with the workers or not; default: OUT/results.")
    ] = None,
    processes: Annotated[int | None, typer.Option(min=1, help="Of this computer; default: one for each core.")] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Say what it would cost, and stop.")] = False,
) -> None:
    """Cross tasks with products, judge every candidate with its parts, and build the winners of the trade-off."""
    if plan:
        from scanwright.study.plan import plan_study

        show(plan_study(study, out, results, ConsoleProgress()))
        return
    from scanwright.study.run import run_study

    try:
        show(run_study(study, out, results, scheduler, processes, ConsoleProgress()))
    except KeyboardInterrupt:
        print_note("stopped; run the same command to continue")
        raise typer.Exit(130) from None


def _print_failed_checks(checks: Sequence[Check]) -> None:
    """Print the failed checks on standard error, before any result."""
    from scanwright.cad.checks.check import failure_lines

    for line in failure_lines(checks):
        print_error(line)


def _tally(found: Counter[Severity]) -> str:
    """How many checks came to what, as the report says it."""
    named: tuple[Severity, ...] = ("error", "warning", "note")
    counts = [f"{found[severity]} {severity}{'' if found[severity] == 1 else 's'}" for severity in named]
    return ", ".join([*counts, f"{found['pass']} passed"])
