"""What holds what: marks for the words of the assembly."""

from __future__ import annotations

from design.catalogue.products import Lidar, Servo

ALL_SCREWS = "{*}"  # of a step's part


def screws(onto: str, part: str = "") -> str:
    """Mark for the screws of a step's part, or of another one, that end in a body."""
    return f"{{{part}>{onto}}}" if part else f"{{{onto}}}"


def lidar_thread_mm(lidar: Lidar) -> float:
    """Depth of the threads in a lidar's base, as far as they are drawn."""
    return min(lidar.mount_thread_depth_mm, lidar.window_z_mm[0] - 1.0)


def horn_thread_mm(servo: Servo) -> float:
    """Depth of the threads in a servo's horn."""
    return min(servo.horn_thread_depth_mm, servo.horn_thickness_mm)
