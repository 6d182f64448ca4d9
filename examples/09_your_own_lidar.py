"""A lidar that the catalogue does not have: a file beside the task, each value with where it comes from.

Only what a data sheet says is needed to choose angles; the measures of the body are needed to make parts. `sw.evaluate`
then judges any way to mount it.
"""

from pathlib import Path

import scanwright as sw

LIDAR = """
kind = "lidar"
name = "MY-LIDAR"
maker = "me"
steps_per_turn = { value = 720, source = "data sheet, p. 3", verified = true }
first_step = { value = 0, source = "data sheet, p. 3", verified = true }
last_step = { value = 360, source = "data sheet, p. 3", verified = true }
front_step = { value = 180, source = "data sheet, p. 3", verified = true }
scan_rate_hz = { value = 15.0, source = "data sheet, p. 2", verified = true }
range_min_mm = { value = 50.0, source = "data sheet, p. 2", verified = true }
range_max_mm = { value = 8000.0, source = "data sheet, p. 2", verified = true }
range_sigma_mm = { value = 15.0, source = "a wall at 4 m, 1000 scans", verified = true }
mass_g = { value = 190.0, source = "kitchen scale", verified = true }
body_mm = { value = [50.0, 50.0, 70.0], source = "calliper", verified = true }
optical_height_mm = { value = 47.4, source = "calliper, window's middle", verified = true }
window_z_mm = { value = [35.0, 60.0], source = "calliper", verified = true }
window_radius_mm = { value = 22.0, source = "calliper", verified = true }
mount_screw = { value = "M3", source = "tried", verified = true }
mount_holes_mm = { value = [[20, 20], [-20, 20], [-20, -20], [20, -20]], source = "calliper", verified = true }
mount_thread_depth_mm = { value = 5.0, source = "tried", verified = true }
cable_y_mm = { value = [0.0], source = "calliper", verified = true }
cable_z_mm = { value = 9.0, source = "calliper", verified = true }
cable_diameter_mm = { value = 6.0, source = "calliper", verified = true }
cable_straight_mm = { value = 20.0, source = "bent it", verified = true }
"""
TASK = """
name = "own_lidar"
sensor = "MY-LIDAR"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
catalogue = ["my_lidar.toml"]
[motion]
period_s = 10.0
[angles]
alpha_rot_deg = 0
beta_rot_deg = 0
[[weight]]
shape = "band"
theta_deg = [60, 120]
"""


def main() -> None:
    """Write both files, and judge a lidar that leans by 45 deg on an upright axis."""
    folder = Path("out/examples")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "my_lidar.toml").write_text(LIDAR)
    (folder / "own_lidar.toml").write_text(TASK)

    task = sw.load_task(folder / "own_lidar.toml")
    print(f"{task.lidar.name}: {len(task.lidar.bearings_rad())} beams, {task.lidar.scan_rate_hz:g} scans a second")
    print("\n".join(sw.evaluate(task, (0, 0, 90, 45)).lines()))


if __name__ == "__main__":
    main()
