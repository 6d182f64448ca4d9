"""A scan without hardware: twins of servo and lidar speak their protocols on ports, in real time, and `scan` records.

With hardware the same line is `sw.scan(folder)`, or with names: `sw.scan(folder, lidar="192.168.0.10:10940",
servo="/dev/serial/by-id/...")`. The folder needs no more than an `angles.json`.
"""

from pathlib import Path

import scanwright as sw
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.world import room

TASK = {
    "name": "twins",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 2.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": -50, "beta_laser_deg": 35},
    "weight": [{"shape": "all"}],
}


def main() -> None:
    """Turn once in a furnished room, and look at the cloud."""
    folder = Path("out/examples/twins")
    folder.mkdir(parents=True, exist_ok=True)
    angles = sw.optimise(TASK).angle_set()
    (folder / "angles.json").write_text(angles.to_json())

    with emulated_scanner(angles, room(None)) as twins:
        scanned = sw.scan(folder, lidar=twins.ports.lidar, servo=twins.ports.servo, recording=folder / "turn.mcap")
    print("\n".join([*scanned.recorded.lines(), *scanned.assembled.lines()]))

    cloud = sw.read_cloud(folder / "turn.ply")
    print(f"{len(cloud.points_m):,} points; columns {', '.join(cloud.columns)}")


if __name__ == "__main__":
    main()
