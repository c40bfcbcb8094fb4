"""Every row of docs/safety.md with faults of the CAN bus, on the running suite.

In a module of its own: two suites in one domain would hear each other.
"""

import pytest
from fault_rows import check, rows

from traction_bringup.system import system
from traction_evaluation.faults.bench import BusBench
from traction_evaluation.faults.table import BUS_ROWS

pytestmark = pytest.mark.process


@pytest.fixture(scope='module')
def bus():
    with BusBench(system) as running:
        yield running


@pytest.mark.parametrize('row', rows(BUS_ROWS))
def test_fault_of_the_bus(bus, row):
    check(row, bus.measure(row))
