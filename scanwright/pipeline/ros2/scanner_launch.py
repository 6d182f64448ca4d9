"""The scanner on the robot: `ros2 launch THIS_PACKAGE scanner_launch.py [out:=FOLDER] [recording:=FILE] [rviz:=true]`.

Publishes scans, angles, points, frames and the description; `out` is a build folder with a calibration, for its frames.
"""

from __future__ import annotations

from typing import Any


def generate_launch_description() -> Any:
    """Return the launch description, as `ros2 launch` requires."""
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch.conditions import IfCondition
    from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
    from launch_ros.actions import Node
    from launch_ros.substitutions import FindPackageShare

    share = FindPackageShare("THIS_PACKAGE")

    def scanner(context: Any) -> list[Any]:
        recording = LaunchConfiguration("recording").perform(context)
        words = [LaunchConfiguration("out"), *(["--recording", recording] if recording else [])]
        return [Node(package="THIS_PACKAGE", executable="scanner", arguments=words, output="screen")]

    return LaunchDescription(
        [
            DeclareLaunchArgument("out", default_value=share, description="build folder whose frames are used"),
            DeclareLaunchArgument("recording", default_value="", description="MCAP file to publish, no devices"),
            DeclareLaunchArgument("rviz", default_value="false", description="open RViz"),
            OpaqueFunction(function=scanner),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", PathJoinSubstitution([share, "layouts", "scanner.rviz"])],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
