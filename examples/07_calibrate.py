"""Mounting errors from a scan of any room, without targets: what was tilted and shifted comes back, with its sigma.

A scanner is never built exactly as it was designed. Here a simulated one is off by 0.4 and -0.3 deg and by 2 and
-1.5 mm; the recording is taken with it, and calibrated from the angles as designed.
"""

from importlib import import_module
from pathlib import Path

import numpy as np

import scanwright as sw

TASK = {
    "name": "off",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 3.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": 80, "beta_laser_deg": 40},
    "weight": [{"shape": "all"}],
}
BUILT = {"delta_rotvec_rot_deg": (0.4, -0.3), "t_rot_laser_mm": (2.0, -1.5, 0.0)}


def main() -> None:
    """Record with the scanner as built, calibrate from the scanner as designed."""
    designed = sw.optimise(TASK).angle_set()
    built = designed.model_copy(update=BUILT)
    recording = Path("out/examples/off.mcap")
    import_module("06_write_a_recording").write(sw.simulate(built, noise_mm=5.0), recording)

    found = sw.calibrate([recording], designed, recording.with_name("angles.calibrated.json"))
    print("\n".join(found.lines()))

    sigma = np.sqrt(np.diag(found.angles.covariance)) * [180 / np.pi, 180 / np.pi, 1000, 1000]
    estimate = [*found.angles.delta_rotvec_rot_deg, *found.angles.t_rot_laser_mm[:2]]
    truth = [*BUILT["delta_rotvec_rot_deg"], *BUILT["t_rot_laser_mm"][:2]]
    for name, got, true, error in zip(("x [deg]", "y [deg]", "x [mm]", "y [mm]"), estimate, truth, sigma, strict=True):
        print(f"{name:8} built {true:6.3f}, found {got:6.3f} +- {error:.3f}")


if __name__ == "__main__":
    main()
