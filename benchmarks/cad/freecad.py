"""Every STEP file of some build folders, read and checked by FreeCAD: `python -m benchmarks.cad.freecad OUT...`.

FreeCAD (Debian: `apt-get install freecad`) says whether a shape is valid, and in its strict check (the one of booleans)
what it would stumble over. A line for each part; the command fails if one is invalid, is not one solid, or has another
volume than the manifest says.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

PROGRAM = "freecadcmd"
SCRIPT = """
import collections, json, os, Part
for file in json.loads(os.environ["SCANWRIGHT_STEP_FILES"]):
    shape = Part.read(file)
    try:
        shape.check(True)
        told = []
    except ValueError as error:
        told = [line.split(": ")[-1] for line in str(error).splitlines() if line.startswith("Error in Face")]
    print("READ", json.dumps([file, shape.isValid(), len(shape.Solids), shape.Volume, collections.Counter(told)]))
"""
WITHIN = 1e-5  # of the volume


@dataclass(frozen=True, slots=True)
class Opened:
    """What FreeCAD made of one file.

    Attributes:
        valid: its shape is.
        solids: in it.
        volume_mm3: of all of them.
        strict: what the strict check found, faces by kind.
    """

    valid: bool
    solids: int
    volume_mm3: float
    strict: dict[str, int]


def opened(files: list[Path]) -> dict[Path, Opened]:
    """Read and check some files, in one run of the program.

    Raises:
        subprocess.CalledProcessError: the program fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "opened.py"
        script.write_text(SCRIPT, encoding="utf-8")
        given = os.environ | {"SCANWRIGHT_STEP_FILES": json.dumps([str(file) for file in files]), "HOME": folder}
        done = subprocess.run([PROGRAM, str(script)], check=True, capture_output=True, text=True, env=given)
    rows = [json.loads(line[5:]) for line in done.stdout.splitlines() if line.startswith("READ ")]
    return {Path(row[0]): Opened(*row[1:]) for row in rows}


def main() -> None:
    """Print one line for each file, and fail if one is not what the manifest says."""
    whole = True
    for folder in map(Path, sys.argv[1:]):
        parts = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["parts"]
        files = {folder / "parts" / f"{part['name']}.step": part["volume_mm3"] for part in parts}
        found = opened(list(files))
        for file, volume in files.items():
            shape = found.get(file, Opened(False, 0, 0.0, {}))
            off = shape.volume_mm3 / volume - 1
            good = shape.valid and shape.solids == 1 and abs(off) < WITHIN
            whole &= good
            strict = ", ".join(f"{count} {kind}" for kind, count in shape.strict.items()) or "nothing"
            print(f"{'ok  ' if good else 'FAIL'} {file}: volume off by {off:.1e}, strict check: {strict}", flush=True)
    sys.exit(0 if whole else 1)


if __name__ == "__main__":
    main()
