"""The node `slip_estimator`: `traction_controller.nodes.slip_estimator` as a process."""

from traction_controller.nodes.slip_estimator import SlipEstimatorBehaviour
from traction_node.node import TractionLifecycleNode
from traction_node.run import run


class SlipEstimatorNode(SlipEstimatorBehaviour, TractionLifecycleNode):
    """Publishes a slip estimate for every reading of the wheels."""


def main():
    """Run the node."""
    return run(SlipEstimatorNode)
