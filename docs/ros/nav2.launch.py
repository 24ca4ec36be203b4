"""Nav2 with a robot of lrf3d: ros2 launch nav2.launch.py world:=city.

The simulator publishes /map; AMCL localises from the start pose, which arrives as /initialpose.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).parent
SETTINGS = str(HERE / "nav2.yaml")


def generate_launch_description():
    """The simulator, AMCL, and the navigation servers of nav2_bringup."""
    robot = ["lrf3d", "ros", LaunchConfiguration("world"), "--give", "map", "--wheels"]
    words = ["--rate", "10", "--commands", "Twist", "--ros-args", "-r", "start_pose:=initialpose"]
    servers = Path(get_package_share_directory("nav2_bringup"), "launch", "navigation_launch.py")
    return LaunchDescription(
        [
            DeclareLaunchArgument("world", default_value="city"),
            ExecuteProcess(cmd=[*robot, *words], output="screen"),
            Node(package="nav2_amcl", executable="amcl", name="amcl", parameters=[SETTINGS]),
            Node(
                package="nav2_lifecycle_manager",
                executable="lifecycle_manager",
                name="lifecycle_manager_localization",
                parameters=[{"use_sim_time": True, "autostart": True, "node_names": ["amcl"]}],
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(servers)),
                launch_arguments={"params_file": SETTINGS, "use_sim_time": "true"}.items(),
            ),
        ]
    )
