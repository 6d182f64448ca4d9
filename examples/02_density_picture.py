"""Where the beams of one full scan go: a map of directions for three ways to mount the same lidar.

Brightness is the number of beams within 2 deg of a direction, white is never seen, hatched is hidden by the robot
itself; the frame is the region that the task weighs. The last map is the first one over the second.
"""

from pathlib import Path

import scanwright as sw

SETTINGS_DEG = {  # alpha_rot, beta_rot, alpha_laser, beta_laser
    "the optimum of this task": (180, 55.6, 78.7, -79.8),
    "rolling: about the line ahead": (0, 90, 0, -90),
    "pitching: nodding about the left": (-90, 0, 90, 0),
}


def main() -> None:
    """Write `out/examples/density.png`, and say what the picture cannot: the numbers."""
    target = Path("out/examples/density.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    sw.draw_density("ground_ahead", SETTINGS_DEG).savefig(target)
    print(f"wrote {target}")

    for name, angles_deg in SETTINGS_DEG.items():
        found = sw.evaluate("ground_ahead", angles_deg)
        print(f"{name}: J = {found.score.J:.3f}, the fewest beams anywhere that matters: {found.score.least:.0f}")


if __name__ == "__main__":
    main()
