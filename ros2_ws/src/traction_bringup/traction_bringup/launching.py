"""The system as actions of `ros2 launch`."""

from typing import Any

from launch_ros.actions import Node

from traction_bringup.system import system


def actions(*, namespace: str = '', **choices: Any) -> list[Node]:
    """Nodes of the system as launch actions.

    Parameters
    ----------
    namespace : str
        Namespace of all nodes.
    **choices
        As for `traction_bringup.system.system`.

    Returns
    -------
    list of launch_ros.actions.Node
        One per node, in the order of start.
    """
    return [
        Node(
            package=node.package,
            executable=node.executable,
            name=node.name,
            namespace=namespace,
            parameters=[
                *map(str, node.parameter_files),
                dict(node.parameters),
            ],
            remappings=list(node.remappings.items()),
            output='screen',
        )
        for node in system(**choices)
    ]
