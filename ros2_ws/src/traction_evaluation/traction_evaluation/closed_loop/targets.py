"""Targets of the LPV controller."""

from collections.abc import Mapping

from traction_controller.synthesis.certificate import DENSER
from traction_controller.synthesis.gain_table import read_table_file
from traction_evaluation.closed_loop.statistics import Result, quantile, seconds
from traction_evaluation.loop.shipped import VEHICLE
from traction_evaluation.markdown import Target
from traction_node.parameter_file import config

MAX_SETTLING = 1.0
"""Settling time less the lag of the drive, 95th percentile, s."""

MAX_OVERSHOOT = 0.2
"""Overshoot over the step, 95th percentile."""

RMSE_SHARE = 0.5
"""Slip RMSE over that of the fixed PI, dimensionless."""


def certificate_target() -> Target:
    """Target of the certificate: it holds on a grid denser than that of the synthesis.

    Returns
    -------
    Target
        Target of the shipped gain table.
    """
    try:
        _, margins = read_table_file(
            config('traction_controller', f'gains/{VEHICLE}.yaml'), DENSER
        )
    except ValueError as error:
        found, met = str(error), False
    else:
        found = f'least margin {margins.least:.2e} of {margins.points} inequalities'
        met = margins.least >= 0
    return Target(f'certificate on a grid {DENSER} times denser', found, 'at least 0', met)


def control_targets(results: Mapping[str, Result]) -> list[Target]:
    """Targets of the LPV controller.

    Parameters
    ----------
    results : mapping of str to Result
        By name of the controller.

    Returns
    -------
    list of Target
        Target of the certificate, then targets of the trials.
    """
    lpv = results['LPV']
    others = {name: each for name, each in results.items() if name != 'LPV'}
    pi = results['fixed PI']
    best = max(each.efficiency for each in others.values())
    steps = []
    for noise, suffix in (('without sensor noise', '_noise_free'), ('with sensor noise', '')):
        settling = lpv.settling_beyond_lag(f'settling{suffix}')
        over = quantile(lpv.columns[f'overshoot{suffix}'], 0.95)
        steps += [
            Target(
                f'settling of a 0.05 step less the lag, 95th percentile, {noise}',
                f'{seconds(settling)} s',
                f'at most {MAX_SETTLING:g} s',
                settling <= MAX_SETTLING,
            ),
            Target(
                f'overshoot, 95th percentile, {noise}',
                f'{100 * over:.1f} %',
                f'at most {100 * MAX_OVERSHOOT:g} %',
                over <= MAX_OVERSHOOT,
            ),
        ]
    return [
        certificate_target(),
        Target('stable', f'{100 * lpv.stable:.2f} %', '100 %', lpv.stable == 1.0),
        *steps,
        Target(
            "slip RMSE over the best fixed PI's",
            f'{lpv.rmse / pi.rmse:.3f}',
            f'at most {RMSE_SHARE:g}',
            lpv.rmse <= RMSE_SHARE * pi.rmse,
        ),
        Target(
            "tractive work per energy less the best baseline's",
            f'{lpv.efficiency - best:+.4f}',
            'at least 0',
            lpv.efficiency >= best,
        ),
    ]
