"""Every row of docs/safety.md with faults of topics and processes, on the running suite."""

from pathlib import Path

import pytest
from fault_rows import EVERY_TIME, check, rows

from traction_bringup.system import system
from traction_evaluation.faults.bench import FaultBench, recorded
from traction_evaluation.faults.table import BUS_ROWS, ROWS

pytestmark = pytest.mark.process


def test_rows_of_every_time_are_in_the_table():
    assert {row.name for row in (*ROWS, *BUS_ROWS)} >= EVERY_TIME


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return tmp_path_factory.mktemp('faults') / 'bag'


@pytest.fixture(scope='module')
def bench(bag):
    with FaultBench(system, bag) as running:
        yield running


@pytest.mark.parametrize('row', rows(ROWS))
def test_fault(bench, row):
    check(row, bench.measure(row))


def test_emergency_stop_is_held_by_each_until_all_have_released_it(bench):
    bench.await_driving()
    bench.stop_by_topic(True)
    bench.stop_by_service(True)
    bench.await_said('torque_gate', 'released by service and topic')
    bench.stop_by_topic(False)
    bench.await_said('torque_gate', 'released by service')
    assert bench.torque == [0.0] * 4
    bench.stop_by_service(False)
    bench.await_driving()


def test_torque_starts_from_the_measured_one(bench):
    bench.await_driving()
    bench.faults['wheel_torque_command'] = lambda message: ()
    bench.probe.wait_for(lambda: bench.torque == [0.0] * 4, 'safe torque')
    bench.faults.clear()
    bench.probe.wait_for(lambda: bench.torque[-1] > 0.0, 'torque')
    # The shaft lags by 0.1 s, so there is some of it left; from there by at most max_rate.
    measured = max(bench.shaft[-1], bench.shaft_before[-1])
    assert 0.0 < bench.torque[-1] <= measured + 40_000.0 * 0.05


def test_nothing_recorded_is_lost(bench, bag: Path):
    """Last: it ends the recorder."""
    kept, heard = recorded(bench, bag)
    assert heard > 500
    assert kept == heard
