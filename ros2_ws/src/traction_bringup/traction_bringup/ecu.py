"""Simulated tractor on a CAN bus, for a suite started separately."""

import contextlib
import signal
from pathlib import Path

from rich.console import Console

from traction_bringup.system import tractor
from traction_node.running_system import RunningSystem
from tractor_io.can.interface import DEFAULT_PORT, find_interface

CHECK_PERIOD = 0.2
"""Period of the check of running nodes, s."""


def ecu(
    can: str, channel: str, port: int | None, parameter_file: Path | str, console: Console
) -> None:
    """Run plant, control units and driver until Ctrl-C or SIGTERM.

    Parameters
    ----------
    can, channel, port
        As for `tractor_io.can.interface.open_bus`; no port: its default.
    parameter_file : Path or str
        As for `traction_bringup.system.system`.
    console : Console
        Console for messages.

    Raises
    ------
    BusError
        If the interface is unknown.
    NodeEndedError
        If a node ends unexpectedly.
    """
    find_interface(can)
    bus = {
        'interface': can,
        'port': port or DEFAULT_PORT,
        **({'channel': channel} if channel else {}),
    }
    nodes = tractor(can=can, parameter_file=parameter_file, parameters={'tractor_ecu': bus})
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt), RunningSystem(nodes) as running:
        console.print(f'tractor on {can}: {", ".join(running.processes)}; Ctrl-C ends it')
        while True:
            running.check()
            running.probe.run_for(CHECK_PERIOD)
