"""Table of hazards: fault, detection, safe output and time limit.

`make faults` measures all rows and writes docs/safety.md; tests/test_faults.py and
tests/test_faults_of_the_bus.py test every row.
"""

import itertools
import math
import signal
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import can

from traction_evaluation.faults.bench import SLIP_TARGET, BusBench, FaultBench, Row
from traction_node.parameter_file import config, read_parameters

_LIMITS = read_parameters(config('torque_gate', 'torque_gate.yaml'))['torque_gate']

# Safe outputs


def _none(bench: FaultBench, torques: Sequence[float]) -> bool:
    return all(torque == 0.0 for torque in torques)


def _within(bench: FaultBench, torques: Sequence[float]) -> bool:
    return all(
        low <= torque <= high
        for low, torque, high in zip(
            _LIMITS['min_torque'], torques, _LIMITS['max_torque'], strict=True
        )
    )


MAX_SLIP = SLIP_TARGET + 0.1
"""Largest true slip that is safe with a faulty sensor."""


def _no_more(bench: FaultBench, torques: Sequence[float]) -> bool:
    asked = all(
        0.0 <= torque <= request
        for torque, request in zip(torques, bench.request, strict=True)
    )  # fmt: skip
    return asked and bench.true_slip <= MAX_SLIP


NO_TORQUE = 'safe torque (0 N·m)'
NO_MORE = f'at most the request, and true slip at most {MAX_SLIP:g}'
WITHIN = 'within `min_torque` to `max_torque`'

# Faults of messages on a topic

Fault = Callable[[Any], Iterable[Any]]


def _fault(
    *topics: str, fault: Callable[[], Fault]
) -> tuple[Callable[[Any], None], Callable[[Any], None]]:
    """Start and end of a fault in all messages of topics."""

    def inject(bench: FaultBench) -> None:
        for name in topics:
            bench.faults[name] = fault()

    def clear(bench: FaultBench) -> None:
        bench.faults.clear()

    return inject, clear


def _change(change: Callable[[Any], None]) -> Callable[[], Fault]:
    def spoil(message: Any) -> Iterable[Any]:
        change(message)
        return (message,)

    return lambda: spoil


def _lost() -> Fault:
    return lambda message: ()


def _later(seconds: int) -> Callable[[], Fault]:
    def change(message: Any) -> None:
        message.header.stamp.sec += seconds

    return _change(change)


def _set(field: str, entry: int, value: Any) -> Callable[[], Fault]:
    def change(message: Any) -> None:
        values = list(getattr(message, field))
        values[entry] = value
        setattr(message, field, values)

    return _change(change)


def _scaled(factor: float, *wheels: int) -> Callable[[], Fault]:
    def change(message: Any) -> None:
        message.velocity = [
            velocity * (factor if j in wheels else 1.0)
            for j, velocity in enumerate(message.velocity)
        ]

    return _change(change)


def _stuck_wheels(*wheels: int) -> Callable[[], Fault]:
    def fault() -> Fault:
        first: list[float] = []

        def spoil(message: Any) -> Iterable[Any]:
            if not first:
                first.extend(message.velocity)
            message.velocity = [
                first[j] if j in wheels else velocity
                for j, velocity in enumerate(message.velocity)
            ]
            return (message,)

        return spoil

    return fault


def _jumping_wheels() -> Fault:
    factors = itertools.cycle([4.0, 1.0, 0.3, 2.5])

    def spoil(message: Any) -> Iterable[Any]:
        factor = next(factors)
        message.velocity = [factor * velocity for velocity in message.velocity]
        return (message,)

    return spoil


def _radar_as(speed: Callable[[float], float]) -> Callable[[], Fault]:
    def change(message: Any) -> None:
        message.twist.twist.linear.x = speed(message.twist.twist.linear.x)

    return _change(change)


def _stuck_radar() -> Fault:
    first: list[float] = []

    def spoil(message: Any) -> Iterable[Any]:
        first.append(message.twist.twist.linear.x)
        message.twist.twist.linear.x = first[0]
        return (message,)

    return spoil


def _jumping_radar() -> Fault:
    off = itertools.cycle([3.0, -1.0, 7.0, -4.0])

    def spoil(message: Any) -> Iterable[Any]:
        message.twist.twist.linear.x += next(off)
        return (message,)

    return spoil


def _command(hazard: str, detection: str, reason: str, fault: Callable[[], Fault]) -> Row:
    return Row(
        'Command', hazard, detection, NO_TORQUE, 'torque_gate', reason,
        *_fault('wheel_torque_command', fault=fault), _none,
    )  # fmt: skip


def _limited(hazard: str, torque: float) -> Row:
    def change(message: Any) -> None:
        message.effort = [torque] * len(message.effort)

    return Row(
        'Command', hazard, 'gate: every torque against its limits', WITHIN, 'torque_gate',
        'limited', *_fault('wheel_torque_command', fault=_change(change)), _within,
    )  # fmt: skip


def _shorter(message: Any) -> None:
    message.effort = list(message.effort)[:-1]


def _empty(message: Any) -> None:
    message.name, message.effort = [], []


_FINITE = 'gate: every torque must be finite'
_NAMES = 'gate: every wheel once, no other'
_AGE = 'gate: stamp against that of the wheel states (`max_age`)'

_COMMANDS = (
    _command('silent', 'gate: `timeout` since the last good one', 'no good command', _lost),
    _command('stale', _AGE, 'older than', _later(-1)),
    _command('stamped in the future', _AGE, 'younger than the wheel states', _later(1)),
    _command('not a number', _FINITE, 'is nan', _set('effort', 0, math.nan)),
    _command('infinite', _FINITE, 'is inf', _set('effort', 1, math.inf)),
    _command('too few torques', 'gate: one torque per name', 'values for', _change(_shorter)),
    _command('unknown wheel', _NAMES, 'is missing', _set('name', 0, 'xx')),
    _command('a wheel twice', _NAMES, 'given twice', _set('name', 0, 'fr')),
    _command('empty', _NAMES, 'is missing', _change(_empty)),
    _limited('too large', 1e6),
    _limited('too negative', -1e6),
)  # fmt: skip


# Processes


def _process(node: str, hazard: str, inject: Callable, clear: Callable) -> Row:
    return Row(
        node.removeprefix('slip_').capitalize(), hazard, 'gate: `timeout` since the last command',
        NO_TORQUE, 'torque_gate', 'no good command', inject, clear, _none,
    )  # fmt: skip


def _processes(node: str) -> Iterable[Row]:
    return (
        _process(
            node, 'killed', lambda b: b.signal(node, signal.SIGKILL), lambda b: b.start(node)
        ),
        _process(
            node, 'frozen (SIGSTOP)', lambda b: b.signal(node, signal.SIGSTOP),
            lambda b: b.signal(node, signal.SIGCONT),
        ),
        _process(node, 'restarted', lambda b: b.restart(node), lambda b: None),
    )  # fmt: skip


# Sensors


def _radar(hazard: str, detection: str, reason: str, fault: Callable[[], Fault]) -> Row:
    return Row(
        'Radar', hazard, detection, NO_MORE, 'slip_estimator', reason,
        *_fault('radar', fault=fault), _no_more,
    )  # fmt: skip


def _tachometer(
    hazard: str, detection: str, reason: str, fault: Callable[[], Fault], **others: Any
) -> Row:
    return Row(
        'Tachometer', hazard, detection, others.pop('safe', NO_TORQUE), 'slip_estimator', reason,
        *_fault('wheel_states', fault=fault), others.pop('is_safe', _none), **others,
    )  # fmt: skip


_OFF_IN_TIME = 'estimator: stamp at most 0.5 s off that of the wheels'
_DOUBT = 'estimator: five standard deviations off wheels and torque'

_RADARS = (
    _radar('lost', 'estimator: `radar_timeout`', 'radar silent', _lost),
    _radar('stuck', 'estimator: the same to the last bit', 'not believed', _stuck_radar),
    _radar('jumping', _DOUBT, 'not believed', _jumping_radar),
    _radar('ten times too large', 'estimator: faster than all wheels while they drive',
           'not believed', _radar_as(lambda v: 10.0 * v)),
    _radar('ten times too small', _DOUBT, 'not believed', _radar_as(lambda v: 0.1 * v)),
    _radar('not a number', 'estimator: must be finite', 'not usable',
           _radar_as(lambda v: math.nan)),
    _radar('stamped in the past', _OFF_IN_TIME, 'off the wheels in time', _later(-1)),
    _radar('stamped in the future', _OFF_IN_TIME, 'off the wheels in time', _later(1)),
)  # fmt: skip

_FOUR = (0, 1, 2, 3)
_JUMP = 'estimator: quicker than torque and ground can turn a wheel'
_SLOWER = 'estimator: a wheel that drives is not slower than the ground'
_SAME = 'estimator: the same to the last bit while others change (`stuck_time`)'
_THEN_NONE = f'{NO_MORE}; then {NO_TORQUE}'
_REFUSED = 'estimator: refuses the reading, so that the controller is silent'


def _one_short(message: Any) -> None:
    message.name = list(message.name)[:-1]
    message.velocity, message.effort = list(message.velocity)[:-1], list(message.effort)[:-1]


def _by_gate(hazard: str, detection: str, fault: Callable[[], Fault]) -> Row:
    """Fault reported by the gate, as the estimator receives no messages."""
    return Row(
        'Tachometer', hazard, detection, NO_TORQUE, 'torque_gate', 'no good command',
        *_fault('wheel_states', fault=fault), _none,
    )  # fmt: skip


_TACHOMETERS = (
    _by_gate('lost', 'estimator and controller silent; gate: `timeout`', _lost),
    _tachometer('all stuck', _SAME, 'are stuck', _stuck_wheels(*_FOUR), safe=_THEN_NONE,
                is_safe=_no_more),
    _tachometer('one stuck', _SAME, "'rl' is stuck", _stuck_wheels(2), safe=_THEN_NONE,
                is_safe=_no_more),
    _tachometer('jumping', _JUMP, 'jumps beyond', _jumping_wheels),
    _tachometer('all ten times too large', _JUMP, 'jumps beyond', _scaled(10.0, *_FOUR)),
    _tachometer('one ten times too large', _JUMP, "'fr' jumps beyond", _scaled(10.0, 1)),
    _tachometer('all ten times too small', _SLOWER, 'slower than the ground',
                _scaled(0.1, *_FOUR)),
    _tachometer('one ten times too small', _SLOWER, "'rr' drives, yet is slower",
                _scaled(0.1, 3)),
    _tachometer('not a number', _REFUSED, 'is nan', _set('velocity', 0, math.nan)),
    _tachometer('a wheel missing', _REFUSED, 'is missing', _change(_one_short)),
)  # fmt: skip

_STAMPS = (
    Row('Tachometer', 'stamped in the past',
        'estimator: time runs backwards, starts anew; gate: commands older than the last',
        NO_MORE, 'slip_estimator', 'off the wheels in time',
        *_fault('wheel_states', fault=_later(-1)), _no_more),
    Row('Tachometer', 'stamped in the future', 'estimator: a gap in time, starts anew', NO_MORE,
        'slip_estimator', 'off the wheels in time', *_fault('wheel_states', fault=_later(1)),
        _no_more),
    Row('Clock', 'jumps back by 10 s',
        'estimator: starts anew; gate: commands older than the last',
        NO_MORE, 'slip_estimator', 'time jumped back',
        *_fault('wheel_states', 'radar', fault=_later(-10)), _no_more),
)  # fmt: skip

_STOPS = (
    Row('Emergency stop', 'by topic', 'gate', NO_TORQUE, 'torque_gate', 'released by topic',
        lambda b: b.stop_by_topic(True), lambda b: b.stop_by_topic(False), _none),
    Row('Emergency stop', 'by service', 'gate', NO_TORQUE, 'torque_gate', 'released by service',
        lambda b: b.stop_by_service(True), lambda b: b.stop_by_service(False), _none),
)  # fmt: skip

ROWS = (
    *_COMMANDS,
    *_processes('slip_controller'),
    *_processes('slip_estimator'),
    *_RADARS,
    *_TACHOMETERS,
    *_STAMPS,
    *_STOPS,
)
"""Hazards of a `FaultBench`."""

# Bus


def _no_engine(bench: BusBench, limit: Sequence[float]) -> bool:
    return limit[0] == 0.0


def _limited_engine(bench: BusBench, limit: Sequence[float]) -> bool:
    return limit[0] <= 1.0 and bench.true_slip <= MAX_SLIP


_NO_ENGINE = 'limit of engine torque 0 on the bus'
_GOES_ON = f'limit goes on every 10 ms, and true slip at most {MAX_SLIP:g}'

BUS_ROWS = (
    Row('Bus', 'silent', 'bridge: `missed` periods; suite silent; gate: `timeout`', _NO_ENGINE,
        'can_bridge', 'silent', lambda b: b.signal('tractor_ecu', signal.SIGSTOP),
        lambda b: b.signal('tractor_ecu', signal.SIGCONT), _no_engine),
    Row('Bus', 'flooded', 'bridge: frames a second', _GOES_ON,
        'can_bridge', 'full of frames',
        lambda b: b.pour(can.Message(arbitration_id=0x18FF0042, data=bytes(8))),
        lambda b: b.pour(None), _limited_engine),
    Row('Bus', 'full of error frames', 'bridge: counts them (`error_frames`)', _GOES_ON,
        'can_bridge', 'error frames',
        lambda b: b.pour(can.Message(is_error_frame=True)), lambda b: b.pour(None),
        _limited_engine),
    Row('Bus', 'full of wheel speeds that are cut short', 'bridge: counts them (`bad_frames`)',
        _GOES_ON, 'can_bridge', 'wrong length', lambda b: b.pour(b.garble('HRW')),
        lambda b: b.pour(None), _limited_engine),
    Row('Gate', 'killed', 'bridge: its own `timeout` since the last torque', _NO_ENGINE,
        'can_bridge', 'no wheel_torque', lambda b: b.signal('torque_gate', signal.SIGKILL),
        lambda b: b.start('torque_gate'), _no_engine),
    Row('Gate', 'frozen (SIGSTOP)', 'bridge: its own `timeout` since the last torque', _NO_ENGINE,
        'can_bridge', 'no wheel_torque', lambda b: b.signal('torque_gate', signal.SIGSTOP),
        lambda b: b.signal('torque_gate', signal.SIGCONT), _no_engine),
)  # fmt: skip
"""Hazards of a `BusBench`."""
