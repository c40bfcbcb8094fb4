"""The node `slip_controller`: `traction_controller.nodes.slip_controller` as a process."""

from traction_controller.nodes.slip_controller import SlipControllerBehaviour
from traction_node.node import TractionLifecycleNode
from traction_node.run import run


class SlipControllerNode(SlipControllerBehaviour, TractionLifecycleNode):
    """Answers every slip estimate with a torque command for every wheel."""


def main():
    """Run the node."""
    return run(SlipControllerNode)
