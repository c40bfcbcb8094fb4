"""Suite with a simulated tractor and a drive cycle.

ros2 launch traction_bringup simulation.launch.py [controlled:=false] [bag:=FOLDER] ...
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration

from traction_bringup.launching import actions


def _nodes(context):
    return actions(
        simulated=True,
        controlled=LaunchConfiguration('controlled').perform(context).lower() == 'true',
        bag=LaunchConfiguration('bag').perform(context),
        namespace=LaunchConfiguration('namespace').perform(context),
        parameter_file=LaunchConfiguration('parameters').perform(context),
    )


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'controlled', default_value='true', choices=['true', 'false'],
                description='with the slip controller',
            ),
            DeclareLaunchArgument(
                'bag', default_value='', description='folder for a recording of all topics'
            ),
            DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
            DeclareLaunchArgument(
                'parameters', default_value='', description='YAML file with your parameters'
            ),
            OpaqueFunction(function=_nodes),
        ]
    )  # fmt: skip
