"""The pictures of README, made from a build and from a real recording.

    uv run scanwright build ground_ahead
    uv run scanwright accuracy ground_ahead
    SCANWRIGHT_DATA=... uv run python -m benchmarks.scanwright.pictures out/ground_ahead

Drawing the parts needs OpenGL without a screen (Debian: libegl1).
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread

HERE = Path(__file__).parents[1] / "pictures"


def main() -> None:
    """Write `scanner.png`, `work_precision.png` and `room_240.png`, as far as there is what they show."""
    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        rendered = Path(folder) / "assembly.png"
        render(build, rendered)
        side_by_side(rendered, build / "density.png", HERE / "scanner.png")
        diagram = build.parent / "accuracy" / build.name / "work_precision.png"
        if diagram.exists():
            shutil.copyfile(diagram, HERE / diagram.name)
        if "SCANWRIGHT_DATA" in os.environ:
            room(Path(os.environ["SCANWRIGHT_DATA"]), Path(folder), HERE / "room_240.png")


def render(build: Path, png: Path) -> None:
    """The assembly as it stands in the world, seen from the front left."""
    import cadquery as cq
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  registers the renderer
    from cadquery.occ_impl.assembly import toVTK
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkWindowToImageFilter

    from design.angles import load_angles

    T = load_angles(build / "angles.json").T_world_rot(0.0)
    matrix = np.vstack([np.hstack([T[:3, :3], T[:3, 3:] * 1000]), [0, 0, 0, 1]])
    world = cq.Assembly(name="world")
    world.add(
        cq.Assembly.importStep(str(build / "assembly.step")),
        loc=cq.Location(cq.Plane(origin=tuple(matrix[:3, 3]), xDir=tuple(matrix[:3, 0]), normal=tuple(matrix[:3, 2]))),
    )
    renderer = toVTK(world)
    renderer.SetBackground(1, 1, 1)
    renderer.SetBackground2(1, 1, 1)
    renderer.GradientBackgroundOff()
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(900, 1100)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(900, 1500, 600)
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    camera.Zoom(1.35)
    window.Render()
    shot = vtkWindowToImageFilter()
    shot.SetInput(window)
    shot.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetFileName(str(png))
    writer.SetInputConnection(shot.GetOutputPort())
    writer.Write()


def side_by_side(left: Path, right: Path, png: Path) -> None:
    """Two pictures of equal height in one."""
    pictures = [imread(left), imread(right)]
    ratios = [p.shape[1] / p.shape[0] for p in pictures]
    figure = Figure(figsize=(6 * sum(ratios), 6))
    for axis, picture in zip(figure.subplots(1, 2, width_ratios=ratios), pictures, strict=True):
        axis.imshow(picture)
        axis.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0, 0)
    figure.savefig(png, dpi=100, metadata={"Software": None})


def room(data: Path, folder: Path, png: Path) -> None:
    """Import and assemble the real recording, as the tour of README does."""
    from design.angles import load_angles
    from firmware_io.assembly.assemble import assemble_recording
    from firmware_io.clouds.picture import cloud_picture
    from firmware_io.recording.importer import import_bag

    recording, cloud = folder / "room.mcap", folder / "room.ply"
    bag = data / "tilting/room_240.bag"
    import_bag(bag, recording, scan="/slice:laserScan", angle="/slice:stepAngle", angle_unit="deg", hold=True)
    angles = Path(__file__).parents[2] / "design/angle_sets/tilting_urg.json"
    assemble_recording(recording, load_angles(angles), cloud)
    cloud_picture(cloud, png)


if __name__ == "__main__":
    main()
