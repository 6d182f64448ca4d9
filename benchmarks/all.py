"""Every promise of the docs, measured on this machine: `python -m benchmarks.all [-m MINUTES] [-n ROUNDS] [WORD ...]`.

`benchmarks/promises.toml` names each: the command that measures it, what of its output is read, and what it may be at
most or must be at least. Runs those that take no more than MINUTES each on two quiet cores (default 3) and whose figure
or command contains one of the WORDs; what depends on the machine's mood (seconds, ratios) ROUNDS times (default 3).
Prints one table in Markdown, with the machine and its versions, and ends with 1 where a promise does not hold.

Seconds are promised for two quiet cores: on a machine that does something else they do not hold, ratios to a peer of
the same run mostly do. What names `out/ground_ahead` wants that built.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shlex
import shutil
import statistics
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROMISES = Path(__file__).with_suffix("").with_name("promises.toml")
MOODY = ("s", "ms", "times", "million/s")
PATIENCE = 8.0  # times as long as it takes elsewhere
SHOWN = ("numpy", "scipy", "numba", "cadquery-ocp", "trimesh")


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """One figure of the docs.

    Attributes:
        figure: what it is.
        command: behind `python -m`.
        minutes: that the command takes on two quiet cores.
        number: a regular expression whose group is the figure; the worst of several is taken.
        unit: of it.
        most: that it may be; None without such a bound.
        least: that it must be; None likewise.
        counted: whether the figure is how often `number` is found.
        needs: programs without which the command says nothing.
    """

    figure: str
    command: str
    minutes: float
    number: str
    unit: str = ""
    most: float | None = None
    least: float | None = None
    counted: bool = False
    needs: tuple[str, ...] = ()

    def read(self, output: str) -> float | None:
        """The figure in what a command printed, the worst where it stands there several times; None if it does not."""
        said = re.findall(self.number, output, re.MULTILINE)
        if self.counted:
            return float(len(said))
        if not said:
            return None
        found = [float(text.replace(",", "")) for text in said]
        return max(found) if self.most is not None else min(found)

    def holds(self, value: float) -> bool:
        """Whether a figure is what the docs say."""
        return (self.most is None or value <= self.most) and (self.least is None or value >= self.least)

    def said(self) -> str:
        """The bounds in words."""
        bounds = [("at least", self.least), ("at most", self.most)]
        return " and ".join(f"{words} {bound:g} {self.unit}".rstrip() for words, bound in bounds if bound is not None)


@dataclass(frozen=True, slots=True)
class Outcome:
    """A promise, and what it was in each round; or why nobody knows."""

    promise: Promise
    values: tuple[float, ...] = ()
    why: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether the median holds; None where nothing was measured."""
        return self.promise.holds(statistics.median(self.values)) if self.values else None


def main() -> None:
    """Measure, print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.all", description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", help="only figures or commands that contain one of these")
    parser.add_argument("-m", "--minutes", type=float, default=3.0, help="longest that a command may take")
    parser.add_argument("-n", "--rounds", type=int, default=3, help="of what depends on the machine's mood")
    asked = parser.parse_args()
    chosen = [promise for promise in promises() if not asked.words or _named(promise, asked.words)]
    outcomes = []
    print(machine(), end="\n\n", flush=True)
    for command, group in _by_command(chosen):
        outcomes += measured(command, group, asked.minutes, asked.rounds)
    print("\n".join(table(outcomes)))
    sys.exit(any(outcome.kept is False for outcome in outcomes))


def promises(path: Path = PROMISES) -> list[Promise]:
    """Those of the file, in its order."""
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["promise"]
    return [Promise(**(entry | {"needs": tuple(entry.get("needs", ()))})) for entry in entries]


def machine() -> str:
    """What was measured on, in one line."""
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8") if info.is_file() else ""
    name = re.search(r"model name\s*: (.+)", text)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return (
        f"{name[1] if name else platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; "
        f"{platform.system()} {platform.release()}, Python {platform.python_version()}, "
        f"{', '.join(f'{each} {version(each)}' for each in SHOWN)}; commit {commit.stdout.strip() or 'unknown'}"
    )


def measured(command: str, group: list[Promise], minutes: float, rounds: int) -> list[Outcome]:
    """What the promises of one command come to; it is run once for all of them, or once a round."""
    first = group[0]
    if first.minutes > minutes:
        return [Outcome(promise, why=f"takes {first.minutes:g} min") for promise in group]
    missing = [need for promise in group for need in promise.needs if shutil.which(need) is None]
    if missing:
        return [Outcome(promise, why=f"{missing[0]} is not installed") for promise in group]
    count = rounds if any(promise.unit in MOODY for promise in group) else 1
    print(f"python -m {command}", file=sys.stderr, flush=True)
    outputs = [_output(command, 60 * PATIENCE * first.minutes) for _ in range(count)]
    return [_outcome(promise, outputs) for promise in group]


def table(outcomes: list[Outcome]) -> Iterator[str]:
    """Lines of the table, those that do not hold once more below it."""
    yield "| figure | promised | median | spread | holds | command |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for outcome in outcomes:
        promise, values = outcome.promise, outcome.values
        median = (
            f"{statistics.median(values):.4g} {promise.unit}".rstrip() if values else f"not measured: {outcome.why}"
        )
        spread = f"{min(values):.4g} .. {max(values):.4g}" if len(values) > 1 else ""
        kept = {True: "yes", False: "**no**", None: ""}[outcome.kept]
        yield f"| {promise.figure} | {promise.said()} | {median} | {spread} | {kept} | `python -m {promise.command}` |"
    broken = [outcome.promise.figure for outcome in outcomes if outcome.kept is False]
    known = sum(outcome.kept is not None for outcome in outcomes)
    yield ""
    yield f"{known - len(broken)} of {known} promises hold on this machine" + (
        f"; these do not: {'; '.join(broken)}" if broken else ""
    )


def _outcome(promise: Promise, outputs: list[str]) -> Outcome:
    values = [promise.read(output) for output in outputs]
    if any(value is None for value in values):
        last = next((line for line in reversed(outputs[-1].splitlines()) if line.strip()), "no output")
        return Outcome(promise, why=f"its command did not say it: {last[:120]}")
    return Outcome(promise, tuple(value for value in values if value is not None))


def _output(command: str, longest_s: float) -> str:
    words = [sys.executable, "-m", *shlex.split(command)]
    try:
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=longest_s)
    except subprocess.TimeoutExpired:
        return f"still running after {longest_s:.0f} s"
    return done.stdout + done.stderr


def _named(promise: Promise, words: list[str]) -> bool:
    return any(word in f"{promise.figure} {promise.command}" for word in words)


def _by_command(chosen: list[Promise]) -> Iterator[tuple[str, list[Promise]]]:
    for command in dict.fromkeys(promise.command for promise in chosen):
        yield command, [promise for promise in chosen if promise.command == command]


if __name__ == "__main__":
    main()
