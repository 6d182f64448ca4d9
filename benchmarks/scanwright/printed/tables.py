"""Tables of the pages that come from builds: written between the marks `<!-- table: NAME -->` and `<!-- end -->`.

    uv run python -m benchmarks.scanwright.printed.tables [OUT]

Builds the tasks of the table that OUT (out/ by default) does not have, runs `compare` of `ground_ahead`, and rewrites
the tables of docs/choose-hardware.md and docs/compared.md.
"""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
import sys
from pathlib import Path

from scanwright.cad.assembly.print_settings import hours_in_words, print_hours
from scanwright.design.catalogue.products import Printer
from scanwright.design.task.task import load_task

ROOT = Path(__file__).parents[3]
TASKS = ("low_cost", "indoor_urg", "quadruped_ld19", "capsule_ring", "ceiling", "ground_ahead")
"""Scanners of the hardware table; those that are not shipped are written by `NEW`."""
NEW = {
    "quadruped_ld19": "--lidar LD19 --servo XL430-W250 --height-m 0.45 --see ground:0.5:5 --robot box:0.7:0.35:0.3 "
    "--ahead-m 0.25"
}
HAND_TOOLS = (
    "hexagon keys",
    "multimeter",
    "torque screwdriver",
    "caliper",
)  # what every build needs: not worth a column
RANGE_M = 5.0


def main() -> None:
    """Build, compare, and write both tables."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "out"
    for task in TASKS:
        if not (out / task / "bom.csv").exists():
            subprocess.run(["scanwright", "build", _task_file(task, out), "--out", out, "--quiet"], check=False)
    write_table(ROOT / "docs/choose-hardware.md", "hardware", hardware_table(out))
    compared = out / "compare/ground_ahead/compare.csv"
    if not compared.exists():
        subprocess.run(["scanwright", "compare", "ground_ahead", "--out", out / "compare"], check=True)
    write_table(ROOT / "docs/compared.md", "compare", compare_table(compared))


def _task_file(task: str, out: Path) -> str | Path:
    """Return the name of a shipped task, or the file of one that `new` writes."""
    if task not in NEW:
        return task
    file = out / f"{task}.toml"
    if not file.exists():
        subprocess.run(["scanwright", "new", task, *NEW[task].split(), "-o", file], check=True)
    return file


def write_table(page: Path, name: str, table: str) -> None:
    """Replace what lies between the marks of a table in a page."""
    text, count = re.subn(
        rf"(<!-- table: {name} -->\n).*?(?=<!-- end -->)",
        lambda mark: f"{mark[1]}\n{table}\n\n",
        page.read_text(),
        flags=re.DOTALL,
    )
    if count != 1:
        raise SystemExit(f"{page}: {count} tables named {name} (exactly 1 allowed)")
    page.write_text(text)


def hardware_table(out: Path) -> str:
    """Return one row for each scanner that `out` has a build of, as a table in Markdown."""
    rows = [_hardware_row(out / task) for task in TASKS if (out / task / "bom.csv").exists()]
    head = [
        "task",
        "lidar, servo, ring",
        "motion",
        "printed",
        "other made parts",
        "special tools",
        "USD, with tools",
        "noise at 5 m",
        "bend at 5 m",
        "failed checks",
    ]
    return _markdown(head, rows)


def _hardware_row(folder: Path) -> list[str]:
    with (folder / "bom.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    loaded = load_task(folder / "task.toml")
    bought = {row["part"]: row["number"] for row in rows if row["kind"] == "bought"}
    printed = [row for row in rows if row["kind"] == "printed"]
    mass_g = sum(float(row["mass_g"] or 0) * float(row["quantity"] or 1) for row in printed)
    made = [f"{row['part']} ({row['kind']})" for row in rows if row["kind"] in ("turned", "sawn")]
    tools = [row["part"] for row in rows if row["kind"] == "tool" and not row["part"].startswith(HAND_TOOLS)]
    (total,) = (row for row in rows if row["kind"] == "total")
    checks = json.loads((folder / "checks.json").read_text(encoding="utf-8"))["checks"]
    (turning,) = (check["value"] for check in checks if check["kind"] == "deflection_turning")
    printer = loaded.products.get(loaded.task.printer, Printer)
    beyond = loaded.lidar.range_max_mm < 1000 * RANGE_M
    devices = [bought.get(kind, "none") for kind in ("lidar", "servo", "slip ring")]
    return [
        f"`{folder.name}`",
        ", ".join(devices),
        f"{loaded.task.motion.mode}, {loaded.task.motion.duration_s:g} s",
        f"{len(printed)} parts, {mass_g:.0f} g, {hours_in_words(print_hours(mass_g, printer))}",
        ", ".join(made) or "none",
        ", ".join(tools) or "none",
        f"{total['low_usd']} to {total['high_usd']}",
        "out of range" if beyond else f"{float(loaded.lidar.sigma_mm(1000 * RANGE_M)):.0f} mm",
        f"{1000 * RANGE_M * math.radians(turning):.1f} mm",
        str(sum(check["severity"] == "error" for check in checks)),
    ]


def compare_table(path: Path) -> str:
    """Return the rows of a `compare.csv` that a reader chooses by, as a table in Markdown."""
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    shown = ("name", "time_s", "layers", "points_per_s", "beams_per_ball", "blind_weight", "cost_usd")
    missing = [name for name in shown if name not in rows[0]]
    if missing:
        raise SystemExit(f"{path}: no column {missing[0]} (columns: {', '.join(rows[0])})")
    head = ["scanner", "time [s]", "layers", "points/s", "beams", "region never seen", "USD"]
    return _markdown(head, [_compare_row([row[name] for name in shown]) for row in rows])


def _compare_row(values: list[str]) -> list[str]:
    name, time_s, layers, points, beams, blind, price = values
    share = f"{float(blind):.1%}" if blind else "?"
    return [name, f"{float(time_s):g}", layers, _figure(points), _figure(beams), share, _figure(price)]


def _figure(text: str) -> str:
    return f"{float(text):,.3g}" if text and float(text) < 1000 else f"{float(text):,.0f}" if text else "?"


def _markdown(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    main()
