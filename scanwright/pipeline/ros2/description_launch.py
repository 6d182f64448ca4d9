"""The scanner's frames from `/joint_states` by `robot_state_publisher`, if the node runs with `--no-tf`.

    ros2 launch THIS_PACKAGE description_launch.py [laser_mount_xyz:='X Y Z'] [laser_mount_rpy:='R P Y'] ...

The launch parameters that `scanwright calibrate` prints take the place of the designed frames.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

FRAMES = tuple(f"{joint}_{part}" for joint in ("servo_mount", "laser_mount") for part in ("xyz", "rpy"))
"""Launch parameters: metres, and radians."""


def with_frames(urdf: str, value_of: Callable[[str], str]) -> str:
    """Replace frames of a URDF by those of the launch parameters; "" keeps a frame."""
    robot = ElementTree.fromstring(urdf)
    for name in FRAMES:
        joint, part = name.rsplit("_", 1)
        origin = robot.find(f"joint[@name='{joint}']/origin")
        if value_of(name) and origin is not None:
            origin.set(part, value_of(name))
    return ElementTree.tostring(robot, encoding="unicode")


def generate_launch_description() -> Any:
    """Return the launch description, as `ros2 launch` requires."""
    from ament_index_python.packages import get_package_share_directory
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch.substitutions import LaunchConfiguration
    from launch_ros.actions import Node

    def publisher(context: Any) -> list[Any]:
        urdf = (Path(get_package_share_directory("THIS_PACKAGE")) / "scanner.urdf").read_text(encoding="utf-8")
        description = with_frames(urdf, lambda name: LaunchConfiguration(name).perform(context))
        parameters = [{"robot_description": description}]
        return [Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=parameters)]

    frames = [DeclareLaunchArgument(name, default_value="", description="as `calibrate` prints it") for name in FRAMES]
    return LaunchDescription([*frames, OpaqueFunction(function=publisher)])
