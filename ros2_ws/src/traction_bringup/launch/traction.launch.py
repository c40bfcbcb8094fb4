"""Estimator, controller and gate, for the topics or the CAN bus of a tractor.

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
                'bag', default_value='', description='folder for a recording of all topics'
            ),
            DeclareLaunchArgument(
                'can', default_value='', description='CAN interface to the tractor; empty: topics'
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of all nodes'
            ),
            DeclareLaunchArgument(
                'parameters', default_value='', description='YAML file with your parameters'
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
