"""The picture of the four mounting angles in the pages: `uv run python -m benchmarks.scanwright.angles_picture`.

The first view has all of them at zero; in each other one a single angle is 35 deg, and the grey fan shows where the
beams were before.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from matplotlib.figure import Figure

from benchmarks.scanwright.canvas import Canvas
from scanwright.design.arrays import Array
from scanwright.design.frames import R_rot_laser, R_world_rot, rigid

PICTURE = Path(__file__).parents[2] / "docs/pictures/angles.png"
TURNED_DEG = 35.0
RED, GREEN, BLUE = (0.80, 0.10, 0.10), (0.10, 0.55, 0.15), (0.10, 0.25, 0.80)
VIEWS = (
    ("all four are 0", (0, 0, 0, 0)),
    ("alpha_rot = 35:\nthe axis leans about the world's x", (1, 0, 0, 0)),
    ("beta_rot = 35:\nthe axis leans about y", (0, 1, 0, 0)),
    ("alpha_laser = 35:\nthe lidar rolls about its own x", (0, 0, 1, 0)),
    ("beta_laser = 35:\nthe lidar nods about y", (0, 0, 0, 1)),
)


def main() -> None:
    """Write `docs/pictures/angles.png`."""
    figure = Figure(figsize=(13, 3.6))
    for axes, (title, turned) in zip(figure.subplots(1, len(VIEWS)), VIEWS, strict=True):
        axes.imshow(view(TURNED_DEG * np.array(turned)))
        axes.set_title(title, fontsize=10.5)
        axes.axis("off")
    words = (
        "thin arrows: the world, x ahead (red), y left (green), z up (blue); thick black arrow: the axis that the "
        "servo turns; orange: the beams, with their middle"
    )
    figure.text(0.5, 0.03, words, ha="center", fontsize=10)
    figure.subplots_adjust(0.005, 0.08, 0.995, 0.86, 0.02, 0)
    figure.savefig(PICTURE, dpi=100, metadata={"Software": None})


def view(angles_deg: Array) -> Array:
    """One scanner, its servo below and its fan, as an image."""
    canvas = Canvas()
    for axis, colour in zip(np.eye(3), (RED, GREEN, BLUE), strict=True):
        canvas.arrow(np.zeros(3), 1.25 * axis, colour, 0.012)
    alpha_rot, beta_rot, alpha_laser, beta_laser = np.radians(angles_deg)
    R_rot = R_world_rot(alpha_rot, beta_rot)
    R_laser = R_rot @ R_rot_laser(alpha_laser, beta_laser)
    if np.any(angles_deg):
        canvas.mesh(fan(np.eye(3)), (0.5, 0.5, 0.5), 0.25, light=1.0)
    canvas.mesh(fan(R_laser), (0.95, 0.45, 0.05), 0.55, light=1.0)
    canvas.arrow(np.zeros(3), 0.95 * R_laser[:, 0], (0.75, 0.3, 0.0), 0.012)
    canvas.arrow(-0.2 * R_rot[:, 2], 0.85 * R_rot[:, 2], (0.05, 0.05, 0.05), 0.028)
    servo = trimesh.creation.box((0.34, 0.34, 0.5), rigid(np.eye(3), (0, 0, -0.62)))
    shaft = trimesh.creation.cylinder(0.06, segment=[[0, 0, -0.4], [0, 0, -0.1]])
    lidar = trimesh.creation.box((0.3, 0.3, 0.2))
    for body, R, colour in (
        (servo, R_rot, (0.25, 0.26, 0.28)),
        (shaft, R_rot, (0.7, 0.7, 0.72)),
        (lidar, R_laser, (0.35, 0.38, 0.42)),
    ):
        body.apply_transform(rigid(R, np.zeros(3)))
        canvas.mesh(body, colour, light=0.35)
    image = canvas.picture((520, 520), np.array([4.0, -3.2, 2.6]), np.array([0, 0, 0.08]), parallel=1.32)
    return np.asarray(image)


def fan(R_world_laser: Array) -> trimesh.Trimesh:
    """The plane sector that the beams cover, 270 deg of it."""
    bearing = np.radians(np.linspace(-135, 135, 91))
    rim = 0.9 * np.stack([np.cos(bearing), np.sin(bearing), 0 * bearing], axis=1)
    corners = np.vstack([np.zeros(3), rim]) @ R_world_laser.T
    return trimesh.Trimesh(corners, [[0, k, k + 1] for k in range(1, len(rim))], process=False)


if __name__ == "__main__":
    main()
