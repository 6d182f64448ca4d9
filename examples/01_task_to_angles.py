"""From what matters to four angles: a task as a table, the search, and what simple mounts would give.

A task says which 2D lidar on which servo, how the servo moves, which angles may be chosen, and what matters. Here the
axis stands upright, and the floor around a small robot counts.
"""

import scanwright as sw

TASK = {
    "name": "floor_around",
    "sensor": "UST-10LX",
    "servo": "MX-64R",
    "slip_ring": "SNU11-P0210",
    "motion": {"mode": "spin", "period_s": 4.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "step_deg": 10},  # the other two are searched
    "weight": [{"shape": "band", "theta_deg": [95, 150]}],  # theta: 0 is up, 90 the horizon, 180 down
}


def main() -> None:
    """Search, and compare with the mounts that one would build without a search."""
    optimum = sw.optimise(TASK)
    best = optimum.search.best[0]
    print("alpha_rot, beta_rot, alpha_laser, beta_laser [deg]:", best.angles_deg)

    for gain in optimum.gains:  # the best of these mounts first
        print(f"{gain.factor:.2f} times the beams where it matters, against {gain.mount.name}")

    angles = optimum.angle_set()  # what parts, frame chain and clouds are made from
    print(f"one full scan takes {angles.motion.duration_s:g} s; J = {angles.J} +- {angles.J_error}")


if __name__ == "__main__":
    main()
