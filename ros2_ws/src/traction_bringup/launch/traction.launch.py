"""Launch estimator, controller and gate for a tractor whose topics come from elsewhere.

ros2 launch traction_bringup traction.launch.py [parameters:=FILE] [bag:=FOLDER]
    [namespace:=NAME] [can:=INTERFACE]
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration

from traction_bringup.launching import actions


def _nodes(context):
    return actions(
        simulated=False,
        bag=LaunchConfiguration('bag').perform(context),
        can=LaunchConfiguration('can').perform(context),
        namespace=LaunchConfiguration('namespace').perform(context),
        parameter_file=LaunchConfiguration('parameters').perform(context),
        autostart=LaunchConfiguration('autostart').perform(context).lower() == 'true',
    )


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'bag', default_value='', description='folder to record all topics into'
            ),
            DeclareLaunchArgument(
                'can', default_value='', description='CAN interface to the tractor, if any'
            ),
            DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
            DeclareLaunchArgument(
                'parameters', default_value='', description='YAML of parameters of your own'
            ),
            DeclareLaunchArgument(
                'autostart',
                default_value='true',
                choices=['true', 'false'],
                description='configure and activate the nodes',
            ),
            OpaqueFunction(function=_nodes),
        ]
    )
