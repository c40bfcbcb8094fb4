"""The command `traction ecu`: a tractor for whoever is on the bus."""

import time

import pytest

from traction_node.probe import HANG_TIMEOUT, NodeProcess, executable
from tractor_io.can.interface import free_port, open_bus
from tractor_io.can.parameter_group import tractor_groups


def test_a_tractor_drives_on_the_bus_until_ctrl_c():
    port, groups = free_port(), tractor_groups()
    bus = open_bus('udp_multicast', port=port)
    heard = {}
    traction = executable('traction_bringup', 'traction')
    try:
        with NodeProcess(traction, 'ecu', '--port', str(port)) as tractor:
            end = time.monotonic() + HANG_TIMEOUT
            while heard.get('GBSD', {}).get('GroundBasedMachineSpeed', 0.0) < 0.3:
                assert time.monotonic() < end, f'no motion, heard {sorted(heard)}'
                message = bus.recv(0.1)
                if message is not None:
                    group = groups.decode(message.arbitration_id, bytes(message.data))
                    heard[group.name] = group.values
            assert set(heard) == {'EEC1', 'WBSD', 'GBSD', 'HRW'}
            # The driver has the pedal down, without a limit of the engine.
            assert heard['EEC1']['DriversDemandEnginePercentTorque'] > 0.1
            assert heard['HRW']['RearAxleLeftWheelSpeed'] == pytest.approx(
                heard['WBSD']['WheelBasedMachineSpeed'], abs=0.5
            )
            tractor.wait_for_output('Ctrl-C ends it')
            assert tractor.interrupt() == 0
            assert 'Traceback' not in tractor.output
    finally:
        bus.shutdown()


def test_a_bus_that_is_not_known_is_refused_in_one_line():
    traction = executable('traction_bringup', 'traction')
    with NodeProcess(traction, 'ecu', '--can', 'canbus') as tractor:
        assert tractor.wait() == 2
        assert "unknown CAN interface 'canbus'" in tractor.output
        assert 'Traceback' not in tractor.output
