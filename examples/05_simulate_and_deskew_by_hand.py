"""The frame chain in NumPy alone: from ranges, bearings and servo angles to points, nothing of the library in between.

Run it to check the conventions, or your own program against them: the distance between the points made here and those
of `T_world_laser` is printed, and how far the points lie from the walls of the room that was simulated.
"""

import numpy as np

import scanwright as sw

ANGLES_DEG = {"alpha_rot": -15.0, "beta_rot": -55.0, "alpha_laser": -85.0, "beta_laser": 30.0}
TASK = {
    "name": "by_hand",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 1.0},
    "angles": {f"{name}_deg": value for name, value in ANGLES_DEG.items()},
    "weight": [{"shape": "all"}],
}


def turn(axis: int, angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotations about x (0), y (1) or z (2), counter-clockwise seen from the tip of the axis, shape (..., 3, 3)."""
    angle = np.asarray(angle_rad, dtype=float)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((*angle.shape, 3, 3))
    R[..., axis, axis] = 1
    R[..., j, j] = R[..., k, k] = np.cos(angle)
    R[..., k, j], R[..., j, k] = np.sin(angle), -np.sin(angle)
    return R


def main() -> None:
    """Simulate a turn in the furnished room, and put every beam where it belongs."""
    angles = sw.optimise(TASK).angle_set()
    seen = sw.simulate(angles, noise_mm=0.0)  # time, bearing and range of each beam, and the log of the servo
    r = np.where(np.isfinite(seen.range_m), seen.range_m, np.nan)  # inf where nothing came back
    b = seen.bearing_rad
    gamma = np.interp(seen.time_ns, seen.joint_log.time_ns, seen.joint_log.position_rad)  # beam by beam: de-skew

    a_rot, b_rot, a_laser, b_laser = np.radians(list(ANGLES_DEG.values()))
    R_world_rot = turn(0, a_rot) @ turn(1, b_rot) @ turn(2, gamma)
    R_rot_laser = turn(1, b_laser) @ turn(0, a_laser)
    in_laser = np.stack([r * np.cos(b), r * np.sin(b), 0 * r], axis=-1)
    points_m = np.einsum("...ij,...j->...i", R_world_rot @ R_rot_laser, in_laser)
    points_m += np.array(angles.t_world_rot_mm) / 1000

    T = angles.T_world_laser(gamma.ravel())
    library_m = np.einsum("nij,nj->ni", T[:, :3, :3], in_laser.reshape(-1, 3)) + T[:, :3, 3]
    print(f"{np.isfinite(r).sum():,} points of {r.size:,} beams")
    print(f"at most {1e6 * np.nanmax(abs(points_m.reshape(-1, 3) - library_m)):.3f} um from the library's")
    floor_m = points_m[..., 2][points_m[..., 2] < -0.895]
    print(f"the floor of the room, at -0.9 m, is seen within {1000 * np.abs(floor_m + 0.9).max():.3f} mm")


if __name__ == "__main__":
    main()
