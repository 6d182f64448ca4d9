"""Is the density of every fan of the catalogue what a scan has? Beams counted in balls, lidar by lidar.

    uv run python -m benchmarks.design.fans [DIRECTIONS, 3000] [SEED, 1]

Each lidar gets a random setting, once around in 20 s. A simulated recording of a closed box, beam by beam at the axis
angle of its own time, gives the directions in which it measured; those within 2 deg of random directions are
counted by a k-d tree. Beside that stands the mean density that the optimiser computes, which knows neither. Printed are
the mean of both over the directions, their ratio, and the standard error of that by tenths of the directions.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.motion import Spin
from scanwright.design.objective.problem import problem_of
from scanwright.design.scene.ray_caster import build_scene
from scanwright.design.task.task import LoadedTask, Task
from scanwright.firmware_io.emulators.simulated import simulated_recording

PERIOD_S, BALL_DEG, BOX_M, TENTHS = 20.0, 2.0, 3.0, 10
SERVO = "MX-64R"


def main() -> None:
    """Print the table."""
    directions = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    print("lidar           beams per ball: counted  computed   ratio  +-")
    for lidar in sorted((one for one in load_catalogue() if isinstance(one, Lidar)), key=lambda one: one.name):
        setting_deg = rng.uniform([-180, -90, -90, -90], [180, 90, 90, 90]).round(2)
        towards = rng.normal(size=(directions, 3))
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        found, computed = counted(lidar.name, setting_deg, towards), density(lidar.name, setting_deg, towards)
        ratios = [one.mean() / other.mean() for one, other in zip(_parts(found), _parts(computed), strict=True)]
        ratio, error = found.mean() / computed.mean(), np.std(ratios, ddof=1) / TENTHS**0.5
        print(f"{lidar.name:22} {found.mean():16.2f} {computed.mean():9.2f} {ratio:7.4f}  {error:.4f}", flush=True)


def counted(lidar: str, setting_deg: Array, towards: Array) -> Array:
    """Beams of one simulated turn within the ball of each direction."""
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    found = Angles(**dict(zip(names, setting_deg.tolist(), strict=True)))
    angles = AngleSet(task="fans", angles_deg=found, sensor=lidar, servo=SERVO, motion=Spin(period_s=PERIOD_S))
    walls = trimesh.creation.box((BOX_M, BOX_M, BOX_M)).triangles
    recording = simulated_recording(angles, build_scene(walls), sigma_mm=0.0)
    bearing = recording.bearing_rad
    fan = np.stack([np.cos(bearing), np.sin(bearing), np.zeros_like(bearing)], axis=-1)
    seen = np.isfinite(recording.range_m)
    R = angles.T_world_laser(recording.joint_rad[seen])[:, :3, :3]
    tree = cKDTree(np.einsum("nij,nj->ni", R, fan[seen]))
    within = 2 * np.sin(np.radians(BALL_DEG) / 2)
    return np.asarray(tree.query_ball_point(towards, within, return_length=True), float)


def density(lidar: str, setting_deg: Array, towards: Array) -> Array:
    """What the optimiser takes for it."""
    task = {
        "name": "fans",
        "sensor": lidar,
        "servo": SERVO,
        "motion": {"period_s": PERIOD_S},
        "weight": [{"shape": "all"}],
        "density": {"ball_radius_deg": BALL_DEG},
    }
    problem = problem_of(LoadedTask(Task.model_validate(task), Path(), load_catalogue(), ()))
    return mean_density_at(problem, np.radians(setting_deg), towards)


def _parts(values: Array) -> list[Array]:
    return np.array_split(values, TENTHS)


if __name__ == "__main__":
    main()
