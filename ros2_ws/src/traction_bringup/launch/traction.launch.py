"""Launch estimator, controller and gate for a tractor whose topics come from elsewhere.

ros2 launch traction_bringup traction.launch.py [bag:=FOLDER] [namespace:=NAME]
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration

from traction_bringup.launching import actions


def _nodes(context):
    return actions(
        simulated=False,
        bag=LaunchConfiguration('bag').perform(context),
        namespace=LaunchConfiguration('namespace').perform(context),
    )


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'bag', default_value='', description='folder to record all topics into'
            ),
            DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
            OpaqueFunction(function=_nodes),
        ]
    )
