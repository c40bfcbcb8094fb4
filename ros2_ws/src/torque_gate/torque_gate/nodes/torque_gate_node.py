"""The node `torque_gate`: `torque_gate.nodes.torque_gate` as a process."""

from torque_gate.nodes.torque_gate import TorqueGateBehaviour
from traction_node.node import TractionLifecycleNode
from traction_node.run import run


class TorqueGateNode(TorqueGateBehaviour, TractionLifecycleNode):
    """Last node before the hardware; see `torque_gate.gate` for what it checks."""


def main():
    """Run the node."""
    return run(TorqueGateNode)
