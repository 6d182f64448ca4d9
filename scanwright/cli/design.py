"""Commands about the angles and the catalogue: optimise, evaluate, compare, accuracy, catalogue, schema."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal, get_args

import typer
from typer import Argument, Option

from scanwright.cad.kernel import require_kernel
from scanwright.cli.arguments import AsJson, TaskFile, TaskOrBuild
from scanwright.cli.console import ConsoleProgress, Verbosity, hint, show, show_json, show_result, verbosity
from scanwright.cli.help import Commands
from scanwright.cli.results.of_commands import Products, WrittenFiles
from scanwright.design.errors import ScanwrightError, TaskError, suggest
from scanwright.design.files.atomic_file import atomic_write

app = Commands("Design")


@app.command(example="optimise ground_ahead", no="J differs from a count of simulated beams")
def optimise(task: TaskFile, as_json: AsJson = False) -> None:
    """Find the best mounting angles for a task.

    Searches all angles within the task's ranges and prints the ten best distinct mounts.
    """
    from scanwright import api

    optimum = api.optimise(task, progress=ConsoleProgress())
    from scanwright.design.evaluation.expected_cloud import expected_cloud

    best = optimum.search.best[0]
    cloud = expected_cloud(optimum.loaded, optimum.problem, best.angles_rad, best.score)
    if as_json:
        from scanwright.cli.results.angles import Optimised

        show_json(Optimised(**optimum.facts(), **asdict(cloud), warnings=optimum.requested.warnings()))
    else:
        show(
            [
                *optimum.lines(verbosity() is Verbosity.VERBOSE),
                *cloud.lines(),
                *(f"warning: {warning}" for warning in optimum.requested.warnings()),
            ]
        )
        hint(f"next: `scanwright build {task}`")


@app.command(example="evaluate ground_ahead --angles=0,90,0,-90", no="the two counts of beams disagree")
def evaluate(
    task: TaskOrBuild,
    angles: Annotated[
        str | None, Option(metavar="A_ROT,B_ROT,A_LASER,B_LASER", help="Mounting angles in degrees.")
    ] = None,
    cloud: Annotated[Path | None, Option(metavar="FILE.ply", help="Simulated beams on the unit sphere.")] = None,
    pole: Annotated[
        str | None, Option(metavar="WIDTH_MM,HEIGHT_MM,RANGE_M", help="Probability of hitting an upright pole.")
    ] = None,
    lever: Annotated[
        str | None, Option(metavar="X_MM,Y_MM,RANGE_M", help="Evaluate with the optical centre off the axis.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Report what given mounting angles can see."""
    import numpy as np

    from scanwright import api
    from scanwright.api.arguments import as_built_scanner, lever_in, numbers_in, pole_in

    built = as_built_scanner(task)
    if built is None and angles is None:
        raise typer.BadParameter("required unless TASK is a build folder", param_hint="--angles")
    loaded = api.load_task(task) if built is None else built.loaded
    form = "A_ROT,B_ROT,A_LASER,B_LASER in degrees, such as 0,90,0,-90"
    result = api.evaluate(
        task,
        None if angles is None else numbers_in(angles, "angles", form),
        pole=None if pole is None else pole_in(pole),
        lever=None if lever is None else lever_in(lever),
        progress=ConsoleProgress(),
    )
    angles_deg = np.degrees(result.angles_rad).round(9).tolist()
    if cloud is not None:
        from scanwright.firmware_io.clouds.cloud import Cloud
        from scanwright.firmware_io.clouds.formats import write_clouds

        beams = result.beam_directions()
        write_clouds(cloud, [Cloud(beams.astype(np.float32))])
    if as_json:
        from scanwright.cli.results.angles import Evaluated

        show_json(Evaluated(task=loaded.task.name, angles_deg=angles_deg, **result.facts()))
    else:
        show(result.lines())
        if cloud is not None:
            print(f"wrote {len(beams):,} points to {cloud}")
    if not result.agree:
        raise typer.Exit(1)


@app.command(example="accuracy ground_ahead")
def accuracy(
    task: TaskFile,
    out: Annotated[Path, Option(metavar="DIR", help="Parent of the folder of reports.")] = Path("out/accuracy"),
    as_json: AsJson = False,
) -> None:
    """Measure the error and run time of the optimiser.

    Tries every method to compute the objective, at the optimum of the task.
    """
    from scanwright import api
    from scanwright.design.accuracy.work_precision import report_precision

    loaded = api.load_task(task)
    folder = out / loaded.task.name
    lines = report_precision(loaded, folder, ConsoleProgress())
    report = WrittenFiles(folder, ["work_precision.csv", "work_precision.png"], lines)
    show_result(lambda: report.lines, report, as_json)


@app.command(example="compare ground_ahead", no="J differs from a count of simulated beams")
def compare(
    task: TaskOrBuild,
    out: Annotated[Path, Option(metavar="DIR", help="Parent of the folder of the comparison.")] = Path("out/compare"),
    as_json: AsJson = False,
) -> None:
    """Compare the optimum with other mounts and 3D lidars.

    Prints a table, and writes it as a CSV file and a picture.
    """
    from scanwright import api
    from scanwright.api.arguments import as_built_scanner
    from scanwright.cli.results.angles import Compared, GainResult
    from scanwright.pipeline.comparison import write_comparison

    built = as_built_scanner(task)
    loaded = api.load_task(task) if built is None else built.loaded
    result = write_comparison(loaded, out / loaded.task.name, ConsoleProgress(), built)
    gains = [GainResult(**gain.facts()) for gain in result.optimum.gains]
    show_result(
        lambda: result.lines(verbosity() is Verbosity.VERBOSE), Compared(loaded.task.name, result.rows, gains), as_json
    )


Kind = Literal["lidar", "servo", "slip_ring", "bearing", "belt", "printer", "multibeam"]


@app.command(example="catalogue --kind lidar --min-range-m 8")
def catalogue(
    name: Annotated[
        str | None, Argument(metavar="NAME", help="Print one product; -v: all values with sources.")
    ] = None,
    kind: Annotated[Kind | None, Option(metavar="KIND", help=f"Only this kind: {', '.join(get_args(Kind))}.")] = None,
    min_range_m: Annotated[float | None, Option(metavar="M", help="Minimum range, practical if known.")] = None,
    max_mass_g: Annotated[float | None, Option(metavar="G", help="Maximum mass in grams.")] = None,
    max_price_usd: Annotated[float | None, Option(metavar="USD", help="Maximum price.")] = None,
    sketch: Annotated[Path | None, Option(metavar="FILE.svg", help="Draw NAME with its dimensions.")] = None,
    as_json: AsJson = False,
) -> None:
    """List lidars, servos, slip rings and other products."""
    if sketch is not None and name is None:
        raise typer.BadParameter("draws one product, with its NAME before the option", param_hint="--sketch")
    from scanwright.design.catalogue.catalogue import file_of, load_catalogue
    from scanwright.design.catalogue.table import chosen, table_lines

    products = load_catalogue()
    listed = (
        [products.named(name)]
        if name
        else chosen(
            products,
            kind=kind,
            min_range_m=min_range_m,
            max_mass_g=max_mass_g,
            max_price_usd=max_price_usd,
        )
    )
    record = Products([product.facts() for product in listed])
    if sketch is not None:
        require_kernel("catalogue --sketch")
        from scanwright.cad.drawings.sketch import sketch_svg

        with atomic_write(sketch, TaskError) as place:
            place.write_bytes(sketch_svg(listed[0]))
    in_full = verbosity() is Verbosity.VERBOSE

    def lines() -> list[str]:
        if name is None:
            return table_lines(listed, in_full)
        values = listed[0].lines(in_full)
        if in_full:
            return [*values, f"file: {file_of(name)}"]
        rest = f"-v prints all {len(listed[0].provenance())} values and their sources"
        return [*table_lines(listed, in_full)[:-2], *values[1:], rest]

    show_result(lines, record, as_json)
    if sketch is not None:
        hint(f"wrote {sketch}")


@app.command(example="schema > task.schema.json")
def schema(
    command: Annotated[str | None, Argument(metavar="COMMAND", help="Print the schema of its --json output.")] = None,
) -> None:
    """Print the JSON schema of a task file.

    Editors complete and check task files by it. With COMMAND, print the schema of what this command prints with --json.
    """
    if command is None:
        from scanwright.design.task.task import Task

        show_json(Task.model_json_schema())
        return
    from scanwright.cli.results.schemas import RESULTS, result_schema

    if command not in RESULTS:
        raise ScanwrightError(f"{command}: no command with --json{suggest(command, RESULTS)}")
    show_json(result_schema(command))
