"""The height of the optical centre above the robot's deck: as built and as given in the task."""

from __future__ import annotations

import math

from scanwright.design.angles import AngleSet
from scanwright.design.findings import Finding
from scanwright.design.task.task import LoadedTask
from scanwright.pipeline.robot_around import robot_around

CLOSE_MM = 10.0  # a larger difference changes the masks noticeably


def deck_height(loaded: LoadedTask, angles: AngleSet) -> Finding:
    """Compare the height of a laid-out scanner, which has `t_world_rot_mm`, with the masks of its task.

    `value` is the height as built [mm], `limit` the one of the task; None if no mask is below or above the scanner.
    """
    x_mm, _, z_mm = angles.t_world_rot_mm
    below_m, above_m = robot_around(loaded.task.mask, loaded.source.parent)
    side = "above the deck" if z_mm > 0 else "below the deck that the scanner hangs from"
    along = f", {abs(x_mm):.0f} mm {'ahead of' if x_mm > 0 else 'behind'} its holes" if abs(x_mm) >= 0.5 else ""
    message = f"the optical centre is {abs(z_mm):.0f} mm {side}{along}"
    task_mm = 1000 * (below_m if z_mm > 0 else above_m)
    if not math.isfinite(task_mm):
        hangs = z_mm < 0 and math.isfinite(below_m)
        hint = "the task has no deck above it: limit angles.alpha_rot_deg to [-90, 90]" if hangs else ""
        return Finding("deck_height", "warning" if hangs else "note", "deck", message, abs(z_mm), None, "mm", hint)
    off_mm = abs(z_mm) - task_mm
    if abs(off_mm) <= CLOSE_MM:
        return Finding("deck_height", "note", "deck", message, abs(z_mm), task_mm, "mm")
    change = "add" if off_mm * z_mm > 0 else "subtract"
    hint = (
        f"{change} {abs(off_mm) / 1000:.3f} m {'to' if change == 'add' else 'from'} the scanner's height in the task "
        "(--height-m of `scanwright new`, or each height_m and sensor_m) and build again, with "
        "[angles] fixed to keep this mount"
    )
    if off_mm < 0:
        hint += f", or put a plate of {-off_mm:.0f} mm under the mount"
    message += f", but {task_mm:.0f} mm in the task"
    return Finding("deck_height", "warning", "deck", message, abs(z_mm), task_mm, "mm", hint)
