"""Tuning of the fixed PI (baseline) on separate draws."""

from typing import NamedTuple

from traction_evaluation.closed_loop.controllers import Controller, fixed_pi
from traction_evaluation.closed_loop.statistics import Result
from traction_evaluation.closed_loop.trial import TrialDraw
from traction_evaluation.closed_loop.workers import Workers

GAINS = ((0.1, 0.2, 0.4, 0.8, 1.2, 1.6, 2.4), (0.4, 0.8, 1.6, 2.4, 3.2, 4.8, 6.4))
"""Candidate gains over static load times radius: proportional, and integral, 1/s."""

FEW_GAINS = ((0.4, 1.2), (1.6, 3.2))
"""Candidate gains of a short run."""

SHORTLIST = 4


class TunedPi(NamedTuple):
    """Fixed PI with its result on the tuning draws."""

    controller: Controller
    result: Result

    @property
    def text(self) -> str:
        """Gains and result as text."""
        gains = dict(self.controller.changes)
        return (
            f'proportional {gains["slip_controller.pi_proportional"]:g} and integral '
            f'{gains["slip_controller.pi_integral"]:g} per second: '
            f'{100 * self.result.stable:.0f} % stable, slip RMSE {self.result.rmse:.4f}'
        )


def tune_pi(
    workers: Workers,
    draws: list[TrialDraw],
    gains: tuple[tuple[float, ...], tuple[float, ...]] = GAINS,
) -> tuple[TunedPi, TunedPi]:
    """Gains of minimum slip error.

    All candidates run on a quarter of the draws, the best ones on all.

    Parameters
    ----------
    workers : Workers
        Processes for the trials.
    draws : list of TrialDraw
        Draws other than those of the comparison.
    gains : pair of tuple of float
        As for `GAINS`.

    Returns
    -------
    best, least : TunedPi
        Minimum slip RMSE among the candidates most often stable, and among all.
    """
    tried = [fixed_pi(p, i) for p in gains[0] for i in gains[1]]
    few = draws[: max(1, len(draws) // 4)]

    def worth(result: Result) -> tuple[float, float]:
        return -result.stable, result.rmse

    found = workers.run('tuning the fixed PI', [(each, few) for each in tried], noise_free=False)
    first = {each: Result.of(outcomes, few) for each, outcomes in found.items()}
    # Candidates for both criteria.
    short = sorted(tried, key=lambda each: worth(first[each]))[:SHORTLIST]
    short += sorted(tried, key=lambda each: first[each].rmse)[:SHORTLIST]
    short = list(dict.fromkeys(short))
    found = workers.run('tuning the fixed PI', [(each, draws) for each in short], noise_free=False)
    results = {each: Result.of(outcomes, draws) for each, outcomes in found.items()}
    best = min(results, key=lambda each: worth(results[each]))
    least = min(results, key=lambda each: results[each].rmse)
    return TunedPi(best, results[best]), TunedPi(least, results[least])
