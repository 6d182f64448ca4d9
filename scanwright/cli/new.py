"""The command that begins: five questions, or their flags, and a task file."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from design.errors import TaskError, suggest
from scanwright.cli.console import hint, show
from scanwright.cli.help import Commands

app = Commands("Design")


@app.command()
def new(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Of the task and its build folder.")] = None,
    lidar: Annotated[str | None, typer.Option(metavar="NAME", help="Which lidar; `scanwright catalogue`.")] = None,
    servo: Annotated[str | None, typer.Option(metavar="NAME", help="Which servo turns it.")] = None,
    height_m: Annotated[
        float | None, typer.Option(metavar="M", help="The scanner's optical centre over the ground.")
    ] = None,
    see: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHAT",
            help="What it must see, once for each: ground:FROM:TO:WIDTH ceiling:HEIGHT wall:DISTANCE:WIDTH "
            "around:UP:DOWN all thing:SIZE:DISTANCE. Metres (around: degrees); numbers may be left out.",
        ),
    ] = None,
    scan_s: Annotated[float | None, typer.Option(metavar="S", help="Time of one full scan.")] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="BOX|FILE", help="What hides the view: box:LENGTH:WIDTH:HEIGHT, a mesh, or none."),
    ] = None,
    ahead_m: Annotated[
        float, typer.Option(metavar="M", help="The scanner ahead of the middle of the box, or of the mesh's origin.")
    ] = 0.0,
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE.toml", help="Default: NAME.toml.")] = None,
) -> None:
    """Ask five questions in metres, and write a commented task file; every question has a flag.

    On a terminal what no flag answers is asked; elsewhere lidar, servo, height and what to see are needed.
    """
    from design.catalogue.catalogue import load_catalogue
    from scanwright.pipeline.new_task import Answers, task_text, write_task_file

    products = load_catalogue()
    asks = sys.stdin.isatty() and sys.stdout.isatty()
    if asks:
        lidar, servo, height_m, robot, see, scan_s = _asked(products, lidar, servo, height_m, robot, see, scan_s)
    elif lidar is None or servo is None or height_m is None or not see:
        flags = {"--lidar": lidar, "--servo": servo, "--height-m": height_m, "--see": see}
        needed = ", ".join(flag for flag, given in flags.items() if not given)
        raise TaskError(f"nobody is there to be asked: give {needed}")
    answers = Answers(
        name=name or (out.stem if out else "my_scanner"),
        lidar=str(lidar),
        servo=str(servo),
        height_m=float(height_m or 0.0),
        see=tuple(see or ()),
        scan_s=10.0 if scan_s is None else scan_s,
        robot=robot or "none",
        ahead_m=ahead_m,
    )
    path = out or Path(f"{answers.name}.toml")
    warnings = write_task_file(path, task_text(answers, products, _command(answers, path), path))
    show([*(f"warning: {warning}" for warning in warnings), f"wrote {path}"])
    hint(f"next: `scanwright build {path}` makes it; `scanwright optimise {path}` only finds its angles")


def _asked(
    products: Any,
    lidar: str | None,
    servo: str | None,
    height_m: float | None,
    robot: str | None,
    see: list[str] | None,
    scan_s: float | None,
) -> tuple[str, str, float, str, list[str], float]:
    """The five questions; those that flags have answered are not asked."""
    from design.catalogue.table import chosen, table_lines

    if lidar is None:
        show(table_lines(chosen(products, kind="lidar"))[:-2])
        lidar = _until_known("1. Which lidar?", "UST-10LX", [p.name for p in chosen(products, kind="lidar")])
    if servo is None:
        show(table_lines(chosen(products, kind="servo"))[:-2])
        servo = _until_known("2. Which servo?", "XM430-W350", [p.name for p in chosen(products, kind="servo")])
    if height_m is None:
        height_m = typer.prompt("3. How high over the ground is the scanner, in metres?", type=float)
    if robot is None:
        robot = typer.prompt(
            "   What of the robot is below it: box:LENGTH:WIDTH:HEIGHT, a mesh file, or", default="none"
        )
    if not see:
        print("4. What must it see? One or more, with or without numbers (metres):")
        print("   ground:0.5:5:4   from 0.5 to 5 m ahead, 4 m wide    ceiling:2.5   2.5 m over the ground")
        print("   wall:3:4         3 m ahead, 4 m wide                around:30:30  all around, 30 deg up and down")
        print("   thing:0.1:3      miss nothing 0.1 m wide, 3 m away  all           every direction")
        see = typer.prompt("  ", default="ground ceiling").split()
    if scan_s is None:
        scan_s = typer.prompt("5. How many seconds may one full scan take?", default=10.0, type=float)
    return lidar, servo, height_m, robot, see, scan_s


def _until_known(question: str, usual: str, known: list[str]) -> str:
    """Ask until a product of the catalogue is named, in whatever case."""
    folded = {name.lower(): name for name in known}
    while True:
        answer = str(typer.prompt(question, default=usual)).strip()
        if answer.lower() in folded:
            return folded[answer.lower()]
        print(f"   '{answer}' is not in the catalogue{suggest(answer, known)}")


def _command(answers: Any, path: Path) -> str:
    """The words that make the same file again, with nobody there to be asked."""
    words = ["scanwright", "new", answers.name, "--lidar", answers.lidar, "--servo", answers.servo]
    words += ["--height-m", f"{answers.height_m:g}", *(word for each in answers.see for word in ("--see", each))]
    words += ["--scan-s", f"{answers.scan_s:g}"]
    if answers.robot != "none":
        words += ["--robot", answers.robot, "--ahead-m", f"{answers.ahead_m:g}"]
    return shlex.join([*words, "-o", str(path)])
