"""slam_toolbox with a robot of lrf3d: ros2 launch slam.launch.py world:=city."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SETTINGS = {
    "use_sim_time": True,
    "odom_frame": "odom",
    "map_frame": "map",
    "base_frame": "base_footprint",
    "scan_topic": "/scan",
    "mode": "mapping",
}


def generate_launch_description():
    """The simulator, and slam_toolbox, which publishes map -> odom."""
    robot = ["lrf3d", "ros", LaunchConfiguration("world"), "--give", "none", "--wheels"]
    return LaunchDescription(
        [
            DeclareLaunchArgument("world", default_value="city"),
            ExecuteProcess(cmd=[*robot, "--rate", "10"], output="screen"),
            Node(
                package="slam_toolbox",
                executable="async_slam_toolbox_node",
                name="slam_toolbox",
                parameters=[SETTINGS],
                output="screen",
            ),
        ]
    )
