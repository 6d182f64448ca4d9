"""The command `new`: a task file from options or questions."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer import Argument, Option

from scanwright.cli.arguments import AsJson
from scanwright.cli.console import hint, show, show_result, warn
from scanwright.cli.help import Commands
from scanwright.cli.results.of_commands import Created
from scanwright.design.errors import ScanwrightError, TaskError, suggest

app = Commands("Design")
T = TypeVar("T")
REQUIRED = ("lidar", "servo", "height_m", "see")
DEFAULTS: dict[str, Any] = {"name": "new", "height_m": 0.5, "see": ("all",), "scan_s": 10.0}
"""Values of questions that are not yet answered, to check the others."""


@app.command(example="new dog --lidar UST-10LX --servo XM430-W350 --height-m 0.45 --see ground:0.5:5 --see ceiling")
def new(
    name: Annotated[str | None, Argument(metavar="NAME", help="Name of the task and its build folder.")] = None,
    lidar: Annotated[str | None, Option(metavar="NAME", help="Lidar, see `scanwright catalogue`.")] = None,
    servo: Annotated[str | None, Option(metavar="NAME", help="Servo that turns it.")] = None,
    height_m: Annotated[float | None, Option(metavar="M", help="Height of the optical centre.")] = None,
    see: Annotated[
        list[str] | None,
        Option(
            metavar="REGION",
            help="Region to see, repeatable: ground:FROM:TO:WIDTH ceiling:HEIGHT "
            "wall:DISTANCE:WIDTH:HEADING:TOP around:UP:DOWN all thing:SIZE:DISTANCE. Metres; around and "
            "HEADING: degrees; trailing numbers are optional.",
        ),
    ] = None,
    scan_s: Annotated[
        float | None, Option(metavar="S", help="Time of one full scan [default: lines at most 1 deg apart].")
    ] = None,
    robot: Annotated[
        str | None,
        Option(metavar="BOX|FILE", help="Robot: box:LENGTH:WIDTH:HEIGHT, a mesh, or none."),
    ] = None,
    ahead_m: Annotated[
        float | None,
        Option(metavar="M", help="Scanner ahead of the box middle or mesh origin [default: 0]."),
    ] = None,
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FILE.toml", help="Output file [default: NAME.toml].")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Create a task file by answering a few questions.

    On a terminal, `new` asks for what the options do not give. Otherwise --lidar, --servo, --height-m and --see are
    required.
    """
    from scanwright.design.catalogue.catalogue import load_catalogue
    from scanwright.design.catalogue.lidar import Lidar
    from scanwright.design.catalogue.servo import Servo

    products = load_catalogue()
    if lidar is not None:
        products.get(lidar, Lidar)
    if servo is not None:
        products.get(servo, Servo)
    options = {"lidar": lidar, "servo": servo, "height_m": height_m, "see": tuple(see or ())}
    options |= {"robot": robot, "ahead_m": ahead_m, "scan_s": scan_s}
    known: dict[str, Any] = {key: value for key, value in options.items() if value not in (None, "", ())}
    if sys.stdin.isatty() and sys.stdout.isatty() and not as_json:
        _ask(products, known)
    elif missing := [f"--{key.replace('_', '-')}" for key in REQUIRED if key not in known]:
        raise TaskError(f"missing options {', '.join(missing)} (not running in a terminal)")
    from scanwright.pipeline.new_task import Answers, task_text, usual_scan_s, write_task_file

    usual = {"scan_s": usual_scan_s(products.get(known["lidar"], Lidar))}
    answers = Answers(name=name or (out.stem if out else "my_scanner"), **(usual | known))
    path = out or Path(f"{answers.name}.toml")
    warnings = write_task_file(path, task_text(answers, products, _command(answers, path), path))
    warn(warnings)
    show_result(lambda: [f"wrote {path}"], Created(path, answers.name, warnings), as_json)
    hint(f"next: `scanwright build {path}` (or `scanwright optimise {path}` for the angles only)")


def _ask(products: Any, known: dict[str, Any]) -> None:
    """Ask the questions whose answers are not `known`, each until the answer is valid, and add the answers."""
    from scanwright.design.catalogue.lidar import Lidar
    from scanwright.design.catalogue.table import MARK, chosen, table_lines
    from scanwright.pipeline.new_task import Answers, check_answers, usual_scan_s

    def product(kind: Any, question: str, usual: str, fits: Callable[[str], object]) -> str:
        of_kind = chosen(products, kind=kind)
        show(table_lines(of_kind, in_full=False)[:-2])
        print(f"{MARK}: unverified number; -: unknown")
        return _until(question, usual, lambda answer: _named(answer, [p.name for p in of_kind]), fits)

    def checked(**answer: Any) -> None:
        check_answers(Answers(**(DEFAULTS | known | answer)), products)

    if "lidar" not in known:
        known["lidar"] = product("lidar", "1. Which lidar?", "UST-10LX", lambda _: None)
    if "servo" not in known:
        known["servo"] = product("servo", "2. Which servo turns it?", "XM430-W350", lambda name: checked(servo=name))
    if "height_m" not in known:
        question = "3. How many metres over the ground is the lidar, usually 0.1 to 0.2 m above the robot's deck?"
        known["height_m"] = _until(question, None, _number, lambda height: checked(height_m=height))
    if "robot" not in known:
        print("4. Which part of the robot blocks the view? box:0.6:0.3:0.3 is its length, width and height in metres;")
        print("   or a file with its mesh (STL, OBJ, PLY), or none")
        known["robot"] = _until("  ", "none", str, lambda what: checked(robot=what))
    if "ahead_m" not in known and known["robot"] != "none":
        print("   How many metres ahead of the middle of the box, or of the origin of the mesh, is the scanner?")
        known["ahead_m"] = _until("  ", "0", _number, lambda ahead: checked(ahead_m=ahead))
    if "see" not in known:
        print("5. What must it see? One or more, separated by spaces. Numbers are optional:")
        print("   ground:0.5:5:4   from 0.5 to 5 m ahead, 4 m wide    ceiling:2.5   2.5 m over the ground")
        print("   wall:3:4:90:2.5  3 m to the left, 4 wide, 2.5 high  around:30:30  all around, 30 deg up and down")
        print("   wall:1:2:0:0.5   obstacles 0.5 m high, 1 m ahead, 2 m wide")
        print("   thing:0.1:3      miss nothing 0.1 m wide, 3 m away  all           every direction")
        known["see"] = _until("  ", "ground ceiling", lambda text: tuple(text.split()), lambda see: checked(see=see))
    if "scan_s" not in known:
        question = "6. How many seconds may one full scan take? Longer is denser"
        usual = f"{usual_scan_s(products.get(known['lidar'], Lidar)):g}"
        known["scan_s"] = _until(question, usual, _number, lambda seconds: checked(scan_s=seconds))


def _until(question: str, usual: str | None, read: Callable[[str], T], fits: Callable[[T], object]) -> T:
    """Ask until `read` and `fits` accept an answer."""
    while True:
        try:
            answer = read(str(typer.prompt(question, default=usual, prompt_suffix=" > ")).strip())
            fits(answer)
        except ScanwrightError as error:
            print(f"   {error}")
        else:
            return answer


def _named(answer: str, known: list[str]) -> str:
    """Return the product of a name in any case, or of a beginning that only one product has."""
    matches = [name for name in known if name.lower() == answer.lower()]
    matches = matches or [name for name in known if name.lower().startswith(answer.lower())]
    if len(matches) != 1:
        more = f": {', '.join(matches)}" if matches else suggest(answer, known)
        raise TaskError(f"'{answer}' is {'more than one' if matches else 'not in the catalogue'}{more}")
    return matches[0]


def _number(answer: str) -> float:
    try:
        return float(answer)
    except ValueError as error:
        raise TaskError(f"'{answer}' is not a number") from error


def _command(answers: Any, path: Path) -> str:
    """Return the command that writes the same file without questions."""
    words = ["scanwright", "new", answers.name, "--lidar", answers.lidar, "--servo", answers.servo]
    words += ["--height-m", f"{answers.height_m:g}", *(word for each in answers.see for word in ("--see", each))]
    words += ["--scan-s", f"{answers.scan_s:g}"]
    if answers.robot != "none":
        words += ["--robot", answers.robot, "--ahead-m", f"{answers.ahead_m:g}"]
    return shlex.join([*words, "-o", str(path)])
