"""Peak memory of converting large clouds against their size: it must not grow.

    python -m benchmarks.firmware_io.recordings.clouds_memory 2 20 [200] [FORMAT ...]       # million points

For each size a cloud of x y z, intensity and time is made, then converted to each format and back to PLY, each in a
process of its own. Needs 60 bytes of disk a point.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from scanwright.firmware_io.clouds.ply import ply_writer

FORMATS = ("ply", "pcd", "las", "laz", "e57", "xyz")
_FIELDS = np.dtype([*((axis, "<f4") for axis in "xyz"), ("intensity", "<f4"), ("time_s", "<f8")])
_AT_ONCE = 1_000_000
_CONVERT = """
import resource, sys
from pathlib import Path
from scanwright.firmware_io.clouds.formats import stream
written = stream(Path(sys.argv[1]), Path(sys.argv[2]), least_bytes=0)
print(written.rows, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def make(path: Path, millions: int) -> None:
    """Write a cloud of a room."""
    rng = np.random.default_rng(1)
    with ply_writer(path, _FIELDS, ["x y z in m"]) as writer:
        for k in range(millions):
            rows = np.empty(_AT_ONCE, _FIELDS)
            for axis in "xyz":
                rows[axis] = rng.uniform(-20, 20, _AT_ONCE)
            rows["intensity"] = rng.integers(0, 256, _AT_ONCE)
            rows["time_s"] = (k + np.arange(_AT_ONCE) / _AT_ONCE) * 10
            writer.write(rows)


def converted(source: Path, target: Path) -> tuple[int, float, float]:
    """Return rows, peak memory [MB] and time [s] of one conversion."""
    began_s = time.monotonic()
    run = subprocess.run([sys.executable, "-c", _CONVERT, source, target], capture_output=True, text=True, check=True)
    rows, peak_mb = run.stdout.split()
    return int(rows), float(peak_mb), time.monotonic() - began_s


def main(sizes: list[int], formats: list[str]) -> None:
    """Print a line for each conversion."""
    print(f"{'points':>12}  {'from':4} {'to':4} {'file MB':>8} {'peak MB':>8} {'s':>7}")
    for millions in sizes:
        with TemporaryDirectory() as folder:
            source = Path(folder) / "in.ply"
            make(source, millions)
            for name in formats:
                there, back = Path(folder) / f"there.{name}", Path(folder) / "back.ply"
                for one, other in ((source, there), (there, back)):
                    rows, peak_mb, seconds = converted(one, other)
                    size_mb = other.stat().st_size / 1e6
                    ends = f"{one.suffix[1:]:4} {other.suffix[1:]:4}"
                    print(f"{rows:12,}  {ends} {size_mb:8,.0f} {peak_mb:8,.0f} {seconds:7.1f}", flush=True)
                there.unlink()


if __name__ == "__main__":
    words = sys.argv[1:]
    main(
        [int(word) for word in words if word.isdigit()] or [2, 20],
        [word for word in words if word in FORMATS] or [*FORMATS],
    )
