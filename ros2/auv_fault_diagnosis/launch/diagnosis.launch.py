"""Start the diagnosis with the parameters of a file."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

NAME = "auv_fault_diagnosis"


def generate_launch_description() -> LaunchDescription:
    """The node, and the argument that names the file of its parameters."""
    default = Path(get_package_share_directory(NAME)) / "config" / "parameters.yaml"
    argument = DeclareLaunchArgument(
        "parameters", default_value=str(default), description="YAML file of the parameters"
    )
    node = Node(
        package=NAME,
        executable="diagnosis",
        name=NAME,
        output="screen",
        parameters=[LaunchConfiguration("parameters")],
    )
    return LaunchDescription([argument, node])
