"""Pictures of README and the pages that show what comes out, made from a build and from a real recording.

    uv run scanwright build ground_ahead
    uv run scanwright accuracy ground_ahead
    SCANWRIGHT_DATA=... uv run python -m benchmarks.scanwright.pictures out/ground_ahead

The recording is `room_240.bag` of liangfok/tilting_lidar_scanner, read from the folder of test data.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

import scanwright as sw
from benchmarks.scanwright.canvas import Canvas
from benchmarks.scanwright.robot_picture import height_colours, points_of, scanner_bodies
from scanwright.design.angles import AngleSet

HERE = Path(__file__).parents[2] / "docs/pictures"
ROLLING = (0.0, 90.0, 0.0, -90.0)
SIZE = (640, 560)


def main() -> None:
    """Write the pictures, as far as there is what they show."""
    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    found = sw.load_angles(build / "angles.json").angles_deg
    mounting = (found.alpha_rot, found.beta_rot, found.alpha_laser, found.beta_laser)
    settings = {"the angles that were found": mounting, "rolling, a usual mount": ROLLING}
    sw.draw_density("ground_ahead", settings).savefig(HERE / "density.png", dpi=80, metadata={"Software": None})
    parts(build / "exploded.glb", HERE / "parts.png")
    emulated_room(sw.load_angles(build / "angles.json"), HERE / "cloud.png")
    diagram = build.parent / "accuracy" / build.name / "work_precision.png"
    if diagram.exists():
        shutil.copyfile(diagram, HERE / diagram.name)
    if "SCANWRIGHT_DATA" in os.environ:
        with tempfile.TemporaryDirectory() as folder:
            room(Path(os.environ["SCANWRIGHT_DATA"]), Path(folder))


def parts(glb: Path, png: Path) -> None:
    """The scanner taken apart, in the order in which it is put together."""
    canvas = Canvas()
    bodies = scanner_bodies(glb)
    for body, colour in bodies:
        canvas.mesh(body, colour)
    corners = np.array([body.bounds for body, _ in bodies])
    middle = (corners[:, 0].min(0) + corners[:, 1].max(0)) / 2
    reach = float(np.linalg.norm(corners[:, 1].max(0) - corners[:, 0].min(0))) / 2
    image = canvas.picture(SIZE, middle + np.array([-0.9, 2.2, 0.7]), middle, parallel=0.7 * reach)
    image.quantize(128).save(png, optimize=True)


def room(data: Path, folder: Path) -> None:
    """The cloud of the real recording, as commands draw it."""
    from benchmarks.firmware_io.cloud_picture import cloud_picture

    recording, cloud = folder / "room.mcap", folder / "room.ply"
    bag = data / "tilting/room_240.bag"
    sw.import_bag(bag, recording, scan="/slice:laserScan", angle="/slice:stepAngle", angle_unit="deg", hold=True)
    sw.assemble(recording, Path(__file__).parents[2] / "design/angle_sets/tilting_urg.json", cloud)
    cloud_picture(cloud, HERE / "room_240.png")


def emulated_room(angles: AngleSet, png: Path) -> None:
    """What one full scan in the furnished room of the twins gives, its ceiling taken off."""
    points = points_of(sw.simulate(angles), angles)
    points = points[points[:, 2] < 0.9]
    canvas = Canvas()
    canvas.points(points, height_colours((points[:, 2] - points[:, 2].min()) / 2), 1.6)
    middle = (points.min(0) + points.max(0)) / 2
    image = canvas.picture(SIZE, middle + np.array([-6.3, -5.2, 6.9]), middle, degrees=36)
    image.quantize(96).save(png, optimize=True)


if __name__ == "__main__":
    main()
