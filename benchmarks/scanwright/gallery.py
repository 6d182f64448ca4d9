"""The gallery of the docs: eight tasks for eight uses, each with its result, its scanner and a scan of its world.

    uv run python -m benchmarks.scanwright.gallery [NAME...]

`scanwright new` writes a task that is not shipped, with the options on the page. Every one is built into
`out/`, its scanner drawn from `assembly.glb`, and every beam of one full scan cast in the world of
`gallery_worlds.py`, with the noise of the data sheet. Writes `docs/gallery.md` and its pictures; with names only those
are made anew, and the others are taken from `out/`. Needs OpenGL without a screen (Debian: libegl1).
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import matplotlib
import numpy as np
import trimesh
from PIL import Image

import scanwright as sw
from benchmarks.scanwright import gallery_worlds as worlds
from benchmarks.scanwright.canvas import Canvas
from benchmarks.scanwright.robot_picture import points_of, scanner_bodies
from scanwright.cad.checks.checks_json import read_checks
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array
from scanwright.design.scene.ray_caster import build_scene
from scanwright.design.self_occlusion import load_self_occlusion
from scanwright.design.task.task import load_task
from scanwright.firmware_io.emulators.simulated import simulated_recording
from scanwright.report.answer import answer
from scanwright.report.first_screen import cards

DOCS = Path(__file__).parents[2] / "docs"
OUT = Path("out")
SCANNER_PX, CLOUD_PX = (400, 440), (760, 440)
RED = (0.85, 0.1, 0.1)
TOWARDS_EYE = np.array([0.75, 0.55, 0.35]) / np.linalg.norm([0.75, 0.55, 0.35])
FEW = 60_000  # points, below which each is drawn larger


@dataclass(frozen=True, slots=True)
class Entry:
    """One task of the gallery.

    Attributes:
        name: of the task.
        title: of its section of the page.
        words: options of `scanwright new`; none for a shipped task.
        world: makes the bodies around it.
        height_m: of the optical centre in that world.
        shown: which points [m], shape (n, 3), are drawn, as booleans, so that one looks into rooms.
        eye: from where [m].
        target: where to [m].
        degrees: how wide.
        learnt: the lesson of this task.
    """

    name: str
    title: str
    words: str
    world: Callable[[], list[trimesh.Trimesh]]
    height_m: float
    shown: Callable[[Array], Array]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    degrees: float
    learnt: str


ENTRIES = (
    Entry(
        "ground_ahead",
        "The paper's: ground ahead of a robot",
        "",
        worlds.yard,
        0.62,
        lambda p: (abs(p[:, 1]) < 4) & (p[:, 0] > -3) & (p[:, 0] < 5.2),
        (-3.6, -3.4, 3.0),
        (1.6, 0, 0.1),
        34,
        "The mount with the lowest J alone is blind in a cone of 0.47 deg in the middle of the region. The best mount"
        " without a blind spot costs 0.097 % of the beams per ball (`scanwright optimise ground_ahead`). Hanging and "
        "upright builds have the same J; the build is the one whose parts block fewer beams.",
    ),
    Entry(
        "quadruped",
        "A quadruped: ground 0.5 to 5 m ahead, and the ceiling",
        "--lidar UST-20LX --servo XM430-W350 --height-m 0.4 --see ground:0.5:5 --see ceiling "
        "--robot box:0.7:0.35:0.3 --ahead-m 0.25 --scan-s 4",
        worlds.lobby,
        0.4,
        lambda p: (p[:, 2] < 2.2) & (p[:, 1] > -2.1),
        (-3.6, -5.0, 4.6),
        (1.2, 0.1, 0.5),
        36,
        "An upright axis with one tilt would have 1.2 times the beams if its parts blocked none. In 4 s the gaps "
        "are wide at 3 m: a longer scan closes them. Three lengths are enough to describe the part of the robot "
        "that blocks beams.",
    ),
    Entry(
        "mine",
        "A mine: all around a cart",
        "--lidar UTM-30LX --servo MX-64R --height-m 1.2 --see around:60:45 --scan-s 10",
        worlds.gallery_of_a_mine,
        1.2,
        lambda p: (p[:, 1] > -1.0) & (abs(p[:, 0]) < 11),
        (-7.0, -8.0, 4.2),
        (-0.6, 0.6, 1.1),
        42,
        "For a band all around the best axis is upright. The scan plane leans 57 deg, and a second angle of 17 "
        "deg gains 15 % over one tilt alone.",
    ),
    Entry(
        "forest_plot",
        "A forest plot: stems around a tripod",
        "--lidar UTM-30LX --servo MX-64R --height-m 1.4 --see around:75:40 --scan-s 30",
        worlds.forest,
        1.4,
        lambda p: p[:, 2] < 9,
        (-17, -15, 13),
        (0, 0, 1.5),
        44,
        "The band is like that of the mine but steeper, so the plane is tilted more: 73 deg instead of 57, and "
        "here one tilt is as good. At half a minute a turn the lines are less than 3 cm apart on a stem 5 m away. "
        "The period is one number of the task.",
    ),
    Entry(
        "ceiling",
        "A hall, from its ceiling",
        "",
        worlds.hall,
        4.5,
        lambda p: (p[:, 2] < 4.0) & (p[:, 0] > -5.9) & (p[:, 1] > -4.4),
        (-9.0, -9.5, 8.5),
        (0.3, 0.2, 0.9),
        37,
        "The ceiling fixes the axis, so only two angles are searched: 1,369 mounts instead of 3.7 million. One of the"
        " two is enough: a tilt alone loses nothing.",
    ),
    Entry(
        "stairs",
        "Stairs in front of a small climber",
        "--lidar URG-04LX-UG01 --servo XL430-W250 --height-m 0.35 --see thing:0.03:2 --see ground:0.4:2.5:1.5 "
        "--scan-s 9",
        worlds.stairwell,
        0.35,
        lambda p: (p[:, 1] > -0.68) & (p[:, 2] < 2.4) & (p[:, 0] < 4.7) & (p[:, 0] > -1.1),
        (-1.7, -3.6, 3.2),
        (1.7, 0.1, 0.75),
        42,
        "One tilt of an upright axis is nearly as good, and easier to build. At 3 s there would be 30 lines "
        "instead of 90, so this climber stands still for 9 s.",
    ),
    Entry(
        "shelf",
        "A shelf, with the cheap scanner",
        "--lidar STL27L --servo XL430-W250 --height-m 1.2 --see wall:1.2:3 --scan-s 8",
        worlds.rack,
        1.2,
        lambda p: (p[:, 0] > 0.9) & (abs(p[:, 1]) < 1.9) & (p[:, 2] < 2.5),
        (-2.6, -1.6, 2.0),
        (1.3, 0, 1.1),
        38,
        "Rolling would have 1.06 times the beams if its parts blocked none, and `compare` shows this before you "
        "print anything. A lidar with a view of 360 deg sees its own mount in every scan. These beams are known "
        "and dropped.",
    ),
    Entry(
        "landing_pad",
        "A landing pad, from a drone 4 m over it",
        "--lidar UTM-30LX --servo MX-64R --height-m 4 --see ground:-3:3:6 --scan-s 4",
        worlds.landing_place,
        4.0,
        lambda p: np.hypot(p[:, 0], p[:, 1]) < 4.5,
        (-4.2, -5.6, 5.0),
        (0, 0, 0.1),
        40,
        "The axis points straight down, and one tilt of the scan plane is enough. Straight below, where the axis "
        "points, objects smaller than 28 cm can be missed.",
    ),
)


def main() -> None:
    """Write page and pictures."""
    wanted = set(sys.argv[1:]) or {entry.name for entry in ENTRIES}
    (DOCS / "pictures/gallery").mkdir(exist_ok=True)
    parts = []
    for entry in ENTRIES:
        folder = OUT / entry.name
        if entry.name in wanted:
            made(entry)
            picture(entry, folder).quantize(160).save(DOCS / f"pictures/gallery/{entry.name}.png", optimize=True)
        parts.append(section(entry, folder))
        print(parts[-1], flush=True)
    (DOCS / "gallery.md").write_text("\n".join([INTRODUCTION, *parts]), encoding="utf-8")


INTRODUCTION = """# Gallery

Eight tasks for eight uses, with the scanner that was built for each. Choose the one most like yours as a start.

Each picture shows the scanner on the left, and one full scan of a simulated world on the right, with the noise of
the data sheet. The red ball is the scanner, larger than in reality. `python -m benchmarks.scanwright.gallery` makes
this page: tasks, parts, scans, pictures and figures. A slip ring on a servo of the X series needs more parts, so `new`
writes a sweep for them.
"""


def made(entry: Entry) -> None:
    """Build the task."""
    task: str | Path = entry.name
    if entry.words:
        task = OUT / f"{entry.name}.toml"
        task.unlink(missing_ok=True)
        words = ["new", entry.name, *shlex.split(entry.words), "-o", str(task)]
        subprocess.run([sys.executable, "-m", "scanwright", *words], check=True, capture_output=True)
    if failed := sw.build(task, OUT, progress=print).failed:
        sys.exit(f"{entry.name}: {failed[0].message}")


def picture(entry: Entry, folder: Path) -> Image.Image:
    """Return the scanner, with its cloud to the right."""
    both = Image.new("RGB", (SCANNER_PX[0] + CLOUD_PX[0], CLOUD_PX[1]), "white")
    both.paste(scanner(folder / "assembly.glb"), (0, 0))
    both.paste(cloud(entry, sw.load_angles(folder / "angles.json")), (SCANNER_PX[0], 0))
    return both


def scanner(glb: Path) -> Image.Image:
    """The assembly from the front left, whole in the picture."""
    canvas = Canvas()
    bodies = scanner_bodies(glb)
    for body, colour in bodies:
        canvas.mesh(body, colour)
    low = np.min([body.bounds[0] for body, _ in bodies], axis=0)
    high = np.max([body.bounds[1] for body, _ in bodies], axis=0)
    middle, corners = (low + high) / 2, np.concatenate([body.vertices for body, _ in bodies])
    right = np.cross([0, 0, 1], TOWARDS_EYE) / np.hypot(*TOWARDS_EYE[:2])
    up = np.cross(TOWARDS_EYE, right)
    across, tall = ((corners - middle) @ axis for axis in (right, up))
    target = middle + right * (across.min() + across.max()) / 2 + up * (tall.min() + tall.max()) / 2
    half = max(np.ptp(tall), np.ptp(across) * SCANNER_PX[1] / SCANNER_PX[0]) / 2
    return canvas.picture(SCANNER_PX, target + 2 * TOWARDS_EYE, target, parallel=1.06 * float(half))


def cloud(entry: Entry, angles: AngleSet) -> Image.Image:
    """One full scan, coloured by height."""
    up = np.array([0, 0, entry.height_m])
    triangles = np.concatenate([body.triangles for body in entry.world()]) - up
    points = points_of(simulated_recording(angles, build_scene(triangles)), angles) + up
    points = points[entry.shown(points)]
    low, high = np.percentile(points[:, 2], (1, 99))
    canvas = Canvas()
    colours = matplotlib.colormaps["viridis"](np.clip((points[:, 2] - low) / max(high - low, 0.1), 0, 1) * 0.9)
    canvas.points(points, colours[:, :3], 2.4 if len(points) < FEW else 1.5)
    ball = trimesh.creation.icosphere(3, 0.012 * float(np.linalg.norm(np.subtract(entry.eye, entry.target))))
    ball.apply_translation(up)
    canvas.mesh(ball, RED, light=0.6)
    return canvas.picture(CLOUD_PX, np.array(entry.eye), np.array(entry.target), degrees=entry.degrees)


def section(entry: Entry, folder: Path) -> str:
    """Its part of the page."""
    loaded, angles = load_task(folder / "task.toml"), sw.load_angles(folder / "angles.json")
    shadow = load_self_occlusion(folder / "own_body.npz")[0]
    first_three = cards(angles, answer(loaded, angles, shadow, read_checks(folder / "checks.json")), None)[:3]
    result = [f"{card.headline}. {card.text}" for card in first_three]
    found = angles.angles_deg
    four = (found.alpha_rot, found.beta_rot, found.alpha_laser, found.beta_laser)
    words = (
        f"new {entry.name} {entry.words}\n$ scanwright build {entry.name}.toml"
        if entry.words
        else f"build {entry.name}"
    )
    mount = f"Axis {four[0]:g}, {four[1]:g} deg; scan plane {four[2]:g}, {four[3]:g} deg."
    points = "\n".join(fill(f"- {sentence}", 119, subsequent_indent="  ") for sentence in (mount, *result))
    return f"""## {entry.title}

```console
$ scanwright {words}
```

![The scanner of {entry.name}, and one full scan of its world](pictures/gallery/{entry.name}.png)

{points}

{fill(entry.learnt, 119)}
"""


if __name__ == "__main__":
    main()
