"""Torque gate: check and limits of every wheel torque before the hardware.

Valid commands pass, limited in magnitude and rate per wheel. Invalid ones are rejected: the last
valid command holds until `timeout`, then all torques go to the safe torque within `release_time`.
An emergency stop sets the safe torque at once, until all its sources have released it. Times are
those of a steady clock, read by the caller.
"""

import enum
import math
from collections.abc import Sequence
from types import SimpleNamespace

from traction_node.joints import JointError, JointOrder

REACTION_TIME = 0.2
"""Longest time from the last valid command to the safe torque, s."""

WATCHDOG_PERIOD = 0.01
"""Period of the calls of `TorqueGate.step`, s."""


class State(enum.Enum):
    """State of the gate."""

    WAITING = 'waiting'
    """At the safe torque: no valid command yet."""
    PASSING = 'passing'
    """Commands pass, with limits."""
    HOLDING = 'holding'
    """The newest commands are invalid: the last valid one holds."""
    RELEASING = 'releasing'
    """No valid command for too long: on the way to the safe torque."""
    SAFE = 'safe'
    """No valid command for too long: at the safe torque."""
    STOPPED = 'stopped'
    """Emergency stop: at the safe torque, whatever the command."""


class StopSource(enum.Enum):
    """Source of an emergency stop; each has to release its own stop."""

    TOPIC = 'topic'
    SERVICE = 'service'


class Limit(enum.Enum):
    """Limit that cuts the commanded torque of a wheel."""

    NONE = 'not limited'
    HIGH = 'above the most'
    LOW = 'below the least'
    RATE = 'too fast a change'


# Reasons for the rejection of a command.
_CAUSES = ('names', 'length', 'not_finite', 'stamp', 'stale', 'future', 'stopped')


class TorqueGate:
    """Check and limits of wheel torques.

    Parameters
    ----------
    wheel_names : sequence of str
        Names of the n wheels, in the order of all torques here.
    min_torque, max_torque : sequence of float
        Smallest and largest torque of every wheel, N·m, forward positive, n entries.
    max_rate : sequence of float
        Limit of the rate of torque of every wheel, N·m/s, above 0, n entries.
    timeout : float
        Time for which the last valid command holds, s, above 0.
    release_time : float
        Time in which torques then go linearly to the safe torque, s, at least 0. It is a time and
        not a rate, so that the safe torque is reached in time from any torque.
        ``timeout + release_time + WATCHDOG_PERIOD`` must not exceed `REACTION_TIME`.
    safe_torque : float
        Torque without command, N·m, within the limits of every wheel.
    max_age : float
        Largest difference between the stamps of a command and of the newest wheel states, either
        way, s, above 0. Other commands are rejected. Both stamps must be of one clock.

    Attributes
    ----------
    state : State
        State of the gate.
    output : list of float
        Torques to send, N·m, n entries; changed in place.
    limits : list of Limit
        Limit that cut the last valid command of each wheel, n entries.
    rejected : dict of str to int
        Commands rejected since the start, by cause.
    limited : dict of str to int
        Commands cut in magnitude and in rate since the start.
    timeouts : int
        Number of times that commands stopped since the start.
    stopped_by : set of StopSource
        Sources that hold an emergency stop; use `emergency_stop` to change it.

    Raises
    ------
    ValueError
        If parameters are inconsistent.
    """

    # Largest step of the stamps of wheel states while they come, s; a larger one is of a second
    # clock.
    _MAX_STEP = 0.5

    def __init__(
        self,
        wheel_names: Sequence[str],
        min_torque: Sequence[float],
        max_torque: Sequence[float],
        max_rate: Sequence[float],
        timeout: float,
        release_time: float,
        safe_torque: float = 0.0,
        max_age: float = REACTION_TIME,
    ):
        n = len(wheel_names)
        if n == 0 or len(set(wheel_names)) != n:
            raise ValueError(f'wheel_names {list(wheel_names)} must be given, each once')
        for name, values in (
            ('min_torque', min_torque),
            ('max_torque', max_torque),
            ('max_rate', max_rate),
        ):
            if len(values) != n:
                raise ValueError(f'{name} has {len(values)} entries for {n} wheels')
        for wheel, low, high, rate in zip(
            wheel_names, min_torque, max_torque, max_rate, strict=True
        ):
            # Fails for NaN, too.
            if not low <= safe_torque <= high:
                raise ValueError(
                    f'{wheel}: safe_torque {safe_torque} N·m is not within {low} .. {high} N·m'
                )
            if not rate > 0.0:
                raise ValueError(f'{wheel}: max_rate {rate} N·m/s is not above 0')
        reaction = timeout + release_time + WATCHDOG_PERIOD
        if not max_age > 0.0:
            raise ValueError(f'max_age {max_age} s is not above 0')
        # Tolerance for the rounding of decimal fractions.
        if not (timeout > 0.0 and release_time >= 0.0 and reaction <= REACTION_TIME + 1e-9):
            raise ValueError(
                f'timeout {timeout} s + release_time {release_time} s + watchdog '
                f'{WATCHDOG_PERIOD} s must be at most {REACTION_TIME} s'
            )
        self._wheels = tuple(wheel_names)
        self._min = [float(x) for x in min_torque]
        self._max = [float(x) for x in max_torque]
        self._rate = [float(x) for x in max_rate]
        self._timeout = timeout
        self._release_time = release_time
        self._safe = safe_torque
        self._max_age = max_age

        self.state = State.WAITING
        self.output = [safe_torque] * n
        self.limits = [Limit.NONE] * n
        self.rejected = dict.fromkeys(_CAUSES, 0)
        self.limited = {'magnitude': 0, 'rate': 0}
        self.timeouts = 0
        self.stopped_by: set[StopSource] = set()

        self._asked = [safe_torque] * n
        self._held = [safe_torque] * n
        self._last_good = -math.inf
        self._last_stamp = 0.0
        self._rejection = ''
        self._measured = [safe_torque] * n
        self._last_measured = -math.inf
        self._newest_stamp = 0.0
        self._last_stamped = -math.inf
        self._commands = JointOrder(wheel_names, 'torque', only=True)
        self._measurements = JointOrder(wheel_names, 'shaft torque')

    @classmethod
    def from_parameters(cls, p: SimpleNamespace) -> 'TorqueGate':
        """Gate with the parameters of the node `torque_gate`.

        Parameters
        ----------
        p : types.SimpleNamespace
            Values by name, as in its table; a limit of one entry is that of every wheel.

        Returns
        -------
        TorqueGate
            Gate at the safe torque.

        Raises
        ------
        ValueError
            If parameters are inconsistent.
        """
        n = len(p.wheel_names)
        low, high, rate = (
            values * n if len(values) == 1 else values
            for values in (p.min_torque, p.max_torque, p.max_rate)
        )
        return cls(
            p.wheel_names,
            low,
            high,
            rate,
            timeout=p.timeout,
            release_time=p.release_time,
            safe_torque=p.safe_torque,
            max_age=p.max_age,
        )

    def command(
        self, t: float, stamp: float, names: Sequence[str], efforts: Sequence[float]
    ) -> bool:
        """Process a command.

        After a pause torques start from the measured shaft torque, limited to the range between
        the last output and the command. So a faulty torque sensor cannot cause a torque outside
        this range.

        Parameters
        ----------
        t : float
            Time of arrival, s.
        stamp : float
            Stamp, s, 0 for none; must not run backwards while commands come.
        names : sequence of str
            Every wheel once, in any order.
        efforts : sequence of float
            Torques, N·m, one per name.

        Returns
        -------
        bool
            True if accepted, with the torques to send now in `output`; False if rejected, with the
            cause in `reason`.
        """
        self.step(t)
        if self.stopped_by:
            self.rejected['stopped'] += 1
            return False
        restart = self.state in (State.WAITING, State.RELEASING, State.SAFE)
        try:
            commanded = self._commands.values(names, efforts)
            # After a pause any stamp is accepted, as the clock may have been set back.
            if not restart and 0.0 < stamp < self._last_stamp:
                age = self._last_stamp - stamp
                raise JointError(
                    'stamp', f'stamp {stamp:.3f} s is {age:.3f} s older than the last'
                )
            if stamp > 0.0 and t - self._last_stamped <= self._timeout:
                self._compare(self._newest_stamp - stamp)
        except JointError as error:
            self.rejected[error.cause] += 1
            self._rejection = str(error)
            if not restart:
                self.state = State.HOLDING
            return False
        measured = t - self._last_measured <= self._timeout
        dt = 0.0 if restart else t - self._last_good
        cut_magnitude = cut_rate = False
        for j, asked in enumerate(commanded):
            goal = asked
            limit = Limit.NONE
            if asked > self._max[j]:
                goal, limit, cut_magnitude = self._max[j], Limit.HIGH, True
            elif asked < self._min[j]:
                goal, limit, cut_magnitude = self._min[j], Limit.LOW, True
            start = self.output[j]
            if restart and measured:
                low, high = (start, goal) if start < goal else (goal, start)
                start = min(max(self._measured[j], low), high)
            step = self._rate[j] * dt
            if goal > start + step:
                goal, limit, cut_rate = start + step, Limit.RATE, True
            elif goal < start - step:
                goal, limit, cut_rate = start - step, Limit.RATE, True
            self._asked[j] = asked
            self.output[j] = goal
            self.limits[j] = limit
        self.limited['magnitude'] += cut_magnitude
        self.limited['rate'] += cut_rate
        self._last_good = t
        self._last_stamp = stamp
        self._rejection = ''
        self.state = State.PASSING
        return True

    def _compare(self, age: float) -> None:
        """Reject a command by the difference of its stamp to the wheel states, s."""
        if age > self._max_age:
            raise JointError('stale', f'stamp is {age:.3f} s older than the wheel states')
        # A stamp in the future would make all later ones look old.
        if self._newest_stamp > 0.0 and age < -self._max_age:
            raise JointError('future', f'stamp is {-age:.3f} s younger than the wheel states')

    def emergency_stop(self, source: StopSource, stop: bool) -> None:
        """Start or release the emergency stop of a source.

        A stop sets `output` to the safe torque at once. After the last release commands pass
        again, as after a pause.

        Parameters
        ----------
        source : StopSource
            Source of the stop.
        stop : bool
            True to stop, False to release.
        """
        if stop:
            self.stopped_by.add(source)
        else:
            self.stopped_by.discard(source)
        if self.stopped_by or self.state is State.STOPPED:
            self._rejection = ''
            self.release()

    def measured(
        self, t: float, stamp: float, names: Sequence[str], efforts: Sequence[float]
    ) -> bool:
        """Set measured shaft torques, from which commands start after a pause.

        Parameters
        ----------
        t : float
            Time of arrival, s.
        stamp : float
            Stamp, s, 0 for none: commands much older than it are stale.
        names : sequence of str
            Joints, among them every wheel once, in any order.
        efforts : sequence of float
            Torques, N·m, one per name.

        Returns
        -------
        bool
            False if they were unusable; then only their stamp is used, and that only if it is not
            of another clock than the stamps that still come.
        """
        alive = t - self._last_stamped <= self._timeout
        known = alive and self._newest_stamp > 0.0
        if known and abs(stamp - self._newest_stamp) > self._MAX_STEP:
            return False
        self._newest_stamp, self._last_stamped = stamp, t
        try:
            self._measured = self._measurements.values(names, efforts)
        except JointError:
            return False
        self._last_measured = t
        return True

    def step(self, t: float) -> bool:
        """Check the timeout; call it every `WATCHDOG_PERIOD`.

        Parameters
        ----------
        t : float
            Now, s.

        Returns
        -------
        bool
            True if commands have stopped or never came, so that `output` must be sent now.
        """
        if self.state in (State.PASSING, State.HOLDING) and t - self._last_good > self._timeout:
            self.state = State.RELEASING
            self.timeouts += 1
            self._held[:] = self.output
        if self.state is State.RELEASING:
            # Relative to the timeout itself, so that a late call does not end later.
            since = t - self._last_good - self._timeout
            if since >= self._release_time:
                self.release()
            else:
                left = 1.0 - since / self._release_time
                for j, held in enumerate(self._held):
                    self.output[j] = self._safe + left * (held - self._safe)
        return self.state not in (State.PASSING, State.HOLDING)

    def release(self) -> None:
        """Set the safe torque at once, for deactivation."""
        self.state = State.WAITING if self._last_good == -math.inf else State.SAFE
        if self.stopped_by:
            self.state = State.STOPPED
        for j in range(len(self.output)):
            self.output[j] = self._safe

    @property
    def limiting(self) -> bool:
        """True if the last command was passed with at least one torque cut."""
        return self.state is State.PASSING and any(
            limit is not Limit.NONE for limit in self.limits
        )

    @property
    def reason(self) -> str:
        """Explanation of `output` for a person, with wheel and value."""
        if self.state is State.PASSING:
            cuts = [self._cut(j) for j, limit in enumerate(self.limits) if limit is not Limit.NONE]
            return 'limited: ' + '; '.join(cuts) if cuts else 'passing commands'
        if self.state is State.STOPPED:
            held = ' and '.join(sorted(source.value for source in self.stopped_by))
            return f'emergency stop: at {self._safe:g} N·m until released by {held}'
        cause = f': {self._rejection}' if self._rejection else ''
        if self.state is State.HOLDING:
            return f'holding the last good command{cause}'
        if self.state is State.WAITING:
            return f'at {self._safe:g} N·m, no good command yet{cause}'
        where = 'at' if self.state is State.SAFE else 'going to'
        return f'{where} {self._safe:g} N·m, no good command for {self._timeout:g} s{cause}'

    def _cut(self, j: int) -> str:
        asked, given = self._asked[j], self.output[j]
        text = f'{self._wheels[j]} {asked:.1f} N·m to {given:.1f} N·m'
        if self.limits[j] is Limit.RATE:
            return f'{text} at {self._rate[j]:g} N·m/s'
        return f'{text}, {"most" if self.limits[j] is Limit.HIGH else "least"} allowed'
