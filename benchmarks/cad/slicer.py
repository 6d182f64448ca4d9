"""Every print file of some build folders, read and sliced by PrusaSlicer: `python -m benchmarks.cad.slicer OUT...`.

PrusaSlicer (Debian: `apt-get install prusa-slicer`) says what it had to repair; nothing is what it should say. Times
and filament are of parts printed solid, as the checks take them, at the slicer's own speeds and layers of 0.2 mm.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

PROGRAM = "prusa-slicer"
SOLID = ("--fill-density", "100%", "--fill-pattern", "rectilinear", "--layer-height", "0.2")
SECONDS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0}
REPAIRS = ("edges_fixed", "degenerate_facets", "facets_removed", "facets_reversed", "backwards_edges", "open_edges")


@dataclass(frozen=True, slots=True)
class Sliced:
    """What the slicer made of one print file.

    Attributes:
        closed: its mesh is manifold and nothing was repaired.
        volume_mm3: as the slicer sums it up.
        size_mm: x, y, z.
        height_mm: of the tool path, at the slicer's own defaults with support.
        used_mm3: filament in the tool path.
        time_s: that the slicer expects.
    """

    closed: bool
    volume_mm3: float
    size_mm: tuple[float, float, float]
    height_mm: float
    used_mm3: float
    time_s: float


def sliced(file: Path) -> Sliced:
    """Read and slice one print file.

    Raises:
        subprocess.CalledProcessError: the slicer refuses it.
    """
    told = dict(line.split(" = ") for line in _run("--info", str(file)).splitlines() if " = " in line)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.gcode"
        how = ["--support-material", "--support-material-auto", *SOLID]
        _run("-g", *how, "--output", str(path), str(file))
        code = path.read_text(encoding="utf-8")
    used = next(line for line in code.splitlines() if line.startswith("; filament used [cm3]"))
    time = next(line for line in code.splitlines() if line.startswith("; estimated printing time (normal mode)"))
    x, y, z = (float(told[f"size_{axis}"]) for axis in "xyz")
    return Sliced(
        told["manifold"] == "yes" and not any(word in told for word in REPAIRS),
        float(told["volume"]),
        (x, y, z),
        max(float(line[3:]) for line in code.splitlines() if line.startswith(";Z:")),
        float(used.rsplit("=", 1)[1]) * 1e3,
        sum(float(number) * SECONDS[unit] for number, unit in re.findall(r"(\d+)([dhms])", time.rsplit("=", 1)[1])),
    )


def _run(*words: str) -> str:
    return subprocess.run([PROGRAM, *words], check=True, capture_output=True, text=True).stdout


def main() -> None:
    """Print one line for each file, and fail if one of them was repaired."""
    whole = True
    for file in sorted(file for folder in sys.argv[1:] for file in Path(folder).glob("print/*.3mf")):
        found = sliced(file)
        whole &= found.closed
        mark = "ok  " if found.closed else "FAIL"
        hours, minutes = divmod(round(found.time_s / 60), 60)
        print(
            f"{mark} {file}: {found.volume_mm3 / 1e3:.1f} cm3, {found.height_mm:.1f} mm high, "
            f"{found.used_mm3 / 1e3:.1f} cm3 of filament in {hours} h {minutes:02d} min",
            flush=True,
        )
    sys.exit(0 if whole else 1)


if __name__ == "__main__":
    main()
