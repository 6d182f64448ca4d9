"""How many small faults the tests notice: mutants of the modules that carry the numbers, each under its own tests.

    python -m benchmarks.mutants [--count 200] [--first 0] [--seed 1] [--only NAME] [--part 1/4]

A mutant is the program with one operator, comparison or number changed, at random, and as many in each module. It
is made in a copy of the checkout; only the tests of its module run, until the first that fails. One that takes three
times as long as usual counts as noticed. Prints every mutant, then each module's share and the survivors.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
_MOST_S = 600.0

MODULES = {
    "density": ("design/density/phase_walk.py", "tests/design/density"),
    "frames": ("design/frames.py", "tests/design/test_frames.py tests/design/test_angles.py"),
    "beams": ("design/density/beams.py", "tests/design/density/test_beams.py tests/design/objective/test_holes.py"),
    "score": ("design/objective/score.py", "tests/design/objective"),
    "families": ("design/search/families.py", "tests/design/search"),
    "deskew": ("benchmarks/firmware_io/recordings/deskew.py", "tests/firmware_io/assembly"),
    "encoder": ("firmware_io/assembly/axis_curve.py", "tests/firmware_io/assembly/test_axis_curve.py"),
    "clock": ("firmware_io/lidar/device_clock.py", "tests/firmware_io/lidar/test_device_clock.py"),
    "registers": (
        "firmware_io/servo/bus/registers.py",
        "tests/firmware_io/servo/test_registers.py tests/firmware_io/servo/test_servo.py",
    ),
    "scip": (
        "firmware_io/lidar/scip/protocol.py",
        "tests/firmware_io/lidar/test_scip.py tests/firmware_io/lidar/test_lidar.py",
    ),
    "joints": ("cad/layout/joints.py", "tests/cad/layout/test_screw_lengths.py tests/cad/layout/test_joints.py"),
    "calibration": ("firmware_io/calibration/model.py", "tests/firmware_io/calibration"),
}

_SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
_NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "floor": "ceil", "ceil": "floor"}
_NOT_CODE = (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom)  # words to people, and what types say


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: which node of the module's tree, in the order of `_places`, and what it is in words."""

    module: str
    place: int
    line: int
    change: str


def _places(tree: ast.Module) -> Iterator[tuple[ast.AST, str, str]]:
    """Nodes that can be changed, with the field and the change in words."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, _NOT_CODE):
            continue
        if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp) and type(node.op) in _SWAPPED:
            typed = isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr) and _is_type(node)
            if not typed:
                yield node, "op", f"{type(node.op).__name__} -> {_SWAPPED[type(node.op)].__name__}"
        if isinstance(node, ast.Compare) and type(node.ops[0]) in _SWAPPED:
            yield node, "ops", f"{type(node.ops[0]).__name__} -> {_SWAPPED[type(node.ops[0])].__name__}"
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
            yield node, "value", f"{node.value} -> {_other(node.value)}"
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield node, "drop", f"{type(node.op).__name__} dropped"
        if isinstance(node, ast.Name | ast.Attribute):
            name = node.id if isinstance(node, ast.Name) else node.attr
            if name in _NAMES:
                yield node, "id" if isinstance(node, ast.Name) else "attr", f"{name} -> {_NAMES[name]}"
        hidden = {"annotation", "returns", "decorator_list"}
        for field, below in ast.iter_fields(node):
            if field not in hidden:
                waiting += [one for one in (below if isinstance(below, list) else [below]) if isinstance(one, ast.AST)]


def _is_type(node: ast.BinOp) -> bool:
    """Whether `A | B` joins types: names that begin with a capital, or None."""
    sides = [node.left, node.right]
    return any(isinstance(side, ast.Constant) and side.value is None for side in sides) or all(
        isinstance(side, ast.Name) and side.id[:1].isupper() for side in sides
    )


def _other(number: float) -> float:
    return number + 1 if isinstance(number, int) else number * 2 or 1.0


def _changed(source: str, place: int) -> str:
    """The source with one node changed; comments are lost, nothing else is."""
    tree = copy.deepcopy(ast.parse(source))
    node: Any  # which fields it has follows from the kind of change
    node, field, _ = list(_places(tree))[place]
    if field == "op":
        node.op = _SWAPPED[type(node.op)]()
    elif field == "ops":
        node.ops[0] = _SWAPPED[type(node.ops[0])]()
    elif field == "value":
        node.value = _other(node.value)
    elif isinstance(node, ast.UnaryOp):
        if isinstance(node.op, ast.USub):
            node.op = ast.UAdd()
        else:  # `not x` becomes `not not x`
            node.operand = ast.UnaryOp(ast.Not(), node.operand)
    else:
        setattr(node, field, _NAMES[getattr(node, field)])
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def sample(names: list[str], count: int, seed: int) -> list[Mutant]:
    """Mutants of these modules, as many of each as there are, at random places."""
    rng, each = random.Random(seed), []
    for name in names:
        tree = ast.parse((ROOT / MODULES[name][0]).read_text(encoding="utf-8"))
        places = enumerate(_places(tree))
        found = [Mutant(name, place, getattr(node, "lineno", 0), change) for place, (node, _, change) in places]
        each.append(rng.sample(found, len(found)))
    in_turn = [mutant for taken in zip_longest(*each) for mutant in taken if mutant is not None]
    return in_turn[:count]


def _passes(copied: Path, tests: str, most_s: float) -> tuple[bool, float]:
    """Whether the tests pass in the copy, and how long they took."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests.split()]
    kept = {**os.environ, "PYTHONPATH": str(copied), "CI": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    began_s = time.monotonic()
    with subprocess.Popen(
        words, cwd=copied, env=kept, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as run:
        try:
            code = run.wait(most_s)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, 9)  # with the processes that the tests have started
            code = -1
    return code == 0, time.monotonic() - began_s


def main() -> None:
    """Make them, run them, count them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="go on behind those of an earlier run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=MODULES, action="append", help="modules, all if none is named")
    parser.add_argument("--part", default="1/1", help="a slice of the sample, as 1/4")
    asked = parser.parse_args()
    part, parts = (int(number) for number in asked.part.split("/"))
    mutants = sample(asked.only or list(MODULES), asked.count, asked.seed)[asked.first + part - 1 :: parts]
    print(f"seed {asked.seed}, part {asked.part}: {len(mutants)} mutants", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "checkout"
        shutil.copytree(ROOT, copied, ignore=shutil.ignore_patterns(".venv", ".git", "out", "docs", "__pycache__"))
        usual_s: dict[str, float] = {}
        killed: dict[str, list[bool]] = {}
        survivors: list[str] = []
        for mutant in sorted(mutants, key=lambda one: (one.module, one.line)):
            file, tests = MODULES[mutant.module]
            source = (ROOT / file).read_text(encoding="utf-8")
            if mutant.module not in usual_s:
                # unparsed as the mutants are, so that what they differ by is the change alone
                (copied / file).write_text(ast.unparse(ast.parse(source)) + "\n", encoding="utf-8")
                green, usual_s[mutant.module] = _passes(copied, tests, _MOST_S)
                if not green:
                    sys.exit(f"{mutant.module}: its tests fail without a mutant: {tests}")
            (copied / file).write_text(_changed(source, mutant.place), encoding="utf-8")
            survives, took_s = _passes(copied, tests, 3 * usual_s[mutant.module] + 30)
            (copied / file).write_text(source, encoding="utf-8")
            killed.setdefault(mutant.module, []).append(not survives)
            says = f"{mutant.module:12} {file}:{mutant.line}: {mutant.change}"
            print(f"{'SURVIVES' if survives else 'dies':9} {took_s:5.0f} s  {says}", flush=True)
            survivors += [says] if survives else []
    for name, dead in killed.items():
        print(f"{name:12} {sum(dead):3} of {len(dead):3} die")
    dead = [one for each in killed.values() for one in each]
    print(f"{'all':12} {sum(dead):3} of {len(dead):3} die: {sum(dead) / max(len(dead), 1):.0%}")
    print("\n".join(["survivors:", *survivors]))


if __name__ == "__main__":
    main()
