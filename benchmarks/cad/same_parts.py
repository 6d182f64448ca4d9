"""Whether a change of the code leaves the parts and checks of some scanners as they were.

    python -m benchmarks.cad.same_parts choose SCANNERS.json [RANDOM]
    python -m benchmarks.cad.same_parts build SCANNERS.json RESULT.json [EARLIER.json] [--parts] [NAME...]

`choose` searches each shipped task once, adds random scanners that can be laid out, and writes them. `build` makes
the parts of each scanner, or of those whose names are given, and writes the SHA-256 of every file of the build (STEP,
STL, drawings, print files, lists) and every check; with `--parts` no drawings, print files and lists. If an earlier
result is given, it prints what differs: parts and checks fail, other files are listed.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.progress import no_progress
from scanwright.design.scanner import Modules, Scanner, scanner_of

SHIPPED = Path(__file__).parents[2] / "design/task/shipped"
SEED = 36
PARTS = (".step", ".stl")
Result = dict[str, dict[str, Any]]


def choose(file: Path, count: int) -> None:
    """Write the scanners: shipped tasks as a build chooses them, and random ones."""
    from scanwright.design.search.optimum import angle_set, find_optimum
    from scanwright.design.task.task import load_task
    from scanwright.pipeline.build import setting_built

    scanners: dict[str, Any] = {}
    for path in sorted(SHIPPED.glob("*.toml")):
        optimum = find_optimum(load_task(path), no_progress)
        angles = angle_set(optimum.loaded, setting_built(optimum).family)
        scanners[path.stem] = _record(optimum.loaded.scanner(angles))
    scanners |= {f"random_{i}": _record(one) for i, one in zip(range(count), _random(load_catalogue()), strict=False)}
    file.write_text(json.dumps(scanners, indent=1) + "\n", encoding="utf-8")


def build(scanners: Path, result: Path, earlier: Path | None, names: list[str], parts_only: bool) -> int:
    """Build them, write the result, and return 1 if parts or checks differ from an earlier result."""
    catalogue, built = load_catalogue(), Result()
    before: Result = {} if earlier is None else json.loads(earlier.read_text(encoding="utf-8"))
    differ = False
    for name, record in json.loads(scanners.read_text(encoding="utf-8")).items():
        if names and name not in names:
            continue
        built[name] = _built(_scanner(record, catalogue), parts_only)
        result.write_text(json.dumps(built, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        faults = ["not in the earlier result"]
        if name in before:
            faults = [
                fault for fault in _differences(before[name], built[name]) if not (parts_only and "missing" in fault)
            ]
        differ |= any(fault.startswith(("part", "check", "error")) for fault in faults)
        print(f"{name}: {len(built[name]['files'])} files, {len(built[name]['checks'])} checks", flush=True)
        for fault in faults if before else ():
            print(f"  {fault}", flush=True)
    return int(differ)


def _built(scanner: Scanner, parts_only: bool) -> dict[str, Any]:
    from scanwright.cad.assembly.make import make_parts
    from scanwright.cad.checks.run import check_files
    from scanwright.cad.drawings.files import drawing_files
    from scanwright.cad.files.part_files import build_parts, write_files
    from scanwright.cad.files.workshop_files import export_scanner

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        try:
            made = build_parts(scanner, make_parts(scanner), folder, no_progress)
        except BuildError as error:
            return {"error": str(error), "files": {}, "checks": []}
        checks = check_files(made.assembly, no_progress)
        if not parts_only:
            export_scanner(scanner, made, folder, no_progress)
            write_files(folder, drawing_files(made.assembly, made.masses_g()))
        write_files(folder, checks)
        files = {
            str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
    return {
        "files": files,
        "checks": json.loads(checks["checks.json"])["checks"],
        "findings": [asdict(finding) for finding in made.findings],
        "left_out": [asdict(part) for part in made.left_out],
    }


def _differences(before: dict[str, Any], after: dict[str, Any]) -> Iterator[str]:
    if before.get("error") != after.get("error"):
        yield f"error: {before.get('error')} -> {after.get('error')}"
    old, new = before["files"], after["files"]
    for name in sorted(old.keys() | new.keys()):
        if old.get(name) != new.get(name):
            kind = "part" if name.endswith(PARTS) else "file"
            yield f"{kind} {name}: {'missing' if name not in new else 'new' if name not in old else 'differs'}"
    values = [
        [(check["kind"], check["severity"], check["value"], check["limit"]) for check in side["checks"]]
        for side in (before, after)
    ]
    for one, other in zip(*values, strict=False):
        if one != other:
            yield f"check: {one} -> {other}"
    if len(values[0]) != len(values[1]):
        yield f"check: {len(values[0])} -> {len(values[1])} of them"
    for key in ("findings", "left_out"):
        if before.get(key) != after.get(key):
            yield f"{key}: {before.get(key)} -> {after.get(key)}"


def _random(catalogue: Catalogue) -> Iterator[Scanner]:
    """Products, angles and modules at random, without end; those that cannot be laid out are passed over."""
    draw = np.random.default_rng(SEED)
    kinds = [[one.name for one in catalogue if isinstance(one, kind)] for kind in (Lidar, Servo, SlipRing, Printer)]
    while True:
        lidar, servo, ring, printer = (str(draw.choice(names)) for names in kinds)
        alpha_rot, beta_rot, alpha, beta = draw.uniform((-180, -90, -90, -90), (180, 90, 90, 90)).round(2).tolist()
        if draw.random() < 0.2:
            alpha_rot = beta_rot = 0.0
        sweeps, foot = draw.random() < 0.25, draw.random() < 0.2
        angles = AngleSet(
            task="random",
            angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
            sensor=lidar,
            servo=servo,
            slip_ring=None if sweeps else ring,
            motion={"mode": "sweep", "limits_deg": (-90, 90), "period_s": 20.0} if sweeps else None,
        )
        scanner = scanner_of(angles, printer, catalogue, modules=Modules(tripod_foot=foot))
        try:
            laid_out(scanner)
        except BuildError:
            continue
        yield scanner


def _record(scanner: Scanner) -> dict[str, Any]:
    return {
        "angles": json.loads(scanner.angles.to_json()),
        "printer": scanner.printer.name,
        "modules": scanner.modules.model_dump(),
    }


def _scanner(record: dict[str, Any], catalogue: Catalogue) -> Scanner:
    angles = AngleSet.model_validate(record["angles"])
    return scanner_of(angles, record["printer"], catalogue, modules=Modules(**record["modules"]))


def main(arguments: list[str]) -> int:
    """Choose or build."""
    if arguments[:1] == ["choose"]:
        choose(Path(arguments[1]), int(arguments[2]) if len(arguments) > 2 else 30)
        return 0
    scanners, result, *rest = arguments[1:]
    files = [Path(one) for one in rest if one.endswith(".json")]
    names = [one for one in rest if not one.endswith(".json") and one != "--parts"]
    return build(Path(scanners), Path(result), files[0] if files else None, names, "--parts" in rest)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
