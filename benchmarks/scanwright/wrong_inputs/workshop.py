"""Valid inputs of every kind, small, and the commands that take them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.motion import Spin
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import write_clouds
from scanwright.firmware_io.recording.convert import export_bag
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import Scan

FORMATS = ("ply", "pcd", "las", "laz", "e57", "npz", "xyz")
_START_NS = 1_763_000_000_000_000_000
_SCANS, _BEAMS, _PERIOD_NS = 60, 91, 25_000_000
_ROOM_M = (3.0, 2.0, 1.3)  # half its sides
_TASK = """
name = "small"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
[motion]
period_s = 2.0
[angles]
alpha_rot_deg = 0
beta_rot_deg = 90
alpha_laser_deg = 0
beta_laser_deg = [-90, 0]
step_deg = 45.0
[density]
ball_radius_deg = 3.0
[[weight]]
shape = "cone"
axis = [1, 0, -1]
half_angle_deg = 40
value = 2.0
[[mask]]
shape = "band"
theta_deg = [150, 180]
"""
_STUDY = """
name = "two"
tasks = ["task.toml"]
sensors = ["UTM-30LX", "UST-10LX"]
servos = ["MX-64R"]
slip_rings = ["SNU11-P0210"]
front = ["J", "mass_g"]
winners = 1
"""
_KEPT = """
{"schema": "scanwright/servo-settings/1", "port": "none", "model": "MX-64R", "protocol": "2.0", "id": 1,
 "settings": [{"register": "return_delay_time", "before": 250, "after": 0}]}
"""
_MAP = """
[[weight]]
shape = "map"
file = "{file}"
"""


@dataclass(frozen=True, slots=True)
class Job:
    """One command with valid inputs.

    Attributes:
        words: of the command; OUT stands for a new place, and files are named as in the workshop.
        files: of those, the ones that may be damaged.
        numbers: places in `words` of numbers that may be others.
        out: suffix of what it writes, "" for a folder, None where it writes nothing.
    """

    words: tuple[str, ...]
    files: tuple[str, ...]
    numbers: tuple[int, ...] = ()
    out: str | None = None


def jobs() -> list[Job]:
    """What is tried."""
    placed = ("assemble", "r.mcap", "--angles", "angles.json", "-o", "OUT")
    found = [
        Job((*placed, "--lag-s", "0.01"), ("r.mcap", "angles.json"), (7,), ".ply"),
        Job((*placed, "--poses", "poses.tum", "--organised"), ("poses.tum",), (), ".ply"),
        Job((*placed, "--poses", "poses.csv"), ("poses.csv",), (), ".ply"),
        Job(("assemble", "r.mcap", "--angles", "set/angles.json", "-o", "OUT"), ("set/own_body.npz",), (), ".ply"),
        Job(
            ("calibrate", "fine.mcap", "--angles", "angles.json", "-o", "OUT"),
            ("fine.mcap", "angles.json"),
            (),
            ".json",
        ),
        Job(("repair", "r.mcap", "-o", "OUT"), ("r.mcap",), (), ".mcap"),
        Job(("scan", "set", "--dry-run", "--turns", "2"), ("set/angles.json", "set/emulated.json"), (4,)),
        Job(("convert", "r.mcap", "OUT"), ("r.mcap",), (), ".bag"),
        Job(
            ("register", "a.ply", "b.ply", "--start", "start.tum", "-o", "OUT", "--spacing-m", "0.1"),
            ("start.tum",),
            (7,),
            ".ply",
        ),
    ]
    topics = ("--scan", "/scan", "--angle", "/joint_states:position[0]", "--angle-unit", "rad")
    found += [Job(("import", "bag.bag", *topics, "-o", "OUT"), ("bag.bag",), (), ".mcap")]
    axis = ("--angle", "axis.csv:rot_rad", "--angle-unit", "rad")
    found += [
        Job(("import", "bag.bag", "--scan", "/scan", *axis, "-o", "OUT"), ("axis.csv",), (), ".mcap"),
        Job(("assemble", "own.mcap", "--angles", "angles.json", "-o", "OUT"), ("own.mcap",), (), ".ply"),
        Job((*placed, "--max-range-m", "9", "--edges-deg", "8", "--outliers", "2"), (), (7, 9, 11), ".ply"),
        Job((*placed, "--voxel-m", "0.1", "--normals"), (), (7,), ".ply"),
        Job(("view", "r.mcap", "--angles", "angles.json", "-o", "OUT"), ("r.mcap", "angles.json"), (), ".mcap"),
        Job(("doctor", "--restore", "kept.json", "--servo", "none"), ("kept.json",)),
        Job(("catalogue", "--min-range-m", "5", "--max-mass-g", "900", "--max-price-usd", "900"), (), (2, 4, 6)),
        Job(("study", "study.toml", "--plan", "--results", "kept"), ("study.toml",)),
        Job(("compare", "task.toml", "--out", "compared"), ("task.toml",)),
    ]
    new = ("new", "mine", "--lidar", "UST-10LX", "--servo", "XM430-W350", "--height-m", "0.4", "-o", "OUT")
    seen = ("--see", "ground:0.5:5:3", "--see", "thing:0.1:3", "--scan-s", "2", "--robot", "box:0.6:0.4:0.2")
    found.append(Job((*new, *seen, "--ahead-m", "0.1"), (), (7, 11, 13, 15, 17, 19), ".toml"))
    for k, kind in enumerate(FORMATS):
        other = FORMATS[(k + 1) % len(FORMATS)]
        found.append(Job(("convert", f"a.{kind}", "OUT"), (f"a.{kind}",), (), f".{other}"))
        found.append(Job(("convert", f"a.{kind}", "OUT"), (f"a.{kind}",), (), ".ply"))
        found.append(Job(("register", f"a.{kind}", "b.ply", "-o", "OUT"), (f"a.{kind}",), (), f".{kind}"))
    judged = ("--angles", "0,90,0,-90")
    found += [
        Job(("evaluate", "task.toml", *judged), ("task.toml",)),
        Job(("evaluate", "task.toml", "--angles=0,90,0,-90"), (), (2,)),
        Job(("evaluate", "task.toml", *judged, "--pole", "50,1000,3"), (), (5,)),
        Job(("evaluate", "task.toml", *judged, "--lever", "10,5,3"), (), (5,)),
        Job(("evaluate", "task.toml", *judged, "--cloud", "OUT"), ("task.toml",), (), ".ply"),
        Job(("optimise", "task.toml"), ("task.toml",)),
    ]
    found += [
        Job(("evaluate", f"{kind}.toml", *judged), (f"{kind}.toml", f"map.{kind}")) for kind in ("csv", "npy", "png")
    ]
    return found


def furnish(folder: Path) -> None:
    """Write the valid inputs."""
    angles = AngleSet(
        task="small",
        angles_deg=Angles(alpha_rot=0, beta_rot=90, alpha_laser=0, beta_laser=-90),
        sensor="UTM-30LX",
        servo="MX-64R",
        motion=Spin(period_s=2.0),
    )
    (folder / "set").mkdir()
    for name in ("angles.json", "set/angles.json"):
        (folder / name).write_text(angles.to_json(), encoding="utf-8")
    _record(folder / "r.mcap")
    _record(folder / "own.mcap", own_beams=True)
    _record(folder / "fine.mcap", scans=320, beams=361, turns=2)
    rows = [f"{_START_NS + k * _PERIOD_NS},{np.pi * k * _PERIOD_NS / 1e9:.9f}" for k in range(_SCANS)]
    (folder / "axis.csv").write_text("time_ns,rot_rad\n" + "\n".join(rows) + "\n")
    (folder / "kept.json").write_text(_KEPT)
    (folder / "study.toml").write_text(_STUDY)
    bearing_rad = _bearings_rad(_BEAMS)
    hidden = np.zeros((_BEAMS, 720), bool)
    hidden[:4, ::3] = True
    np.savez(folder / "set/own_body.npz", beams=bearing_rad > 2, stator=hidden, bearing_rad=bearing_rad)
    (folder / "set/emulated.json").write_text('{"lidar": "/dev/pts/1", "servo": "/dev/pts/2", "pid": 1}\n')
    times = [_START_NS / 1e9 + second for second in (-1.0, 0.5, 1.0, 3.0)]
    rows = [f"{time:.6f} {k * 0.1} 0.5 0 0 0 0 1" for k, time in enumerate(times)]
    (folder / "poses.tum").write_text("# t x y z qx qy qz qw\n" + "\n".join(rows) + "\n")
    (folder / "poses.csv").write_text("t,x,y,z,qx,qy,qz,qw\n" + "\n".join(row.replace(" ", ",") for row in rows) + "\n")
    (folder / "start.tum").write_text("0 0 0 0 0 0 0 1\n1 0.5 0.3 0 0 0 0.0998334 0.9950042\n")
    one, two = _stand(np.zeros(3), 0.0, 1), _stand(np.array([0.5, 0.3, 0.0]), 0.2, 2)
    for kind in FORMATS:
        write_clouds(folder / f"a.{kind}", [one])
    write_clouds(folder / "b.ply", [two])
    export_bag(folder / "r.mcap", folder / "bag.bag")
    weights = np.outer(np.linspace(0, 1, 18), np.ones(36))
    np.savetxt(folder / "map.csv", weights, "%.3f", ",")
    np.save(folder / "map.npy", weights)
    Image.fromarray((255 * weights).astype(np.uint8)).save(folder / "map.png")
    (folder / "task.toml").write_text(_TASK)
    for kind in ("csv", "npy", "png"):
        (folder / f"{kind}.toml").write_text(_TASK + _MAP.format(file=f"map.{kind}"))


def _bearings_rad(beams: int) -> np.ndarray:
    return np.linspace(-2.0, 2.5, beams)


def _record(
    path: Path, *, scans: int = _SCANS, beams: int = _BEAMS, turns: float = 0.75, own_beams: bool = False
) -> None:
    """A room of flat walls, seen by a laser that rolls; each scan with bearings and times of its own, if asked."""
    rng = np.random.default_rng(0)
    bearing_rad, step_ns = _bearings_rad(beams), 9_000_000 // (beams - 1)
    with recording_writer(path, {"source": "wrong inputs"}) as writer:
        for k in range(scans):
            stamp_ns = _START_NS + k * _PERIOD_NS
            joint_rad = 2 * np.pi * turns * k / scans
            flat = np.stack([np.cos(bearing_rad), np.sin(bearing_rad), 0 * bearing_rad], axis=1)
            turned = np.stack([flat[:, 0], np.cos(joint_rad) * flat[:, 1], np.sin(joint_rad) * flat[:, 1]], axis=1)
            range_m = _ranges_m(np.zeros(3), turned) + rng.normal(0, 0.005, beams)
            range_m[rng.random(beams) < 0.05] = np.nan
            writer.joint(stamp_ns, joint_rad)
            offset_ns = step_ns * np.arange(beams) + rng.integers(0, step_ns // 2, beams)
            writer.scan(
                Scan(
                    stamp_ns=stamp_ns,
                    angle_min_rad=-2.0,
                    angle_increment_rad=4.5 / (beams - 1),
                    time_increment_s=step_ns / 1e9,
                    scan_time_s=_PERIOD_NS / 1e9,
                    range_min_m=0.1,
                    range_max_m=30.0,
                    range_m=range_m.astype(np.float32),
                    intensity=rng.uniform(0, 4000, beams).astype(np.float32),
                    beam_bearing_rad=bearing_rad if own_beams else None,
                    beam_offset_ns=offset_ns if own_beams else None,
                )
            )


def _ranges_m(at: np.ndarray, to: np.ndarray) -> np.ndarray:
    """How far the walls of the room are."""
    with np.errstate(divide="ignore"):
        return np.min(np.where(to > 0, (np.array(_ROOM_M) - at) / to, (-np.array(_ROOM_M) - at) / to), axis=1)


def _stand(at: np.ndarray, yaw_rad: float, seed: int) -> Cloud:
    """A room from a place in it, organised, some rows without a point."""
    rng = np.random.default_rng(seed)
    height, width = 90, 120
    theta, phi = np.meshgrid(np.linspace(0.2, 2.9, height), np.linspace(-np.pi, np.pi, width), indexing="ij")
    to = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=2).reshape(-1, 3)
    turn = np.array([[np.cos(yaw_rad), -np.sin(yaw_rad), 0], [np.sin(yaw_rad), np.cos(yaw_rad), 0], [0, 0, 1]])
    points_m = to * (_ranges_m(at, to @ turn.T) + rng.normal(0, 0.005, len(to)))[:, None]
    points_m[rng.random(len(points_m)) < 0.05] = np.nan
    columns: dict[str, NDArray[Any]] = {
        "intensity": rng.uniform(0, 4000, len(to)).astype(np.float32),
        "time_s": np.linspace(0, 2, len(to)),
        "ring": np.tile(np.arange(width), height).astype(np.uint16),
    }
    T_world_cloud = np.eye(4)
    T_world_cloud[:3, :3], T_world_cloud[:3, 3] = turn, at
    return Cloud(points_m.astype(np.float32), columns, (height, width), T_world_cloud, _START_NS)
