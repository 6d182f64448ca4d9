"""Launch file for a recording in ROS 2: `ros2 launch replay_launch.py recording:=r.mcap urdf:=scanner.urdf`.

The recording is played with its clock; `robot_state_publisher` converts `/joint_states` and the URDF of the build to
`/tf`, so that RViz or `laser_assembler` place each `/scan`. Requires rosbag2_storage_mcap.
"""

from __future__ import annotations

from typing import Any


def generate_launch_description() -> Any:
    """Return the launch description for `ros2 launch`."""
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, ExecuteProcess
    from launch.substitutions import Command, LaunchConfiguration
    from launch_ros.actions import Node
    from launch_ros.parameter_descriptions import ParameterValue

    description = ParameterValue(Command(["cat ", LaunchConfiguration("urdf")]), value_type=str)
    return LaunchDescription(
        [
            DeclareLaunchArgument("recording", description="MCAP recording of scanwright"),
            DeclareLaunchArgument("urdf", description="scanner.urdf of its build folder"),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"robot_description": description, "use_sim_time": True}],
            ),
            ExecuteProcess(
                cmd=["ros2", "bag", "play", "-s", "mcap", "--clock", "100", LaunchConfiguration("recording")],
                output="screen",
            ),
        ]
    )
