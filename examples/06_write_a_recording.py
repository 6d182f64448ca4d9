"""A lidar or servo without a driver here: write what your own program read as a recording, and assemble it.

A recording holds two kinds of messages: scans, with the time of their first beam, and angles of the servo, with theirs.
Times are nanoseconds since 1970. Here both come from a simulation; put your own device in its place.
"""

from pathlib import Path

import numpy as np

import scanwright as sw
from scanwright.firmware_io.recording.arrays import RecordingArrays
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import Scan

TASK = {
    "name": "own_device",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 2.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 30, "alpha_laser_deg": 80, "beta_laser_deg": 35},
    "weight": [{"shape": "all"}],
}
START_NS = 1_700_000_000_000_000_000


def write(seen: RecordingArrays, path: Path, start_ns: int = START_NS) -> None:
    """Scans and angles as messages, in the order of their times."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = seen.joint_log
    messages = [(int(t), "angle", k) for k, t in enumerate(log.time_ns)]
    messages += [(int(t), "scan", k) for k, t in enumerate(seen.time_ns[:, 0])]
    with recording_writer(path, {"source": "examples/06_write_a_recording.py"}) as recording:
        for time_ns, kind, k in sorted(messages):
            if kind == "angle":
                recording.joint(start_ns + time_ns, float(log.position_rad[k]))
                continue
            scan = Scan(
                stamp_ns=start_ns + time_ns,
                angle_min_rad=float(seen.bearing_rad[k, 0]),
                angle_increment_rad=float(np.diff(seen.bearing_rad[k, :2])[0]),
                time_increment_s=float(np.diff(seen.time_ns[k, :2])[0]) / 1e9,
                scan_time_s=0.025,
                range_min_m=0.1,
                range_max_m=30.0,
                range_m=seen.range_m[k],  # NaN, inf or 0 where nothing came back
                intensity=np.empty(0, np.float32),
            )
            recording.scan(scan)


def main() -> None:
    """Write a recording of one turn, and make its cloud."""
    angles = sw.optimise(TASK).angle_set()
    path = Path("out/examples/own_device.mcap")
    write(sw.simulate(angles), path)
    print("\n".join(sw.assemble(path, angles, path.with_suffix(".ply")).lines()))


if __name__ == "__main__":
    main()
