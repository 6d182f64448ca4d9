"""Wrong inputs through every command that reads a file: `python -m benchmarks.scanwright.wrong_inputs [COUNT] [SEED]`.

COUNT (default 1,000) times a command gets one damaged file, or a wrong number, in a process of its own with a limit on
memory and time. Printed is each that ends in a traceback, exits with 0 on nonsense (an output that is not there, is not
as many rows as was said, is not finite, or "nan" on the screen), says what is wrong in more lines than there may be
faults, or in one that does not name it, takes more than 2 GB or 30 s of processor time; with its seed, which
alone brings it back:
`python -m benchmarks.scanwright.wrong_inputs 1 SEED`.
"""

from __future__ import annotations

import faulthandler
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.scanwright.wrong_inputs.accidents import damage, number
from benchmarks.scanwright.wrong_inputs.workshop import FORMATS, Job, furnish, jobs
from scanwright.cli.app import run
from scanwright.design.errors import ScanwrightError
from scanwright.design.files.faults import MOST_REPORTED
from scanwright.firmware_io.clouds.formats import read_clouds

_MOST_BYTES = 2 << 30
_MOST_S = 30
_KILL_S = 2 * _MOST_S
_HANGS_S = 3 * _KILL_S  # by the clock on the wall: other people's work may share the processor
_ROOM_BYTES = 3 << 30  # of addresses beyond what the program has before it begins
_FARTHEST_M = 1e8
_LOADED = (  # once, and not anew by every child
    *(
        "scanwright.firmware_io.assembly.assemble",
        "scanwright.firmware_io.calibration.calibrate",
        "scanwright.firmware_io.clouds.e57",
    ),
    *(
        "scanwright.firmware_io.clouds.las",
        "scanwright.firmware_io.clouds.pcd",
        "scanwright.firmware_io.recording.importer",
        "scanwright.firmware_io.scan.plan",
    ),
    *(
        "scanwright.firmware_io.registration.register_files",
        "scanwright.design.evaluation.evaluation",
        "scanwright.design.search.optimum",
    ),
    *("matplotlib.pyplot", "scanwright.api", "scipy.interpolate", "scipy.spatial.transform"),
)


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended.

    Attributes:
        code: its exit code; -1 after a traceback, -2 where a signal ended it.
        signal: that signal, else 0.
        said: on standard output.
        complaints: lines on standard error, without progress.
        seconds: of processor time.
        peak_bytes: of memory.
    """

    code: int
    signal: int
    said: str
    complaints: tuple[str, ...]
    seconds: float
    peak_bytes: int


@dataclass(frozen=True, slots=True)
class Case:
    """A seed and what came of it: why it failed, "" where not."""

    seed: int
    words: tuple[str, ...]
    accident: str
    ended: Ended
    fault: str

    def lines(self) -> list[str]:
        """The same in words."""
        last = [line[:300] for line in self.ended.complaints or (self.ended.said.strip(),)]
        last = last[-12:] if self.ended.code < 0 else last[-1:]
        begin = f"seed {self.seed}: {self.fault}: {' '.join(self.words)[:200]}"
        return [begin, f"  {self.accident}", *(f"  {line}" for line in last)]


def tried(shop: Path, seed: int, only: str = "") -> Case:
    """One command with one wrong input.

    Args:
        shop: folder of valid inputs; stays as it is.
        seed: of the choice.
        only: commands whose name begins so.
    """
    rng = random.Random(seed)
    job = rng.choice([job for job in jobs() if job.words[0].startswith(only)])
    folder = Path(tempfile.mkdtemp(prefix="wrong-"))
    try:
        shutil.copytree(shop, folder, dirs_exist_ok=True)
        words = list(job.words)
        if job.numbers and (not job.files or rng.random() < 0.4):
            place, named = rng.choice(job.numbers), words[0]
            head, _, tail = words[place].rpartition(",") if "," in words[place] else words[place].rpartition("=")
            mark = words[place][len(head) : len(words[place]) - len(tail)]
            words[place] = head + mark + number(rng)
            accident = f"{words[place][:80]} on the command line"
        else:
            named = rng.choice(job.files)
            accident = f"{named}: {damage(rng, folder / named, sorted(p for p in shop.iterdir() if p.is_file()))}"
        out = f"out{job.out}"
        words = [out if word == "OUT" else word for word in words]
        ended = _ended(folder, words, folder / out)
        return Case(seed, tuple(words), accident, ended, _fault(job, folder / out, Path(named).name, ended))
    finally:
        shutil.rmtree(folder)


def _ended(folder: Path, words: list[str], out: Path) -> Ended:
    """Run a command in a child."""
    began = time.monotonic()
    child = os.fork()
    if not child:
        _in_the_child(folder, words, out)
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() - began > _HANGS_S:
            os.kill(child, 9)
        time.sleep(0.005)
    said, complaints = ((folder / name).read_text(errors="replace") for name in (".said", ".complaints"))
    code = os.waitstatus_to_exitcode(status)
    lines = tuple(line for line in complaints.splitlines() if line and not line.startswith("  .."))
    seconds = used.ru_utime + used.ru_stime
    peak_bytes = used.ru_maxrss * 1024
    return Ended(-2 if code < 0 else -1 if code == 99 else code, max(-code, 0), said, lines, seconds, peak_bytes)


def _in_the_child(folder: Path, words: list[str], out: Path) -> None:
    code = 99
    try:
        os.chdir(folder)
        for stream, name in ((1, ".said"), (2, ".complaints")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), stream)
        addresses = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (addresses + _ROOM_BYTES,) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (_KILL_S, _KILL_S))
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        faulthandler.dump_traceback_later(_HANGS_S - _MOST_S, file=sys.stderr)
        sys.argv = ["scanwright", *words]
        try:
            run()
            code = 0
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
        if (
            not code and out.suffix[1:] in FORMATS and out.exists()
        ):  # here: readers begin threads, which no fork survives
            Path(".rows").write_text(_rows(out))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _fault(job: Job, out: Path, named: str, ended: Ended) -> str:
    """What is wrong with how a command ended, "" if nothing."""
    if ended.code == -1:
        return "traceback"
    if ended.code == -2:
        return f"ended by signal {ended.signal} after {ended.seconds:.1f} s of the processor"
    if ended.seconds > _MOST_S:
        return f"{ended.seconds:.0f} s"
    if ended.peak_bytes > _MOST_BYTES:
        return f"{ended.peak_bytes / 1e9:.1f} GB"
    if ended.code == 0:
        return _nonsense(job, out, ended)
    if ended.code == 2:
        told = [
            line for line in ended.complaints if not line.startswith(("Usage:", "Try ", "\u256d", "\u2502", "\u2570"))
        ]
        if ended.complaints[:1] and ended.complaints[0].startswith("Usage:"):
            return ""  # typer's own
        if not 1 <= len(told) <= MOST_REPORTED + 1:
            return f"{len(told)} lines"
        if any(line.startswith("Traceback") for line in told):
            return "traceback"
        if not all(named in line or "--" in line or named.partition(".")[0] in line for line in told):
            return "" if named == job.words[0] else "says not which file"
    return ""


def _nonsense(job: Job, out: Path, ended: Ended) -> str:
    """What an exit of 0 leaves behind that cannot be."""
    if re.search(r"\b(nan|inf)\b", ended.said.lower()):
        return "nan said"
    if job.out is None or "nothing written" in ended.said:
        return ""
    if not out.exists():
        return "0 without an output"
    if out.suffix[1:] not in FORMATS:
        return ""
    rows = (out.parent / ".rows").read_text()
    if not rows.isdecimal():
        return f"0 with an output that cannot be: {rows}"
    said = [word.replace(",", "") for word in re.findall(r"wrote ([\d,]+) (?:rows|points)", ended.said)]
    return f"{said[-1]} rows said, {rows} there" if said and said[-1] != rows else ""


def _rows(out: Path) -> str:
    """How many rows clouds have, or what is wrong with them."""
    try:
        clouds, _ = read_clouds(out)
    except ScanwrightError as error:
        return str(error)
    points_m = np.concatenate([cloud.points_m for cloud in clouds]).astype(float)
    valid = np.isfinite(points_m).all(axis=1)
    if not valid.any() or np.abs(points_m[valid]).max() > _FARTHEST_M:
        return "no point that can be"
    return str(len(points_m))


def main() -> None:
    """Print the failures and a table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    only = sys.argv[3] if len(sys.argv) > 3 else ""
    codes, faults = Counter[str](), Counter[str]()
    slowest, widest = 0.0, 0
    with tempfile.TemporaryDirectory() as name:
        shop = Path(name)
        furnishing = get_context("spawn").Process(
            target=furnish, args=(shop,)
        )  # its threads must not be here at a fork
        furnishing.start()
        furnishing.join()
        for room in _LOADED:
            import_module(room)
        for seed in range(first, first + count):
            case = tried(shop, seed, only)
            codes[f"{case.words[0]} {case.ended.code}"] += 1
            slowest, widest = max(slowest, case.ended.seconds), max(widest, case.ended.peak_bytes)
            if case.fault:
                faults[re.sub(r"\d[\d.,]*", "N", case.fault.split(":")[0])] += 1
                print("\n".join(case.lines()), flush=True)
    print(f"{count:,} wrong inputs from seed {first}; longest {slowest:.1f} s, most {widest / 1e9:.2f} GB")
    for what, number_of in sorted(codes.items()):
        print(f"  {what}: {number_of}")
    print(f"failures: {dict(faults) or 'none'}")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
