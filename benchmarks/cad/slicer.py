"""Every print file of some build folders, read and sliced by PrusaSlicer: `python -m benchmarks.cad.slicer OUT...`.

PrusaSlicer (Debian: `apt-get install prusa-slicer`) says what it had to repair; nothing is what it should say. How the
parts are printed is in the files (`cad.assembly.print_settings`); speeds are the slicer's own, up to what a plain hot
end melts. The last line names the longest part.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

PROGRAM = "prusa-slicer"
MELTED_MM3_S = 11  # of PLA by a hot end with a nozzle of 0.4 mm and a plain melt zone, from memory
SECONDS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0}
REPAIRS = ("edges_fixed", "degenerate_facets", "facets_removed", "facets_reversed", "backwards_edges", "open_edges")


@dataclass(frozen=True, slots=True)
class Sliced:
    """What the slicer made of one print file.

    Attributes:
        closed: its mesh is manifold and nothing was repaired.
        volume_mm3: as the slicer sums it up.
        size_mm: x, y, z.
        height_mm: of the tool path, with support.
        layer_mm: the height that most of its lines have.
        used_mm3: filament in the tool path.
        time_s: that the slicer expects.
    """

    closed: bool
    volume_mm3: float
    size_mm: tuple[float, float, float]
    height_mm: float
    layer_mm: float
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
        how = ["--support-material", "--support-material-auto", f"--filament-max-volumetric-speed={MELTED_MM3_S}"]
        _run("-g", *how, "--output", str(path), str(file))
        code = path.read_text(encoding="utf-8")
    used = next(line for line in code.splitlines() if line.startswith("; filament used [cm3]"))
    time = next(line for line in code.splitlines() if line.startswith("; estimated printing time (normal mode)"))
    layers = Counter(float(line[8:]) for line in code.splitlines() if line.startswith(";HEIGHT:"))
    x, y, z = (float(told[f"size_{axis}"]) for axis in "xyz")
    return Sliced(
        told["manifold"] == "yes" and not any(word in told for word in REPAIRS),
        float(told["volume"]),
        (x, y, z),
        max(float(line[3:]) for line in code.splitlines() if line.startswith(";Z:")),
        layers.most_common(1)[0][0],
        float(used.rsplit("=", 1)[1]) * 1e3,
        sum(float(number) * SECONDS[unit] for number, unit in re.findall(r"(\d+)([dhms])", time.rsplit("=", 1)[1])),
    )


def _run(*words: str) -> str:
    return subprocess.run([PROGRAM, *words], check=True, capture_output=True, text=True).stdout


def main() -> None:
    """Print one line for each file, and fail if one of them was repaired."""
    whole, longest = True, (0.0, Path())
    for file in sorted(file for folder in sys.argv[1:] for file in Path(folder).glob("print/*.3mf")):
        found = sliced(file)
        whole &= found.closed
        if not file.name.startswith("plate_"):
            longest = max(longest, (found.time_s / 3600, file))
        mark = "ok  " if found.closed else "FAIL"
        hours, minutes = divmod(round(found.time_s / 60), 60)
        print(
            f"{mark} {file}: {found.volume_mm3 / 1e3:.1f} cm3, {found.height_mm:.1f} mm high, "
            f"{found.used_mm3 / 1e3:.1f} cm3 of filament in {hours} h {minutes:02d} min",
            flush=True,
        )
    print(f"the longest part takes {longest[0]:.2f} h: {longest[1].stem}")
    sys.exit(0 if whole else 1)


if __name__ == "__main__":
    main()
