"""A simulated tractor on a CAN bus, for a bridge and a suite that are started elsewhere."""

import contextlib
import signal
from pathlib import Path

from rich.console import Console

from traction_bringup.system import tractor
from traction_node.running_system import RunningSystem
from tractor_io.can.interface import DEFAULT_PORT, find_interface

CHECK_PERIOD = 0.2
"""Time between two looks whether all nodes run, s."""


def ecu(
    can: str, channel: str, port: int | None, parameter_file: Path | str, console: Console
) -> None:
    """Run plant, control units and driver until Ctrl-C or SIGTERM.

    Parameters
    ----------
    can, channel, port
        Of the bus, as `tractor_io.can.interface.open_bus` takes them; no port: its default.
    parameter_file : Path or str
        As `traction_bringup.system.system` takes it.
    console : Console
        Where to say what runs.

    Raises
    ------
    BusError
        If the interface is not known.
    NodeEndedError
        If a node ends by itself.
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
