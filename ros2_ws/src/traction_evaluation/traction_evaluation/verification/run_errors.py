"""Simulation of the Chrono runs with every form of the contact model, and tables of errors."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from traction_evaluation.markdown import Target, table
from traction_evaluation.verification.chrono import ChronoRecording
from traction_evaluation.verification.verification import (
    LIMITS,
    Errors,
    errors,
    exceeded,
    follow,
)
from traction_model.contact.contact import Form
from traction_model.simulation.simulate import Trajectory
from traction_model.slip import MIN_SPEED

FORMS = (Form.PAPER, Form.BEKKER_WONG, Form.CONTACT)
HEADINGS = ('v max, m/s', 'v mean', 'ω max, rad/s', 'ω mean', 'slip max', 'slip mean')
DIGITS = (3, 3, 3, 3, 4, 4)


class FollowedRuns(NamedTuple):
    """Simulations of the Chrono runs.

    Attributes
    ----------
    found : dict of (str, Form, bool) to Errors
        By run, form and whether sinkage was fed; m/s, rad/s, dimensionless.
    motions : dict of (str, bool) to Trajectory
        Those of the contact form, by run and whether sinkage was fed; SI units.
    """

    found: dict[tuple[str, Form, bool], Errors]
    motions: dict[tuple[str, bool], Trajectory]


def follow_runs(
    recordings: Mapping[str, ChronoRecording], progress: Callable[[], None]
) -> FollowedRuns:
    """Simulate all runs with all forms, sinkage predicted and fed.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name.
    progress : callable
        Called after each run and form.

    Returns
    -------
    FollowedRuns
        SI units.
    """
    found, motions = {}, {}
    for name, recording in recordings.items():
        for form in FORMS:
            for fed in (False, True):
                motion = follow(recording, form, fed=fed)
                found[name, form, fed] = errors(recording, motion)
                if form is Form.CONTACT:
                    motions[name, fed] = motion
            progress()
    return FollowedRuns(found, motions)


def cells(found: Errors, limits: Errors | None = None) -> list[str]:
    """Cells of a row, bold where an error is above its limit.

    Parameters
    ----------
    found : Errors
        m/s, rad/s, dimensionless.
    limits : Errors, optional
        In the same units; none when not given.

    Returns
    -------
    list of str
        Six cells.
    """
    texts = [f'{value:.{digits}f}' for value, digits in zip(found, DIGITS, strict=True)]
    missed = exceeded(found, limits) if limits else []
    return [
        f'**{text}**' if name in missed else text
        for name, text in zip(Errors._fields, texts, strict=True)
    ]


def error_table(runs: FollowedRuns, *, fed: bool) -> str:
    """Errors of all runs in all forms.

    Parameters
    ----------
    runs : FollowedRuns
        m/s, rad/s, dimensionless.
    fed : bool
        Whether sinkage was fed.

    Returns
    -------
    str
        Markdown; bold where the contact form is above its limits.
    """
    rows = [
        [name, form.name.lower(), *cells(each, LIMITS[name] if form is Form.CONTACT else None)]
        for (name, form, was_fed), each in runs.found.items()
        if was_fed is fed
    ]
    return table(('run', 'form', *HEADINGS), rows)


def axle_table(recordings: Mapping[str, ChronoRecording], runs: FollowedRuns) -> str:
    """Mean errors of the tractor's front and rear wheels, sinkage predicted.

    Parameters
    ----------
    recordings : mapping of str to ChronoRecording
        Runs by name.
    runs : FollowedRuns
        The same, followed.

    Returns
    -------
    str
        Markdown; rad/s, dimensionless, m.
    """
    rows = []
    for (name, fed), motion in runs.motions.items():
        recording = recordings[name]
        if fed or recording.omega.shape[1] == 1:
            continue
        first = slice(len(recording.t) - len(motion.t), None)
        moving = np.abs(recording.rim_speed[first]) > MIN_SPEED
        by_axle = [
            np.abs(ours - chronos[first])
            .reshape(-1, 2, 2)
            .mean(axis=(0, 2), where=judged.reshape(-1, 2, 2))
            for ours, chronos, judged in (
                (motion.omega, recording.omega, np.ones_like(moving)),
                (motion.slip, recording.slip, moving),
                (1e3 * motion.sinkage, 1e3 * recording.sinkage, np.ones_like(moving)),
            )
        ]
        rows.append(
            [name, *(f'{value:.{d}f}' for pair, d in zip(by_axle, (3, 4, 1), strict=True)
                     for value in pair)]
        )  # fmt: skip
    headings = (
        'run', 'ω front, rad/s', 'ω rear', 'slip front', 'slip rear', 'sinkage front, mm',
        'sinkage rear',
    )  # fmt: skip
    return table(headings, rows)


def run_targets(found: Mapping[str, Errors]) -> list[Target]:
    """Targets of the runs with rims below 11 m/s.

    Parameters
    ----------
    found : mapping of str to Errors
        Errors of the contact form, sinkage predicted, by run; m/s, rad/s, dimensionless.

    Returns
    -------
    list of Target
        One for each of speed, wheel speed and slip: the worst run.
    """
    targets = []
    for field, what, unit in (
        ('v_mean', 'speed', ' m/s'),
        ('omega_mean', 'wheel speed', ' rad/s'),
        ('slip_mean', 'slip', ''),
    ):
        limits = {name: getattr(limit, field) for name, limit in LIMITS.items()}
        held = {
            name: getattr(each, field) for name, each in found.items() if np.isfinite(limits[name])
        }
        worst = max(held, key=lambda name: held[name] / limits[name])
        targets.append(
            Target(
                f'mean error of {what}, sinkage predicted, worst of {len(held)} runs ({worst})',
                f'{held[worst]:.4f}{unit}',
                f'at most {limits[worst]:g}{unit}',
                held[worst] <= limits[worst],
            )
        )
    return targets
