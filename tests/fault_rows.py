"""Rows of docs/safety.md as parameters of tests, and their check."""

import pytest

WAITING = 1.0
"""Allowance for a busy machine, s; `make faults` judges the limits themselves."""


EVERY_TIME = {
    'Command: silent',
    'Command: stale',
    'Command: not a number',
    'Command: unknown wheel',
    'Command: too large',
    'Controller: killed',
    'Estimator: frozen (SIGSTOP)',
    'Radar: ten times too large',
    'Tachometer: lost',
    'Tachometer: one ten times too large',
    'Clock: jumps back by 10 s',
    'Emergency stop: by topic',
    'Emergency stop: by service',
    'Bus: silent',
}
"""One row of each kind; the others take two minutes and are nightly."""


def rows(table):
    """The rows of a table as parameters."""
    return [
        pytest.param(
            row, id=row.name, marks=() if row.name in EVERY_TIME else (pytest.mark.nightly,)
        )
        for row in table
    ]


def check(row, outcome):
    assert outcome.reaction <= row.limit + WAITING, row.name
