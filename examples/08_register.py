"""Two stands of one scanner become one map: where the second one was is found from the clouds alone.

The scanner is simulated at two places of a room, the second turned by 40 deg; no start is given.
"""

from pathlib import Path

import numpy as np

import scanwright as sw
from scanwright.design.frames import Rz, apply, rigid
from scanwright.design.scene.ray_caster import build_scene
from scanwright.firmware_io.emulators.simulated import simulated_recording
from scanwright.firmware_io.emulators.world import furnished_room

TASK = {
    "name": "stands",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 4.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": -50, "beta_laser_deg": 35},
    "weight": [{"shape": "all"}],
}
STANDS = {"first": rigid(np.eye(3), (0, 0, 0)), "second": rigid(Rz(np.radians(40)), (0.8, 0.5, 0.05))}


def main() -> None:
    """Write a cloud of each stand, register them, and compare with where they were."""
    folder = Path("out/examples")
    folder.mkdir(parents=True, exist_ok=True)
    angles = sw.optimise(TASK).angle_set()
    room = furnished_room()  # triangles, (t, 3, 3)
    for name, T_room_world in STANDS.items():
        seen_from = apply(np.linalg.inv(T_room_world), room.reshape(-1, 3)).reshape(-1, 3, 3)
        seen = simulated_recording(angles, build_scene(seen_from))
        r = np.where(np.isfinite(seen.range_m), seen.range_m, np.nan).ravel()
        b = seen.bearing_rad.ravel()
        in_laser = np.stack([r * np.cos(b), r * np.sin(b), 0 * r, np.ones_like(r)], axis=1)
        points = np.einsum("nij,nj->ni", angles.T_world_laser(seen.joint_rad.ravel()), in_laser)[:, :3]
        sw.write_cloud(folder / f"{name}.ply", points)

    found = sw.register([folder / f"{name}.ply" for name in STANDS], folder / "map.ply")
    print("\n".join(found.lines()))
    error = np.linalg.inv(STANDS["second"]) @ found.registration.T_world[1]
    print(f"off by {1000 * np.linalg.norm(error[:3, 3]):.2f} mm and {np.degrees(abs(error[1, 0])):.4f} deg")


if __name__ == "__main__":
    main()
