"""What the studio has others make: the scanner in 3D and a scan of a scene. The front door passes the makers in.

Both run in processes of their own, so that the CAD kernel, which holds the interpreter, never stops the page; the
parts in two at once, what turns and what stands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.angles import Angles, AngleSet
from design.frames import Array
from design.motion import Shortest, Sweep
from design.objective.problem import Problem
from design.scanner import Scanner, scanner_of
from design.task.shapes import Placed
from design.task.task import LoadedTask
from scanwright.studio.state import Setting

MOST_RAYS = 150_000  # of a simulated scan: what a page draws at once


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One body of the scanner, in the rotation frame at gamma = 0.

    Attributes:
        name: of the part.
        vertices_m: shape (n, 3).
        faces: shape (m, 3).
        colour: sRGB, 0 .. 255.
    """

    name: str
    vertices_m: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colour: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class View:
    """A scan to be simulated.

    Attributes:
        angles: of the scanner; its optical centre is the world's origin.
        joint_rad: axis angle of each line, shape (lines,).
        every: of how many beams one is cast.
        scene: the task's, or None for a furnished room.
        folder: that the scene's file is named from.
    """

    angles: AngleSet
    joint_rad: Array
    every: int
    scene: Placed | None
    folder: Path


Parts = Callable[[Scanner, bool], tuple[Body, ...]]
"""Makes the bodies of a scanner that turn with the horn, or those that stand still; BuildError where it cannot."""
Look = Callable[[View], NDArray[np.float32]]
"""Points that the scanner sees in a scene, in the world [m], shape (n, 3); raises SceneError."""


@dataclass(frozen=True, slots=True)
class Workbench:
    """Both makers: functions of a module, so that another process can call them."""

    parts: Parts
    look: Look


def angles_of(loaded: LoadedTask, setting: Setting) -> AngleSet:
    """The angle set of a setting of a task, its optical centre at the world's origin."""
    task, (alpha_rot, beta_rot, alpha_laser, beta_laser) = loaded.task, setting.angles_deg
    return AngleSet(
        task=task.name,
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser),
        sensor=task.sensor,
        servo=task.servo,
        slip_ring=None if isinstance(task.motion, Sweep) else task.slip_ring,
        motion=None if isinstance(task.motion, Shortest) else task.motion,
    )


def scanner_at(loaded: LoadedTask, setting: Setting) -> Scanner:
    """The scanner of a setting.

    Raises:
        TaskError: a product is not in the catalogue.
    """
    return scanner_of(angles_of(loaded, setting), loaded.task.printer, loaded.products, loaded.task.deck)


def view_of(loaded: LoadedTask, problem: Problem, setting: Setting, *, in_task_scene: bool) -> View:
    """One full scan, thinned evenly in lines and beams to what a page can draw."""
    joint = problem.lines.angles_rad if problem.sweep is None else problem.sweep.angles_rad(0.5)
    thin = int(np.ceil(np.sqrt(len(joint) * len(problem.bearings_rad) / MOST_RAYS)))
    return View(
        angles=angles_of(loaded, setting),
        joint_rad=joint[::thin],
        every=thin,
        scene=loaded.task.scene if in_task_scene else None,
        folder=loaded.source.parent,
    )
