"""Signals of a tractor's bus for traction control, received and sent.

Received: wheel speeds (HRW) with the sign of the direction of travel (WBSD), shaft torques
computed from engine torque (EEC1) and drivetrain, speed over ground (GBSD), and the vehicle's
state. Sent: a limit of engine torque (TSC1) every 10 ms, after an address has been claimed. A
commanded wheel torque is only a limit: the engine applies the smaller of the driver's demand and
the limit.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_node.positive import check_positive
from tractor_io.can.address_claim import CLAIMED_PGN, AddressClaim
from tractor_io.can.bus_watch import BusWatch
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.j1939 import Identifier, Unknown, check_address
from tractor_io.can.pace import Pace
from tractor_io.can.parameter_group import Group, ParameterGroups
from tractor_io.can.torque_limit import HIGHEST, PERIOD, TorqueLimit, with_fraction

WHEEL_FIELDS = (
    'FrontAxleLeftWheelSpeed',
    'FrontAxleRightWheelSpeed',
    'RearAxleLeftWheelSpeed',
    'RearAxleRightWheelSpeed',
)
"""Fields of HRW, in the order of its bytes."""

STATUS = {
    'wheel_based_speed': ('WBSD', 'WheelBasedMachineSpeed'),
    'direction': ('WBSD', 'WheelBasedMachineDirection'),
    'machine_selected_speed': ('MSS', 'MachineSelectedSpeed'),
    'front_axle_speed': ('EBC2', 'FrontAxleSpeed'),
    'engine_speed': ('EEC1', 'EngineSpeed'),
    'engine_torque': ('EEC1', 'ActualEnginePercentTorque'),
    'rear_draft': ('RHS', 'RearDraft'),
    'front_draft': ('FHS', 'FrontDraft'),
    'rear_differential_lock': ('EAC1', 'DifferentialLockStateRearAxle1'),
    'front_differential_lock': ('EAC1', 'DifferentialLockStateFrontAxle1'),
    'yaw_rate': ('VDC2', 'YawRate'),
    'longitudinal_acceleration': ('VDC2', 'LongitudinalAcceleration'),
}
"""Message and field of every quantity of the vehicle's state, in SI units."""

Frame = tuple[int, bytes]

_REVERSE = 0.0


class VehicleBus:
    """Signals received and sent on one bus.

    Parameters
    ----------
    groups : ParameterGroups
        Messages of the bus.
    radii : sequence of float
        Rolling radius of every wheel, m, above 0, in the order of `WHEEL_FIELDS`.
    drivetrain : Drivetrain
        Between the engine and these wheels.
    claim : AddressClaim
        Claim of the address to send from.
    engine : int
        Address of the engine, 0 to 253.
    front_engaged : bool
        True if the front axle is driven.
    sources : mapping of str to int
        Address from which to accept a message, by its name.
    missed : float
        Periods without a frame after which a message counts as missing, above 1.
    timeout : float
        Time after the last wheel torques until the engine is limited to zero torque, s, above 0.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    def __init__(
        self,
        groups: ParameterGroups,
        radii: Sequence[float],
        drivetrain: Drivetrain,
        claim: AddressClaim,
        *,
        engine: int = 0,
        front_engaged: bool = True,
        sources: Mapping[str, int] | None = None,
        missed: float = 5.0,
        timeout: float = 0.14,
    ) -> None:
        if len(radii) != len(WHEEL_FIELDS):
            raise ValueError(f'expected {len(WHEEL_FIELDS)} radii, got {len(radii)}')
        check_positive(**{f'radius {k}': r for k, r in enumerate(radii)}, timeout=timeout)
        check_address('engine', engine)
        self.watch = BusWatch(groups, sources, missed)
        self.claim = claim
        self.front_engaged = front_engaged
        self._radii = np.array(radii, dtype=float)
        self._drivetrain = drivetrain
        self._limit = TorqueLimit(groups, engine)
        self._timeout = timeout
        # Newest limit and its time; None before the first.
        self._share = 0.0
        self._commanded: float | None = None
        # Pace of the limits; None while none are sent.
        self._pace: Pace | None = None
        self._outbox: list[Frame] = []

    # Received

    def take(self, t: float, identifier: int, data: bytes) -> Group | None:
        """Process a frame of the bus.

        Parameters
        ----------
        t : float
            Time of arrival, s.
        identifier : int
            29 bits.
        data : bytes
            Its bytes.

        Returns
        -------
        Group or None
            Decoded values; None if the message is unknown or its sender not accepted.

        Raises
        ------
        FrameError
            If it is no J1939 frame, or a known message has the wrong length.
        """
        group = self.watch.take(t, identifier, data)
        if group is None:
            self._send(self.claim.receive(t, Identifier.parse(identifier), data))
        return group

    def heading(self, t: float) -> float:
        """Direction of travel: -1 in reverse, else 1.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        float
            Dimensionless; 1 if the direction is unknown.
        """
        reverse = self.watch.value(t, 'WBSD', 'WheelBasedMachineDirection') == _REVERSE
        return -1.0 if reverse else 1.0

    def wheel_speeds(self, t: float) -> list[float | Unknown]:
        """Speed of every wheel.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        list of float or Unknown
            rad/s, forward positive.
        """
        heading = self.heading(t)
        speeds: list[float | Unknown] = []
        for name, radius in zip(WHEEL_FIELDS, self._radii.tolist(), strict=True):
            speed = self.watch.value(t, 'HRW', name)
            speeds.append(speed if isinstance(speed, Unknown) else heading * speed / radius)
        return speeds

    def shaft_torques(self, t: float) -> NDArray[np.float64] | None:
        """Shaft torque of every wheel, from the engine torque.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        ndarray, shape (4,), or None
            N·m, forward positive; None without engine torque.
        """
        engine = self.watch.value(t, 'EEC1', 'ActualEnginePercentTorque')
        if isinstance(engine, Unknown):
            return None
        fraction = self.watch.value(t, 'EEC1', 'ActualEnginePercentTorqueFraction')
        return self.heading(t) * self._drivetrain.wheel_torques(
            with_fraction(engine, fraction), self.front_engaged
        )

    def ground_speed(self, t: float) -> float | Unknown:
        """Speed over ground.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        float or Unknown
            m/s, forward positive.
        """
        speed = self.watch.value(t, 'GBSD', 'GroundBasedMachineSpeed')
        if isinstance(speed, Unknown):
            return speed
        reverse = self.watch.value(t, 'GBSD', 'GroundBasedMachineDirection')
        if isinstance(reverse, Unknown):
            return self.heading(t) * speed
        return -speed if reverse == _REVERSE else speed

    def status(self, t: float) -> dict[str, float | Unknown]:
        """State of the vehicle.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        dict of str to float or Unknown
            Values by the names of `STATUS`, in SI units.
        """
        return {name: self.watch.value(t, *where) for name, where in STATUS.items()}

    # Sent

    def command(self, t: float, torques: ArrayLike) -> None:
        """Set the torque limits of the wheels; they hold for the timeout.

        Parameters
        ----------
        t : float
            Now, s.
        torques : array_like, shape (4,)
            N·m, forward positive; in reverse the engine is limited by their magnitude.

        Raises
        ------
        ValueError
            If the number is wrong or one is not finite. The previous limits then stay in force.
        """
        along = self.heading(t) * np.asarray(torques, dtype=float)
        share = self._drivetrain.engine_share(along, self.front_engaged)
        # Torque against the direction of travel is for brakes, not for the engine.
        self._share = min(max(share, 0.0), HIGHEST)
        self._commanded = t

    def begin(self, t: float) -> None:
        """Claim an address; the limits start when it may be used.

        Parameters
        ----------
        t : float
            Now, s.
        """
        self._commanded = None
        self._pace = Pace(PERIOD, t)
        self._send(self.claim.start(t))

    def end(self) -> None:
        """Release the limit, so that only the driver commands the engine."""
        if self._pace is not None and self.claim.usable:
            self._outbox.append(self._limit.release(self.claim.address))
        self._pace = None

    def outgoing(self, t: float) -> list[Frame]:
        """Frames to send now; call it at least every 10 ms.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        list of (int, bytes)
            Identifiers and data.
        """
        self._send(self.claim.poll(t))
        if self._pace is not None and self.claim.usable and self._pace.due(t):
            self._outbox.append(self._limit.limit(self.claim.address, self.limit(t)))
        frames, self._outbox = self._outbox, []
        return frames

    def unsent(self, t: float, frames: Sequence[Frame]) -> None:
        """Process frames that could not be sent.

        A claim that was not sent does not count: other devices could not object to it.

        Parameters
        ----------
        t : float
            Now, s.
        frames : sequence of (int, bytes)
            Identifiers and data, of `outgoing`.
        """
        if any(Identifier.parse(identifier).pgn == CLAIMED_PGN for identifier, _ in frames):
            self._send(self.claim.start(t))

    def limit(self, t: float) -> float:
        """Limit of engine torque.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        float
            Share of reference torque; 0 if no wheel torques came within the timeout.
        """
        return self._share if self.commanded(t) else 0.0

    def commanded(self, t: float) -> bool:
        """True if wheel torques came within the timeout.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        bool
        """
        return self._commanded is not None and t - self._commanded <= self._timeout

    def _send(self, frames: Sequence[tuple[Identifier, bytes]]) -> None:
        for identifier, data in frames:
            frame = identifier.bits, data
            # At most one claim per period, even in a flood of requests for the address.
            if frame not in self._outbox:
                self._outbox.append(frame)
