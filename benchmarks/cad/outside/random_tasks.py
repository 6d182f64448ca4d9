"""Random task files, built by the command line: every kind of scanner in turn.

A third of the scanners turns without end and has a slip ring; the others sweep. Lidars, servos, rings and printers come
from `scanwright catalogue --json`, each in a random order that is used up before it is drawn anew.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

COMMAND = (sys.executable, "-m", "scanwright")
DRAWS = 4  # tasks drawn for one that is built: many servos cannot hold a heavy lidar
DECK_SHARE, FOOT_SHARE = 0.3, 0.2  # tasks with holes of their own, and with a tripod foot


def catalogue() -> list[dict[str, Any]]:
    """Return all products as the command line prints them.

    Raises:
        subprocess.CalledProcessError: the command fails.
    """
    done = subprocess.run([*COMMAND, "catalogue", "--json"], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)["products"]


def tasks(products: Sequence[dict[str, Any]], rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Yield tasks without end; every lidar, servo, ring and printer comes before one comes twice."""
    drawn = {
        kind: _shuffled([each["name"] for each in products if each["kind"] == kind], rng)
        for kind in ("lidar", "servo", "slip_ring", "printer")
    }
    number = 0
    while True:
        ring = number % 3 == 0
        lidar, servo, printer = (next(drawn[kind]) for kind in ("lidar", "servo", "printer"))
        yield _task(number, lidar, servo, next(drawn["slip_ring"]) if ring else None, printer, rng)
        number += 1


def built(folder: Path, count: int, seed: int) -> tuple[list[Path], list[str]]:
    """Build random tasks in a folder until there are `count`; return their folders, and a line per refused task."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    folders: list[Path] = []
    refused: list[str] = []
    for task in tasks(catalogue(), rng):
        if len(folders) == count or len(folders) + len(refused) == DRAWS * count:
            break
        file = folder / f"{task['name']}.toml"
        file.write_text(tomli_w.dumps(task), encoding="utf-8")
        done = subprocess.run(
            [*COMMAND, "build", str(file), "--out", str(folder), "-q"], capture_output=True, text=True, check=False
        )
        (folder / f"{task['name']}.log").write_text(done.stdout + done.stderr, encoding="utf-8")
        if (folder / task["name"] / "assembly.step").exists():
            folders.append(folder / task["name"])
        else:
            reason = next((line for line in done.stderr.splitlines() if "error" in line), f"exit {done.returncode}")
            refused.append(f"{task['name']}: {task['sensor']}, {task['servo']}, {task.get('slip_ring')}: {reason}")
    return folders, refused


def _shuffled(names: Sequence[str], rng: np.random.Generator) -> Iterator[str]:
    while True:
        yield from (names[i] for i in rng.permutation(len(names)))


def _task(
    number: int, lidar: str, servo: str, ring: str | None, printer: str, rng: np.random.Generator
) -> dict[str, Any]:
    upright, level, any_axis = (0.0, 0.0), (0.0, 90.0), tuple(np.round(rng.uniform((-180, -90), (180, 90)), 1))
    alpha_rot, beta_rot = (upright, any_axis, level, any_axis)[int(rng.integers(4))]
    alpha_laser, beta_laser = np.round(rng.uniform(-85, 85, 2), 1)
    half = float(np.round(rng.uniform(30, 130)))
    task: dict[str, Any] = {"name": f"random_{number}", "sensor": lidar, "servo": servo, "printer": printer}
    if ring:
        task |= {"slip_ring": ring, "motion": {"mode": "spin", "period_s": 15.0}}
    else:
        task |= {"motion": {"mode": "sweep", "limits_deg": [-half, half], "period_s": 12.0, "accel_deg_s2": 200.0}}
    task["angles"] = {
        "alpha_rot_deg": float(alpha_rot),
        "beta_rot_deg": float(beta_rot),
        "alpha_laser_deg": float(alpha_laser),
        "beta_laser_deg": float(beta_laser),
    }
    task |= {"density": {"ball_radius_deg": 3.0}, "weight": [{"shape": "all"}]}
    task["modules"] = {"tripod_foot": bool(rng.random() < FOOT_SHARE)}
    if rng.random() < DECK_SHARE:
        task["deck"] = {"shape": "rectangle", "size_mm": [90.0, 70.0], "screw": "M5"}
    return task
