"""The node `torque_gate`: `tractor_io.torque_gate` as a process."""

from traction_node.node import TractionLifecycleNode
from traction_node.run import run
from tractor_io.torque_gate import TorqueGateBehaviour


class TorqueGateNode(TorqueGateBehaviour, TractionLifecycleNode):
    """Last node before the hardware; see `tractor_io.gate` for what it checks."""


def main():
    """Run the node."""
    return run(TorqueGateNode)
