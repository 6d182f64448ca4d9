"""Commands that make things: build, check, report, and studies of many scanners."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Argument, Option

from scanwright.cad.checks.checks_json import entries_of, failure_lines
from scanwright.cad.kernel import require_kernel
from scanwright.cli.arguments import AsJson, BuildFolder, Out, TaskFile
from scanwright.cli.console import (
    ConsoleProgress,
    Verbosity,
    hint,
    print_error,
    print_note,
    show,
    show_json,
    show_result,
    verbosity,
)
from scanwright.cli.help import Commands
from scanwright.cli.results.of_commands import (
    Built,
    Checked,
    CheckEntry,
    MeasuredModel,
    Rebuilt,
    Studied,
    WrittenFiles,
    read_rows,
)
from scanwright.design.errors import notes_of, require
from scanwright.design.findings import Finding, Severity, errors_in, sentence

app = Commands("Parts")


@app.command(example="build ground_ahead", no="a check of the parts fails, or --check finds a difference")
def build(
    task: TaskFile,
    out: Out = Path("out"),
    check: Annotated[bool, Option("--check", help="Rebuild the folder TASK elsewhere and compare.")] = False,
    as_json: AsJson = False,
) -> None:
    """Generate parts, drawings, parts list and report.

    Writes everything into DIR/<task>/; does nothing if the build is current.
    """
    if check:
        from scanwright.pipeline.build import difference_when_rebuilt
        from scanwright.pipeline.manifest import listed_files

        difference = difference_when_rebuilt(task, ConsoleProgress())
        line = f"{task}: {difference or f'built again, all {len(listed_files(task))} files are the same'}"
        show_result(lambda: [line], Rebuilt(str(task), difference), as_json)
        raise typer.Exit(0 if difference is None else 1)
    from scanwright import api

    try:
        built = api.build(task, out, progress=ConsoleProgress())
    except KeyboardInterrupt as stop:
        print_note("; ".join(("stopped", *notes_of(stop))))
        raise typer.Exit(130) from None
    _print_failed_checks(built.checks)
    record = Built(
        built.folder,
        built.files,
        built.warnings,
        [CheckEntry(**entry) for entry in entries_of(built.checks)],
    )
    show_result(lambda: built.lines(in_full=verbosity() is Verbosity.VERBOSE), record, as_json)
    report = built.folder / "report.html"
    if built.failed:
        hint(f"next: change {task} as the failed checks state, and build again; {report} shows them")
        raise typer.Exit(1)
    hint(f"next: open {report}: it lists what to do, in order")


@app.command(example="report out/ground_ahead")
def report(out: BuildFolder, as_json: AsJson = False) -> None:
    """Regenerate report.html of a build."""
    require("cad", "report needs jinja2", "jinja2")
    from scanwright.pipeline.records import write_report

    file = write_report(out)
    result = WrittenFiles(file.parent, [file.name], [f"wrote {file}"])
    show_result(lambda: result.lines, result, as_json)


@app.command(example="check out/ground_ahead", no="a check fails")
def check(out: BuildFolder, as_json: AsJson = False) -> None:
    """Check the parts of a build (fit, loads, printing).

    Prints the failed checks and the warnings; with -v, all checks.
    """
    from scanwright import api
    from scanwright.pipeline.build import finding_lines

    checks = api.check(out, progress=ConsoleProgress())
    loaded = api.load_task(out / "task.toml")
    _print_failed_checks(checks)
    lines = [_tally(Counter(each.severity for each in checks))]
    if verbosity() is Verbosity.VERBOSE:
        lines += [f"{each.severity:7} {sentence(each)}" for each in checks if each.severity != "error"]
    else:
        warnings = [each for each in checks if each.severity == "warning" and each.code != "unverified"]  # only counted
        lines += finding_lines(warnings, checks, in_full=False)
    show_result(
        lambda: lines, Checked(loaded.task.name, [CheckEntry(**entry) for entry in entries_of(checks)]), as_json
    )
    raise typer.Exit(1 if errors_in(checks) else 0)


Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


@app.command(example="measure lidar.step --kind lidar --out my_lidar.toml")
def measure(
    model: Annotated[Path, Argument(metavar="FILE", help="Maker's model of the device: STEP or STL.")],
    kind: Annotated[Literal["lidar", "servo"], Option(metavar="KIND", help="lidar or servo.")] = "lidar",
    up: Annotated[Axis, Option(metavar="AXIS", help="Axis of the model up from the base, or out of the horn.")] = "+z",
    front: Annotated[Axis, Option(metavar="AXIS", help="Axis of the model that is the device's +x.")] = "+x",
    unit: Annotated[Literal["mm", "cm", "m", "inch"] | None, Option(help="Unit of an STL file [default: mm].")] = None,
    out: Annotated[Path | None, Option(metavar="FILE.toml", help="Proposal [default: name of the model].")] = None,
    as_json: AsJson = False,
) -> None:
    """Propose a product file from a maker's model.

    Writes holes, body, window and horn, all marked unverified, and a picture of the same name.
    """
    require_kernel("measure")
    from scanwright.cad.measure.files import measure_files

    out = out or Path(model.with_suffix(".toml").name)
    measured = measure_files(model, out, kind, up=up, front=front, unit=unit, progress=ConsoleProgress())
    proposal = measured.proposal
    record = MeasuredModel(proposal.values, proposal.notes, measured.toml, measured.picture)
    show_result(measured.lines, record, as_json)
    hint(f"next: compare {out} with the device and {measured.picture}, and add what the data sheet states")


@app.command(example="study fleet --plan")
def study(
    study: Annotated[Path, Argument(metavar="STUDY", help="Study file, or name of a shipped study.")],
    scheduler: Annotated[str | None, Option(metavar="tcp://HOST:PORT", help="Use a running Dask cluster.")] = None,
    out: Annotated[Path | None, Option(metavar="DIR", help="Tables and winners [default: out/STUDY].")] = None,
    results: Annotated[Path | None, Option(metavar="DIR", help="Cache of results [default: OUT/results].")] = None,
    processes: Annotated[int | None, Option(min=1, metavar="N", help="Workers [default: one per core].")] = None,
    plan: Annotated[bool, Option("--plan", help="Print the estimated cost and exit.")] = False,
    as_json: AsJson = False,
) -> None:
    """Optimise and build many scanners, rank the results.

    Combines tasks with products, evaluates every candidate with its parts, and builds the winners. The same command
    resumes an interrupted study.
    """
    from scanwright.study.study import load_study

    folder = out or Path("out") / load_study(study).study.name
    if plan:
        from scanwright.study.plan import plan_study

        planned = Studied(folder, True, plan_study(study, out, results, ConsoleProgress()))
        show_result(lambda: planned.lines, planned, as_json)
        return
    from scanwright.study.run import run_study

    try:
        lines = run_study(study, out, results, scheduler, processes, ConsoleProgress())
        if as_json:
            show_json(Studied(folder, False, list(lines), read_rows(folder / "study.csv")))
        else:
            show(lines)
    except KeyboardInterrupt:
        print_note("stopped; run the same command to continue")
        raise typer.Exit(130) from None


def _print_failed_checks(checks: Sequence[Finding]) -> None:
    """Print the failed checks on standard error, before any result."""
    for line in failure_lines(checks):
        print_error(line)


def _tally(counts: Counter[Severity]) -> str:
    """Return how many checks have each severity, as in the report."""
    named: tuple[Severity, ...] = ("error", "warning", "note")
    words = [f"{counts[severity]} {severity}{'' if counts[severity] == 1 else 's'}" for severity in named]
    return ", ".join([*words, f"{counts['ok']} passed"])
