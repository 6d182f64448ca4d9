"""The command that begins: five questions, or their flags, and a task file."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from scanwright.cli.console import hint, show, warn
from scanwright.cli.help import Commands
from scanwright.design.errors import ScanwrightError, TaskError, suggest

app = Commands("Design")
T = TypeVar("T")
UNSAID: dict[str, Any] = {"name": "new", "height_m": 0.5, "see": ("all",), "scan_s": 10.0}
"""What stands in for answers that are not given yet, while those before them are checked."""


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
    from scanwright.design.catalogue.catalogue import load_catalogue
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
    warn(
        f"{name}: parts printed for it will not fit the real device: `scanwright catalogue '{name}'` gives the reasons"
        for name in (answers.lidar, answers.servo)
        if products.named(name).misfit()
    )
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
    """The five questions, but for those that flags have answered; an answer that makes no sense is asked for again."""
    from scanwright.design.catalogue.table import MARK, chosen, table_lines
    from scanwright.pipeline.new_task import Answers, check_answers

    def product(kind: Any, question: str, usual: str, fits: Callable[[str], object]) -> str:
        of_kind = chosen(products, kind=kind)
        show(table_lines(of_kind)[:-2])
        print(f"{MARK}: not verified; -: unknown")
        return _until(question, usual, lambda answer: _named(answer, [p.name for p in of_kind]), fits)

    def checked(**answers: Any) -> None:
        known = {"lidar": lidar, "servo": servo, "height_m": height_m, "robot": robot, "see": see, "scan_s": scan_s}
        given = {name: value for name, value in known.items() if value is not None} | answers
        check_answers(Answers(**(UNSAID | given) | {"see": tuple(given.get("see") or UNSAID["see"])}), products)

    if lidar is None:
        lidar = product("lidar", "1. Which lidar?", "UST-10LX", lambda _: None)
    if servo is None:
        servo = product("servo", "2. Which servo turns it?", "XM430-W350", lambda name: checked(servo=name))
    if height_m is None:
        question = "3. How many metres over the ground is the scanner?"
        height_m = _until(question, None, _number, lambda height: checked(height_m=height))
    if robot is None:
        print(
            "   What of the robot is in its way, below it? box:0.6:0.3:0.3 is its length, width and height in metres;"
        )
        print("   or a file with its mesh (STL, OBJ, PLY), or none")
        robot = _until("  ", "none", str, lambda what: checked(robot=what))
    if not see:
        print("4. What must it see? One or more, with spaces between. Numbers may be changed or left out:")
        print("   ground:0.5:5:4   from 0.5 to 5 m ahead, 4 m wide    ceiling:2.5   2.5 m over the ground")
        print("   wall:3:4         3 m ahead, 4 m wide                around:30:30  all around, 30 deg up and down")
        print("   thing:0.1:3      miss nothing 0.1 m wide, 3 m away  all           every direction")
        see = _until("  ", "ground ceiling", str.split, lambda wishes: checked(see=wishes))
    if scan_s is None:
        question = "5. How many seconds may one full scan take? Longer is denser"
        scan_s = _until(question, "10", _number, lambda seconds: checked(scan_s=seconds))
    return lidar, servo, height_m, robot, see, scan_s


def _until(question: str, usual: str | None, read: Callable[[str], T], fits: Callable[[T], object]) -> T:
    """Ask until an answer can be read and fits those before it; what was wrong is said without the name of its flag."""
    while True:
        try:
            answer = read(str(typer.prompt(question, default=usual, prompt_suffix=" > ")).strip())
            fits(answer)
        except ScanwrightError as error:
            said = str(error)
            print(f"   {said.partition(' ')[2] if said.startswith('--') else said}")
        else:
            return answer


def _named(answer: str, known: list[str]) -> str:
    """The product that is meant, in whatever case; the beginning of a name is enough where it is one product's only."""
    found = [name for name in known if name.lower() == answer.lower()]
    found = found or [name for name in known if name.lower().startswith(answer.lower())]
    if len(found) != 1:
        more = f": {', '.join(found)}" if found else suggest(answer, known)
        raise TaskError(f"'{answer}' is {'more than one' if found else 'not in the catalogue'}{more}")
    return found[0]


def _number(answer: str) -> float:
    try:
        return float(answer)
    except ValueError as error:
        raise TaskError(f"'{answer}' is no number") from error


def _command(answers: Any, path: Path) -> str:
    """The words that make the same file again, with nobody there to be asked."""
    words = ["scanwright", "new", answers.name, "--lidar", answers.lidar, "--servo", answers.servo]
    words += ["--height-m", f"{answers.height_m:g}", *(word for each in answers.see for word in ("--see", each))]
    words += ["--scan-s", f"{answers.scan_s:g}"]
    if answers.robot != "none":
        words += ["--robot", answers.robot, "--ahead-m", f"{answers.ahead_m:g}"]
    return shlex.join([*words, "-o", str(path)])
