"""Engine and tractor control unit of a simulated tractor, as seen on the bus.

Engine torque is the driver's demand, limited by the lowest limit (TSC1) received within the last
`LIMIT_TIMEOUT`. Frames have the periods of the standards. Speeds on the bus have no sign; the
direction of travel is a field of its own.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.pace import Pace
from tractor_io.can.parameter_group import ParameterGroups
from tractor_io.can.torque_limit import HIGHEST, STEPS, LimitReader
from tractor_io.can.vehicle_bus import WHEEL_FIELDS, Frame

ENGINE, TRACTOR = 0, 240
"""Addresses of the engine and of the tractor control unit."""

LIMIT_TIMEOUT = 0.1
"""Time for which a limit holds unless it is repeated, s."""

_FORWARD, _REVERSE = 1, 0
# Speed below which the direction is kept, m/s.
_STANDSTILL = 0.01


class TractorEcu:
    """Engine and tractor control unit of a simulated tractor.

    Parameters
    ----------
    groups : ParameterGroups
        Messages of the bus.
    radii : sequence of float
        Rolling radius of every wheel, m, in the order of HRW.
    drivetrain : Drivetrain
        Between the engine and these wheels.
    front_engaged : bool
        True if the front axle is driven.

    Attributes
    ----------
    front_engaged : bool
        As given; may change at any time.
    rejected : int
        Number of limits with a wrong checksum, a counter that did not change, or no torque.
    """

    def __init__(
        self,
        groups: ParameterGroups,
        radii: Sequence[float],
        drivetrain: Drivetrain,
        front_engaged: bool = True,
    ) -> None:
        self._groups = groups
        self._radii = np.array(radii, dtype=float)
        self._drivetrain = drivetrain
        self.front_engaged = front_engaged
        self._demand = 0.0
        # For every sender: its reader, and its newest limit with the time of arrival.
        self._readers: dict[int, LimitReader] = {}
        self._limits: dict[int, tuple[float, float]] = {}
        self.rejected = 0
        self._paces: dict[str, Pace] = {}
        self._direction = _FORWARD
        self._distance = 0.0
        self._last: float | None = None
        self._ground_speed: float | None = None

    def ask(self, torques: ArrayLike) -> None:
        """Set the torque demand of the driver.

        Parameters
        ----------
        torques : array_like, shape (4,)
            Torque of every wheel, N·m. Only their sum counts; the drivetrain divides it.
        """
        self._demand = float(
            np.clip(np.sum(torques) / self._drivetrain.full_torque, -HIGHEST, HIGHEST)
        )

    def take(self, t: float, identifier: int, data: bytes) -> None:
        """Process a frame of the bus.

        Parameters
        ----------
        t : float
            Time of arrival, s.
        identifier : int
            29 bits.
        data : bytes
            Its bytes.
        """
        try:
            group = self._groups.decode(identifier, data)
            if group is None or group.name != 'TSC1' or group.identifier.destination != ENGINE:
                return
            sender = group.identifier.source
            limit = self._readers.setdefault(sender, LimitReader()).read(group, data)
        except ValueError:
            self.rejected += 1
            return
        if limit is None:
            self._limits.pop(sender, None)
        else:
            self._limits[sender] = t, limit

    def limit(self, t: float) -> float | None:
        """Lowest limit in force.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        float or None
            Share of reference torque; None if there is no limit.
        """
        held = [limit for came, limit in self._limits.values() if t - came <= LIMIT_TIMEOUT]
        return min(held, default=None)

    def wheel_torques(self, t: float) -> NDArray[np.float64]:
        """Torque of every wheel, after the limits.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        ndarray, shape (4,)
            N·m.
        """
        limit = self.limit(t)
        share = self._demand
        if limit is not None:
            share = math.copysign(min(abs(share), max(limit, 0.0)), share)
        return self._drivetrain.wheel_torques(share, self.front_engaged)

    def ground_speed(self, v: float) -> None:
        """Set the speed over ground that the radar measures.

        Parameters
        ----------
        v : float
            Speed over ground, m/s, forward positive.
        """
        self._ground_speed = v

    def frames(self, t: float, omega: ArrayLike, torque: ArrayLike) -> list[Frame]:
        """Frames that are due.

        Parameters
        ----------
        t : float
            Now, s.
        omega, torque : array_like, shape (4,)
            Wheel speeds, rad/s, and shaft torques, N·m, forward positive.

        Returns
        -------
        list of (int, bytes)
            Identifiers and data.
        """
        speeds = np.asarray(omega, dtype=float) * self._radii
        wheel_based = float(speeds.mean())
        if abs(wheel_based) > _STANDSTILL:
            self._direction = _FORWARD if wheel_based > 0 else _REVERSE
        if self._last is not None and t < self._last:
            # The clock was set back: start the periods again.
            self._last = None
            self._paces.clear()
        self._distance += 0.0 if self._last is None else abs(wheel_based) * (t - self._last)
        self._last = t
        along = 1.0 if self._direction == _FORWARD else -1.0
        actual = along * float(np.sum(torque)) / self._drivetrain.full_torque
        percents, eighths = divmod(round(STEPS * min(max(actual, -HIGHEST), HIGHEST)), 8)
        found: list[Frame] = []
        self._add(
            found, t, 'EEC1', ENGINE,
            {
                'ActualEnginePercentTorque': percents / 100.0,
                'ActualEnginePercentTorqueFraction': eighths / STEPS,
                'DriversDemandEnginePercentTorque': abs(self._demand),
            },
        )  # fmt: skip
        self._add(
            found, t, 'WBSD', TRACTOR,
            {
                'WheelBasedMachineSpeed': min(abs(wheel_based), 64.0),
                'WheelBasedMachineDistance': self._distance,
                'WheelBasedMachineDirection': self._direction,
                'KeySwitchState': 1,
            },
        )  # fmt: skip
        if self._ground_speed is not None:
            self._add(
                found, t, 'GBSD', TRACTOR,
                {
                    'GroundBasedMachineSpeed': min(abs(self._ground_speed), 64.0),
                    'GroundBasedMachineDirection': int(self._ground_speed >= 0.0),
                },
            )  # fmt: skip
        # HRW comes last because the bridge publishes all values when it receives it.
        self._add(
            found, t, 'HRW', TRACTOR,
            dict(zip(WHEEL_FIELDS, np.minimum(np.abs(speeds), 69.0).tolist(), strict=True)),
        )  # fmt: skip
        return found

    def _add(
        self, found: list[Frame], t: float, name: str, source: int, values: dict[str, float]
    ) -> None:
        """Add a frame if it is due."""
        if name not in self._paces:
            self._paces[name] = Pace(self._groups.period(name), t)
        if not self._paces[name].due(t):
            return
        identifier = self._groups.identifier(name)._replace(source=source)
        found.append((identifier.bits, self._groups.encode(name, values)))
