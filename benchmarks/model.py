"""Speed of the model against other solvers of the same equations, all in one run.

``make bench`` runs it; the exit status is 1 where a target is missed. What the figures mean, and
what limits them, is told in docs/performance.md.
"""

import shutil
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from peers import Octave, Scipy, SolverError, closed_form, stress_integrals
from problem import SAMPLE_TIME, Problem, recorded
from rich.console import Console
from rich.table import Table

from traction_model import Drawbar, Form, Trajectory, simulate, simulate_batch

DURATION = 10.0

REPEATS = 25
"""Runs of ours, of which the quickest counts."""

PEER_TIME = 2.0
"""A peer runs again, at most `REPEATS` times in all, until it has had this time, s."""

BATCH = 64

BATCH_DURATION = 2.0

BATCH_REPEATS = 5

CLOSE = 1e-3
"""How far speeds may lie from the peer's, as a share of the greatest."""


@dataclass
class Row:
    """Row of the table: a ratio and its target."""

    what: str
    ours: str
    peer: str
    theirs: str
    ratio: float
    target: float | None = None
    difference: float | None = None

    @property
    def met(self) -> bool:
        close = self.difference is None or self.difference <= CLOSE
        return close and (self.target is None or self.ratio >= self.target)


def quickest(run: Callable[[], object], repeats: int) -> float:
    """Least time of several runs, s, after one that compiles."""
    run()
    least = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        least = min(least, time.perf_counter() - begin)
    return float(least)


def drive(problem: Problem, form: Form) -> Trajectory:
    """Ours."""
    return simulate(
        problem.vehicle, problem.soil, problem.torque, SAMPLE_TIME, form=form,
        drawbar=problem.drawbar, multipass=False, v0=problem.v0, omega0=problem.omega0,
    )  # fmt: skip


def compare(what, problem, form, peers, real_time, console):
    """Rows of one problem: against real time, and against each peer with its target."""
    ours = drive(problem, form)
    took = quickest(lambda: drive(problem, form), REPEATS)
    shown = f'{took * 1e3:.2f} ms'
    yield Row(
        what, shown, 'real time', f'{problem.duration:.0f} s', problem.duration / took, real_time
    )
    for peer, target in peers:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                runs = [peer(problem, ours.sinkage[0])]
                while sum(run[0] for run in runs) < PEER_TIME and len(runs) < REPEATS:
                    runs.append(peer(problem, ours.sinkage[0]))
        except SolverError as failure:
            console.print(f'{what}: {peer.name} gave no answer: {failure}')
            continue
        seconds, v, omega = min(runs, key=lambda run: run[0])
        difference = max(
            np.abs(one - other).max() / np.abs(other).max()
            for one, other in ((ours.v, v), (ours.omega, omega))
        )
        yield Row(
            what, shown, peer.name, f'{seconds * 1e3:.0f} ms', seconds / took, target, difference
        )


def model_rows(console):
    """All rows."""
    octave = shutil.which('octave-cli') or shutil.which('octave')
    if not octave:
        console.print('Octave is not compared: no `octave` on the PATH (apt install octave)')

    def peers(right_hand_side, target):
        # A step of one sample at most, or samples are overlooked; then free steps, which a
        # torque as smooth as this one allows.
        return [
            (Scipy('RK45', right_hand_side, max_step=SAMPLE_TIME), target),
            (Scipy('LSODA', right_hand_side, max_step=SAMPLE_TIME), None),
            (Scipy('RK45', right_hand_side), None),
            (Scipy('LSODA', right_hand_side), None),
        ]

    octaves = [(Octave(octave), None)] if octave else []
    wheel = 'wheel_torque_sine', Drawbar(900, 300, 2.0)
    tractor = 'tractor_sandy_loam', Drawbar(6000, 1500, 2.0)
    plate, arcs = (closed_form, Form.BEKKER_WONG), (stress_integrals, Form.CONTACT)
    runs = [
        ('one wheel, closed form', wheel, plate, 5000.0, 400.0, octaves),
        ('one wheel, 24 points', wheel, arcs, None, 20.0, []),
        ('four wheels, closed form', tractor, plate, None, None, []),
        ('four wheels, 24 points', tractor, arcs, None, None, []),
    ]
    for what, (bag, drawbar), (right_hand_side, form), real_time, target, more in runs:
        # The contact form's peer is written for wheels that roll.
        for rolling in (False, True) if form == Form.BEKKER_WONG else (True,):
            problem = recorded(bag, drawbar, DURATION, rolling=rolling)
            title = f'{what}, {"rolling" if rolling else "from rest"}'
            others = peers(right_hand_side, target) + more
            wanted = real_time
            yield from compare(title, problem, form, others, wanted, console)


def batch_rows():
    """Rows of batches of four-wheel vehicles on different soils."""
    tractor = recorded(
        'tractor_sandy_loam', Drawbar(6000, 1500, 2.0), BATCH_DURATION, rolling=True
    )
    angles = np.linspace(0.9, 1.1, BATCH) * tractor.soil.friction_angle
    soils = [tractor.soil.model_copy(update={'friction_angle': angle}) for angle in angles]
    steps = BATCH * (len(tractor.torque) - 1) * len(tractor.vehicle.wheels)
    cores = numba.get_num_threads()
    runs = [('closed form', Form.BEKKER_WONG, 5e6), ('contact form in ruts', Form.CONTACT, 5e5)]
    for what, form, target in runs:

        def run(form=form):
            simulate_batch(
                tractor.vehicle, soils, tractor.torque, SAMPLE_TIME, form=form,
                drawbars=tractor.drawbar, v0=tractor.v0,
                every=len(tractor.torque) - 1,
            )  # fmt: skip

        for threads in (1, cores):
            numba.set_num_threads(threads)
            took = quickest(run, BATCH_REPEATS)
            yield Row(
                f'{BATCH} tractors, {what}', f'{took * 1e3:.0f} ms',
                'wheel-steps/s on one core' if threads == 1 else f'the same on {threads} cores',
                '', steps / took, target if threads == 1 else None,
            )  # fmt: skip


def main() -> int:
    """Entry point of ``make bench``."""
    # Output to a file has no terminal width.
    console = Console(width=None if sys.stdout.isatty() else 150)
    rows = [*model_rows(console), *batch_rows()]
    table = Table(title=f'{DURATION:.0f} s of torque at {1 / SAMPLE_TIME:.0f} Hz')
    for name in ('what', 'ours', 'peer', 'its time', 'ratio', 'target', 'difference', ''):
        table.add_column(name, justify='left' if name in ('what', 'peer', '') else 'right')
    for row in rows:
        table.add_row(
            row.what, row.ours, row.peer, row.theirs,
            f'{row.ratio:,.{1 if row.ratio < 1000 else 0}f}',
            '' if row.target is None else f'{row.target:,.0f}',
            '' if row.difference is None else f'{row.difference:.1e}',
            'met' if row.met else '[red]missed',
        )  # fmt: skip
    console.print(table)
    return 0 if all(row.met for row in rows) else 1


if __name__ == '__main__':
    sys.exit(main())
