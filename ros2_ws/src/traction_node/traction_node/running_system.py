"""System of nodes as processes, without `ros2 launch`."""

import contextlib
from collections.abc import Callable, Sequence

from traction_node import diagnostic
from traction_node.node_spec import NodeSpec
from traction_node.probe import NodeProcess, Probe, executable

START_TIMEOUT = 60.0
"""Longest time for all nodes to be ready, s, for a cold disk and one slow core."""


class NodeEndedError(RuntimeError):
    """A node of the system ended unexpectedly; the text has its name and output."""


class RunningSystem:
    """Nodes of the system as processes; a context manager that ends them.

    The last node starts when all others are ready, so that they receive the whole drive.

    Parameters
    ----------
    nodes : sequence of NodeSpec
        Nodes, in the order of their start.

    Attributes
    ----------
    probe : traction_node.probe.Probe
        Probe of the graph.
    processes : dict of str to NodeProcess
        Nodes by name.
    """

    def __init__(self, nodes: Sequence[NodeSpec]) -> None:
        self._nodes = list(nodes)
        self._stack = contextlib.ExitStack()
        self.processes: dict[str, NodeProcess] = {}

    def __enter__(self) -> 'RunningSystem':
        with contextlib.ExitStack() as stack:
            self.probe = stack.enter_context(Probe())
            self.probe.diagnostics('')
            *others, last = self._nodes
            for node in others:
                self._start(stack, node)
            for node in others:
                self._await_ready(node)
            self._start(stack, last)
            self._await_ready(last)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        # All at once: each takes a while to end.
        for process in self.processes.values():
            process.send_interrupt()
        self._stack.close()

    def _start(self, stack: contextlib.ExitStack, node: NodeSpec) -> None:
        self.processes[node.name] = stack.enter_context(
            NodeProcess(
                executable(node.package, node.executable),
                params=dict(node.parameters),
                params_files=node.parameter_files,
                remaps=dict(node.remappings),
                quiet=True,
            )
        )

    def _await_ready(self, node: NodeSpec) -> None:
        def ready() -> bool:
            # A short drive may end before its first diagnostic.
            self.check(may_end=[node.name])
            if not self.processes[node.name].running:
                return True
            newest = self.probe.diagnostics(node.name)[-1:]
            if not node.lifecycle:
                return any(status.level == bytes([diagnostic.OK]) for status in newest)
            return any(
                value.key == 'state' and value.value == 'active'
                for status in newest
                for value in status.values
            )

        self.probe.wait_for(ready, f'sign of life of {node.name}', timeout=START_TIMEOUT)

    def check(self, may_end: Sequence[str] = ()) -> None:
        """Check that all nodes are running.

        Parameters
        ----------
        may_end : sequence of str
            Names of nodes that may have ended, with exit status 0.

        Raises
        ------
        NodeEndedError
            If a node is not running; the text has its name and last output.
        """
        for name, process in self.processes.items():
            if process.running:
                continue
            status = process.wait()
            if name in may_end and status == 0:
                continue
            said = '\n'.join(process.output.splitlines()[-10:])
            raise NodeEndedError(f'{name} ended with exit status {status}:\n{said}')

    def run_until_end_of(self, name: str, timeout: float, tick: Callable[[], None]) -> None:
        """Wait for the end of a node.

        Parameters
        ----------
        name : str
            Name of the node.
        timeout : float
            Longest time, s.
        tick : callable
            Called regularly, for example to show progress.

        Raises
        ------
        NodeEndedError
            If another node ends, or this one with an exit status other than 0.
        TimeoutError
            If it takes longer.
        """

        def ended() -> bool:
            self.check(may_end=[name])
            tick()
            return not self.processes[name].running

        self.probe.wait_for(ended, f'end of {name}', timeout=timeout)
