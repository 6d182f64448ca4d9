"""`scanner.urdf`: the frame chain world - servo - spin_joint - rot - laser with meshes, masses and inertias.

    world --fixed--> servo --spin_joint, about z--> rot --fixed--> laser

The origins of `servo` and `rot` are the optical centre, so every mesh, made in the rotation frame, has the identity as
its pose. Transforms are those of the angle set. SI units.
"""

import math
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.drive import DriveLayout, Rod
from scanwright.cad.layout.envelope import Box
from scanwright.design.arrays import Array
from scanwright.design.frames import roll_pitch_yaw
from scanwright.design.motion import Sweep
from scanwright.design.scanner import Scanner


def urdf_text(scanner: Scanner, drive: DriveLayout, bodies: dict[str, Inertial], meshes: dict[str, list[str]]) -> str:
    """Return the text of `scanner.urdf`.

    `bodies` are the links servo, rot (rotation frame) and laser (laser frame), `meshes` the parts of the links servo
    and rot.
    """
    angles = scanner.angles
    shapes = [_fixed_shape(station.shape) for station in drive.stations if station.shape is not None]
    lines = [
        '<?xml version="1.0"?>',
        f"<robot name={quoteattr(angles.task)}>",
        '  <link name="world"/>',
        *_link("servo", bodies["servo"], [*_meshes(meshes["servo"]), *shapes]),
        *_link("rot", bodies["rot"], _meshes(meshes["rot"])),
        *_link("laser", bodies["laser"], _lidar_shapes(scanner)),
        *_joint("servo_mount", "fixed", "world", "servo", angles.T_world_rot(0.0)),
        *_spin_joint(scanner),
        *_joint("laser_mount", "fixed", "rot", "laser", angles.T_rot_laser()),
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _joint(name: str, kind: str, parent: str, child: str, T: Array) -> list[str]:
    return [
        f'  <joint name="{name}" type="{kind}">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{child}"/>',
        f'    <origin xyz="{_row(T[:3, 3])}" rpy="{_row(roll_pitch_yaw(T[:3, :3]))}"/>',
        "  </joint>",
    ]


def _spin_joint(scanner: Scanner) -> list[str]:
    """Return the joint: continuous, but limited to the sweep if there is no slip ring."""
    servo, motion = scanner.servo, scanner.angles.motion
    kind, ends = "continuous", ""
    if isinstance(motion, Sweep) and scanner.slip_ring is None:
        lower, upper = (math.radians(limit) for limit in motion.limits_deg)
        kind, ends = "revolute", f'lower="{lower:.6g}" upper="{upper:.6g}" '
    speed = f"{servo.no_load_rpm * math.pi / 30:.6g}"
    return [
        *_joint("spin_joint", kind, "servo", "rot", np.eye(4))[:-1],
        '    <axis xyz="0 0 1"/>',
        f'    <limit {ends}effort="{servo.stall_torque_nm:g}" velocity="{speed}"/>',
        "  </joint>",
    ]


def _link(name: str, body: Inertial, shapes: list[tuple[str, str]]) -> list[str]:
    J = body.inertia_kg_m2
    terms = {"ixx": J[0, 0], "ixy": J[0, 1], "ixz": J[0, 2], "iyy": J[1, 1], "iyz": J[1, 2], "izz": J[2, 2]}
    lines = [
        f'  <link name="{name}">',
        "    <inertial>",
        f'      <origin xyz="{_row(body.centre_m, 9)}" rpy="0 0 0"/>',
        f'      <mass value="{body.mass_kg:.6f}"/>',
        "      <inertia " + " ".join(f'{key}="{value + 0.0:.6e}"' for key, value in terms.items()) + "/>",
        "    </inertial>",
    ]
    for kind in ("visual", "collision"):
        for origin, geometry in shapes:
            lines += [f"    <{kind}>", f"      {origin}", f"      <geometry>{geometry}</geometry>", f"    </{kind}>"]
    return [*lines, "  </link>"]


def _meshes(parts: list[str]) -> list[tuple[str, str]]:
    return [
        (_origin((0.0, 0.0, 0.0)), f'<mesh filename="parts/{part}.stl" scale="0.001 0.001 0.001"/>') for part in parts
    ]


def _fixed_shape(shape: Box | Rod) -> tuple[str, str]:
    if isinstance(shape, Rod):
        return _origin((0.0, 0.0, (shape.low + shape.high) / 2000)), _cylinder(shape.radius, shape.high - shape.low)
    low, high = np.array(shape)
    return _origin((low + high) / 2000), _box(high - low)


def _lidar_shapes(scanner: Scanner) -> list[tuple[str, str]]:
    """Return base and head of the lidar in the laser frame, whose origin is the optical centre."""
    lidar = scanner.lidar
    x, y, height = lidar.body_mm
    low, high = lidar.window_z_mm
    shapes = {  # by the middle of their height above the base
        low / 2: _box((x, y, low)),
        (low + high) / 2: _cylinder(lidar.window_radius_mm, high - low),
        (high + height) / 2: _cylinder(min(x, y) / 2 - 1.5, height - high),
    }
    return [(_origin((0.0, 0.0, (z - lidar.optical_height_mm) / 1000)), shape) for z, shape in shapes.items()]


def _origin(xyz: Sequence[float] | Array) -> str:
    return f'<origin xyz="{_row(xyz)}" rpy="0 0 0"/>'


def _box(size_mm: Sequence[float] | Array) -> str:
    return f'<box size="{_row(np.asarray(size_mm) / 1000)}"/>'


def _cylinder(radius_mm: float, length_mm: float) -> str:
    return f'<cylinder radius="{radius_mm / 1000:.9g}" length="{length_mm / 1000:.9g}"/>'


def _row(values: Sequence[float] | Array, decimals: int = 12) -> str:
    return " ".join(f"{round(float(v), decimals) + 0.0:.{decimals + 2}g}" for v in values)
