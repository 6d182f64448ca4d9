"""The part that carries the lidar, as a shape of CadQuery: measure it, change it, write it.

Nothing is written by `make_parts`; the shapes are in the rotation frame, in millimetres, the origin at the point that
the beams start from, z the axis.
"""

from pathlib import Path

import cadquery as cq

import scanwright as sw

TASK = {
    "name": "linkage",
    "sensor": "URG-04LX",
    "servo": "AX-12A",
    "motion": {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 12.0, "accel_deg_s2": 200.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": 0, "beta_laser_deg": -60},
    "density": {"ball_radius_deg": 3.0, "tolerance": 0.01},
    "weight": [{"shape": "band", "theta_deg": [45, 135]}],
}


def main() -> None:
    """Make the parts, drill one more hole into the linkage, and write it as STL."""
    parts = sw.make_parts(TASK, sw.optimise(TASK).angle_set())
    print("to make:", ", ".join(parts.made), "- to buy:", ", ".join(parts.bought))

    linkage = parts.made["alignment_linkage"]
    box = linkage.BoundingBox()
    print(f"linkage: {linkage.Volume() / 1000:.1f} cm3 in {box.xlen:.0f} x {box.ylen:.0f} x {box.zlen:.0f} mm")

    hole = cq.Workplane().circle(1.0).extrude(500, both=True).val()  # along the axis
    drilled = linkage.cut(hole)
    target = Path("out/examples/linkage.stl")
    target.parent.mkdir(parents=True, exist_ok=True)
    drilled.exportStl(str(target), tolerance=0.05)
    print(f"wrote {target}, {linkage.Volume() - drilled.Volume():.1f} mm3 lighter")


if __name__ == "__main__":
    main()
