"""Commands about the angles: optimise, evaluate, compare, accuracy; and what a task can name."""

from __future__ import annotations

from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from scanwright.cad.kernel import require_kernel
from scanwright.cli.console import AsJson, ConsoleProgress, TaskFile, TaskOrBuild, hint, show, show_json
from scanwright.cli.help import Commands

app = Commands("Design")


@app.command()
def optimise(
    task: TaskFile,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the lowest J over scan planes and over axes.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Search all mounting angles of a task and print the best ten families of settings."""
    from scanwright import api

    optimum = api.optimise(task, progress=ConsoleProgress())
    if picture is not None:
        from scanwright.design.evaluation.landscape_picture import landscape_picture

        picture = landscape_picture(picture, optimum.search, f"{optimum.asked.task.name}: {optimum.long_title}")
    from scanwright.design.evaluation.metres import on_planes

    planes = on_planes(optimum.loaded, optimum.problem, optimum.search.best[0].angles_rad)
    if as_json:
        warnings = optimum.asked.warnings()
        show_json(optimum.facts() | {"planes": [plane.facts() for plane in planes], "warnings": warnings})
    else:
        scan = (f"one full scan, {plane.words()}" for plane in planes)
        show([*optimum.lines(), *scan, *(f"warning: {warning}" for warning in optimum.asked.warnings())])
        if picture is not None:
            print(f"wrote {picture}")
        hint(f"next: `scanwright build {task}` makes it")


@app.command()
def evaluate(
    task: TaskOrBuild,
    angles: Annotated[
        str | None,
        typer.Option(
            metavar="A_ROT,B_ROT,A_LASER,B_LASER", help="The setting, in degrees; default: that of a build folder."
        ),
    ] = None,
    cloud: Annotated[
        Path | None, typer.Option(metavar="FILE.ply", help="Write the simulated beams as points on the unit sphere.")
    ] = None,
    pole: Annotated[
        str | None,
        typer.Option(metavar="WIDTH_MM,HEIGHT_MM,RANGE_M", help="Tell the chance to hit a thin upright pole."),
    ] = None,
    lever: Annotated[
        str | None,
        typer.Option(metavar="X_MM,Y_MM,RANGE_M", help="Optical centre off the axis by (x, y), as seen at a range."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge one setting of the mounting angles, the closed form beside the paper's ball search."""
    import numpy as np

    from scanwright import api
    from scanwright.api.arguments import as_built_scanner, lever_in, numbers_in, pole_in

    built = as_built_scanner(task)
    if built is None and angles is None:
        raise typer.BadParameter("missing: only a build folder has angles of its own", param_hint="--angles")
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
        from scanwright.firmware_io.clouds.ply import write_points

        beams = result.beam_directions()
        write_points(cloud, beams, [f"task {loaded.task.name}, simulated beams on the unit sphere, frame world"])
    if as_json:
        show_json({"task": loaded.task.name, "angles_deg": angles_deg, **result.facts()})
    else:
        show(result.lines())
        if cloud is not None:
            print(f"wrote {len(beams):,} points to {cloud}")
    if not result.agree:
        raise typer.Exit(1)


@app.command()
def accuracy(
    task: TaskFile,
    stress: Annotated[bool, typer.Option("--stress", help="The table of stiff and extreme cases instead.")] = False,
    choices: Annotated[
        bool, typer.Option("--choices", help="Meshes, integrator of the emulated servo and its angle instead.")
    ] = False,
    search: Annotated[bool, typer.Option("--search", help="What the search spends and gains instead.")] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one folder of reports per task.")] = Path(
        "out/accuracy"
    ),
) -> None:
    """Report error against run time of every way to compute J, at the optimum of a task; of other choices too."""
    from scanwright import api

    if choices:
        require_kernel("accuracy --choices")
    loaded = api.load_task(task)
    folder = out / loaded.task.name
    if choices:
        from scanwright.trials.report import report_choices

        show(report_choices(loaded, folder, ConsoleProgress()))
        return
    from scanwright.design.accuracy.report import report_precision, report_search, report_stress

    if stress:
        from scanwright.firmware_io.emulators.servo_plant import plant_of
        from scanwright.trials.stress import range_rows, servo_rows

        more = (rows for make in (servo_rows(plant_of(loaded.task.servo)), range_rows()) for rows in make)
        told = report_stress(loaded, folder, ConsoleProgress(), more)
        show(told.lines)
        raise typer.Exit(0 if told.passed else 1)
    show((report_search if search else report_precision)(loaded, folder, ConsoleProgress()))


@app.command()
def compare(
    task: TaskOrBuild,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder that holds one folder of comparisons per task.")
    ] = Path("out/compare"),
    as_json: AsJson = False,
) -> None:
    """Compare the optimum with the reference mounts, a cheap scanner and ready-made ones: table, CSV, picture."""
    from scanwright import api
    from scanwright.api.arguments import as_built_scanner
    from scanwright.pipeline.comparison import write_comparison

    built = as_built_scanner(task)
    loaded = api.load_task(task) if built is None else built.loaded
    found = write_comparison(loaded, out / loaded.task.name, ConsoleProgress(), built)
    if as_json:
        gains = [gain.facts() for gain in found.optimum.gains]
        show_json({"task": loaded.task.name, "rows": [asdict(row) for row in found.rows], "gains": gains})
    else:
        show(found.lines())


class Kind(Enum):
    """What a product is."""

    lidar = "lidar"
    servo = "servo"
    slip_ring = "slip_ring"
    bearing = "bearing"
    belt = "belt"
    printer = "printer"
    multibeam = "multibeam"


@app.command()
def catalogue(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show one product with all sources.")] = None,
    kind: Annotated[Kind | None, typer.Option(help="Only products of this kind.")] = None,
    min_range_m: Annotated[
        float | None,
        typer.Option(metavar="M", help="Only lidars that see as far: in practice where known, else as stated."),
    ] = None,
    max_mass_g: Annotated[float | None, typer.Option(metavar="G", help="Only what is as light.")] = None,
    max_price_usd: Annotated[float | None, typer.Option(metavar="USD", help="Only what is as cheap.")] = None,
    as_json: AsJson = False,
) -> None:
    """List the products that a task can name, in tables, or one of them with the source of every value."""
    from scanwright.design.catalogue.catalogue import load_catalogue
    from scanwright.design.catalogue.table import chosen, table_lines

    products = load_catalogue()
    listed = (
        [products.named(name)]
        if name
        else chosen(
            products,
            kind=kind and kind.value,
            min_range_m=min_range_m,
            max_mass_g=max_mass_g,
            max_price_usd=max_price_usd,
        )
    )
    if as_json:
        show_json({"products": [product.facts() for product in listed]})
    else:
        show(listed[0].lines() if name else table_lines(listed))


@app.command()
def schema() -> None:
    """Print the JSON schema of a task file, so that an editor completes and checks it."""
    from scanwright.design.task.task import Task

    show_json(Task.model_json_schema())
