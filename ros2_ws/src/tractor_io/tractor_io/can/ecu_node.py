"""Node `tractor_ecu`: a simulated tractor on a CAN bus."""

import math
from collections.abc import Collection
from types import SimpleNamespace
from typing import Any

import can

from traction_node.behaviour import Behaviour
from traction_node.diagnostic import ERROR, OK, WARN
from traction_node.joints import JointError, JointOrder
from traction_node.parameter import NodeParameter
from traction_node.run import run
from traction_node.stamp import seconds
from tractor_io.can.drivetrain_parameters import DRIVETRAIN_PARAMETERS, make_drivetrain
from tractor_io.can.ecu import TractorEcu
from tractor_io.can.interface import DEFAULT_PORT, INTERFACES, frame, open_bus
from tractor_io.can.parameter_group import tractor_groups

MAX_FRAMES = 200
"""Frames read from the bus per message of `wheel_states`; more is a flood."""


class TractorEcuBehaviour(Behaviour):
    """Wheel states of the plant to CAN frames; driver's demand and limits to the plant's torque.

    Remap `wheel_states`, `radar` and `wheel_torque` between the plant and this node, as
    `traction demo --can` does. `torque_request` is the driver's pedal.
    """

    NAME = 'tractor_ecu'
    PARAMETERS = (
        NodeParameter(
            'interface',
            default='udp_multicast',
            description=f'kind of bus: {", ".join(INTERFACES)}',
            read_only=True,
        ),
        NodeParameter(
            'channel',
            default='',
            description='name of the bus; empty for the default of the interface',
            read_only=True,
        ),
        NodeParameter(
            'port',
            default=DEFAULT_PORT,
            description='port of a bus over UDP',
            minimum=1,
            maximum=65535,
            read_only=True,
        ),
        *DRIVETRAIN_PARAMETERS,
    )

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Reject values that contradict each other."""
        make_drivetrain(p)

    def parameters_changed(self, p: SimpleNamespace, names: Collection[str]) -> None:
        """Apply the engagement of the front axle."""
        self._ecu.front_engaged = p.front_engaged

    def configure(self) -> None:
        """Open the bus and subscribe to plant and driver."""
        self._ecu = TractorEcu(
            tractor_groups(),
            self.host.p.wheel_radii,
            make_drivetrain(self.host.p),
            self.host.p.front_engaged,
        )
        self._can = open_bus(self.host.p.interface, self.host.p.channel, self.host.p.port)
        names = self.host.p.wheel_names
        self._speeds = JointOrder(names, 'wheel_states velocity')
        self._efforts = JointOrder(names, 'wheel_states effort')
        self._requests = JointOrder(names, 'torque_request effort', one_for_all=True)
        self._publisher = self.host.publisher('wheel_torque')
        self._output = self.host.message('wheel_torque')
        self._output.name = list(names)
        self.host.subscription('radar', self._on_radar)
        self.host.subscription('torque_request', self._on_request)
        self.host.subscription('wheel_states', self._on_wheel_states)
        self.host.set_diagnostic(OK, 'waiting for the tractor')

    def deactivate(self) -> None:
        """Close the bus."""
        self._can.shutdown()

    def _on_radar(self, message: Any) -> None:
        v = message.twist.twist.linear.x
        if math.isfinite(v):
            self._ecu.ground_speed(v)

    def _on_request(self, message: Any) -> None:
        try:
            self._ecu.ask(self._requests.values(message.name, message.effort))
        except JointError as error:
            self.host.set_diagnostic(WARN, str(error))

    def _on_wheel_states(self, message: Any) -> None:
        try:
            speeds = self._speeds.values(message.name, message.velocity)
            efforts = self._efforts.values(message.name, message.effort)
        except JointError as error:
            self.host.set_diagnostic(WARN, str(error))
            return
        now = self.host.steady_time()
        try:
            for _ in range(MAX_FRAMES):
                heard = self._can.recv(0.0)
                if heard is None:
                    break
                if heard.is_extended_id and not (heard.is_error_frame or heard.is_remote_frame):
                    self._ecu.take(now, heard.arbitration_id, bytes(heard.data))
            for identifier, data in self._ecu.frames(
                seconds(message.header.stamp), speeds, efforts
            ):
                self._can.send(frame(identifier, data))
        except (can.CanError, OSError) as error:
            self.host.set_diagnostic(ERROR, f'the bus fails: {error}')
            return
        limit = self._ecu.limit(now)
        self._output.header.stamp = message.header.stamp
        self._output.effort = self._ecu.wheel_torques(now).tolist()
        self._publisher.publish(self._output)
        self.host.set_diagnostic(
            OK,
            'driving' if limit is None else 'limited from the bus',
            limit='none' if limit is None else round(limit, 3),
            rejected=self._ecu.rejected,
        )


def main() -> int:
    """Entry point of the executable `tractor_ecu`."""
    return run(TractorEcuBehaviour)
